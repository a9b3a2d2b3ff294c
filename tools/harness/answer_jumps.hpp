#pragma once
/// @file answer_jumps.hpp
/// What answers of physics change in the force of local_contact at once: the same tick with the answer and without it.
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <vector>

#include "haptic_node/node_config.hpp"
#include "haptic_node/rendering/local_contact.hpp"
#include "haptic_node/rendering/mapping.hpp"
#include "rtbus/contact_messages.hpp"
#include "rtbus/messages.hpp"

namespace tools {

/// A second local_contact beside the loop's, fed with what that one saw. Where an answer comes a third one goes on
/// without it for kFollowed ticks, under the same hand.
/// One hand alone, without clutch, orders or workspace walls.
class AnswerJumps {
 public:
  /// @param config Of the node that is watched; its method is local_contact.
  explicit AnswerJumps(const haptic::HapticConfig& config);
  AnswerJumps(const AnswerJumps&) = delete;
  AnswerJumps& operator=(const AnswerJumps&) = delete;

  /// Physics has made that answer (Harness::observe_contacts).
  void tell(const rtbus::ProxyContacts& answer) { under_way_.push_back(answer); }
  /// The loop has made that tick. @returns the change of the force by the answer that it took [N]; 0: it took none.
  double see(const rtbus::Telemetry& tick);

  static constexpr int kFollowed = 10;

  /// Of all answers while something was touched with them or without them.
  [[nodiscard]] const std::vector<double>& changes_n() const noexcept { return changes_n_; }
  [[nodiscard]] double largest_n() const noexcept;
  /// How fast the two forces part in the ticks that are followed: the largest change of their difference in a tick.
  [[nodiscard]] double fastest_n() const noexcept { return fastest_n_; }
  /// Ticks in which the loop made another force than this: then the rest means nothing.
  [[nodiscard]] std::size_t others() const noexcept { return others_; }

 private:
  haptic::Mapping mapping_;
  haptic::LocalContact method_;
  std::unique_ptr<haptic::LocalContact> without_;  ///< What an answer would have told.
  int follows_ = 0;                                ///< So many ticks more.
  Eigen::Vector3d apart_n_ = Eigen::Vector3d::Zero();
  double fastest_n_ = 0.0;
  double dt_s_;
  std::deque<rtbus::ProxyContacts> under_way_;
  std::uint64_t taken_ = 0;
  std::vector<double> changes_n_;
  std::size_t others_ = 0;
};

}  // namespace tools
