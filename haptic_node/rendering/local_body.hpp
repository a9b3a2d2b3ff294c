#pragma once
/// @file local_body.hpp
/// A body near the proxy, as local_contact simulates it. Frame W, SI units.
#include <cstddef>
#include <cstdint>
#include <variant>

#include <Eigen/Core>

#include "haptic_node/rendering/blend.hpp"
#include "haptic_node/rendering/body_driven.hpp"
#include "haptic_node/rendering/body_fixed.hpp"
#include "haptic_node/rendering/body_free.hpp"
#include "haptic_node/rendering/body_motion.hpp"
#include "haptic_node/rendering/body_pile.hpp"
#include "haptic_node/rendering/ladder_share.hpp"

namespace haptic {

/// What all kinds have in common, and the kind. Each kind says what an answer changes (take), what it adds to a step
/// (join, fill_row, add_rows) and where a step brings it (advance).
struct LocalBody {
  bool used = false;
  bool named = false;       ///< By the answer that is being taken.
  std::uint32_t index = 0;  ///< In the scene's order.
  Blend blend;              ///< With which what an answer changes is brought in.
  BodyMotion motion;        ///< Of a rigid one.
  std::size_t group = 0;    ///< Free bodies with the same number push each other; 0: it touches no other.
  int shape = -1;           ///< Which of the known shapes its contacts follow; −1: planes, as they are told.
  Eigen::Vector3d origin_B_m = Eigen::Vector3d::Zero();  ///< Of the shape's frame, from the centre, in that frame.
  PileBody::Known known;                                 ///< By the last answer.
  std::size_t place = 0;                                 ///< Among the hand impulses.
  Impulse heard;                                         ///< By other hands, in the running step.
  LadderShare ladder;                                    ///< Of a free one. Other kinds get it with the next answer.
  std::variant<FixedBody, DrivenBody, FreeBody, PileBody> kind;

  /// In the running step, besides what the own hand gives.
  [[nodiscard]] Impulse given() const noexcept {
    Impulse out = heard;
    out += ladder.due();
    return out;
  }
  /// An impulse of the hand moves it.
  [[nodiscard]] bool is_moved() const noexcept { return as<FreeBody>() != nullptr || as<PileBody>() != nullptr; }
  template <class Kind>
  [[nodiscard]] Kind* as() noexcept {
    return std::get_if<Kind>(&kind);
  }
  template <class Kind>
  [[nodiscard]] const Kind* as() const noexcept {
    return std::get_if<Kind>(&kind);
  }
  /// The body as that kind, which it becomes if it was another.
  template <class Kind>
  [[nodiscard]] Kind& become() noexcept {
    if (auto* const same = as<Kind>()) return *same;
    return kind.template emplace<Kind>();
  }
};

}  // namespace haptic
