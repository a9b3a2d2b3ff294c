#pragma once
/// @file body_motion.hpp
/// What the kinds of bodies of local_contact share: a body's motion, its row of an answer, and the time since. Frame W,
/// SI units.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "haptic_node/rendering/contact_solver.hpp"
#include "haptic_node/rendering/impulse_history.hpp"
#include "haptic_node/rendering/known_shapes.hpp"
#include "haptic_node/rendering/other_hands.hpp"
#include "haptic_node/rendering/tuning.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/contact_messages.hpp"
#include "rtbus/eigen.hpp"

namespace haptic {

/// To which contacts are solved in a tick; in a part of a replay as many times as much as that is longer. Where each
/// tick is off by it to the same side, a body is off by ½·(tolerance/tick)·age² when the next answer comes: for ticks
/// of 1 ms by 8 um after 90 ms. With 3e-5 it was 0.12 mm, and boxes swung that all but tip over.
inline constexpr double kTolerance_m_s = 2e-6;

/// The turn of what spins at `rate_rad_s` for `h` seconds.
[[nodiscard]] inline Eigen::Quaterniond turn_of(const Eigen::Vector3d& rate_rad_s, double h) noexcept {
  const double rate = rate_rad_s.norm();
  if (rate * h <= 0.0) return Eigen::Quaterniond::Identity();
  return Eigen::Quaterniond(Eigen::AngleAxisd(rate * h, rate_rad_s / rate));
}

/// Where a rigid body is, and how it moves.
struct BodyMotion {
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d angular_velocity_rad_s = Eigen::Vector3d::Zero();
  Eigen::Quaterniond q_WB = Eigen::Quaterniond::Identity();  ///< Of what has a known shape and moves.

  [[nodiscard]] Eigen::Vector3d velocity_at(const Eigen::Vector3d& from_centre_m) const noexcept {
    return velocity_m_s + angular_velocity_rad_s.cross(from_centre_m);
  }
  void brake(double slower) noexcept {
    velocity_m_s *= slower;
    angular_velocity_rad_s *= slower;
  }
  /// No faster than `lasting_m_s`, and without spin.
  void slow_down(double lasting_m_s) noexcept {
    angular_velocity_rad_s.setZero();
    const double speed = velocity_m_s.norm();
    if (speed > lasting_m_s) velocity_m_s *= lasting_m_s / speed;
  }
};

/// Who holds whom in a support of an answer.
struct ToldPair {
  static constexpr std::size_t kNone = rtbus::kContactSlots;
  std::size_t held = 0;        ///< A row …
  std::size_t holder = kNone;  ///< … and another; kNone: what holds has none.
  double sign = 1.0;           ///< −1: the other way round than it is told.
};

/// One body's row of an answer.
struct ToldBody {
  const rtbus::ProxyContacts& answer;
  std::size_t row = 0;
  bool complete = true;       ///< All supports of the body found a place in the answer.
  std::size_t supports = 0;   ///< So many did.
  double loosest_per_kg = 0;  ///< Largest inverse mass of what holds the body; 0: all that holds it stands.
  bool together = false;      ///< With all that touches it: who holds it is known.
  std::span<const std::size_t> slot_of_row{};  ///< Of the local world.

  [[nodiscard]] Eigen::Vector3d centre_m() const noexcept { return rtbus::vector_of(answer.body_centre_m[row]); }
  /// Of unit length where it is known.
  [[nodiscard]] Eigen::Quaterniond q_WB() const noexcept {
    const rtbus::Quat& q = answer.body_orientation_wxyz[row];
    return Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized();
  }
  /// What rolls is held, so that it is held below its centre.
  [[nodiscard]] ToldPair pair(std::size_t support) const noexcept {
    ToldPair out{answer.support_body[support]};
    const std::size_t holder = answer.support_holder[support];
    if (!together || holder == 0 || holder - 1 == out.held) return out;
    out.holder = holder - 1;
    if (!is_ball(out.held) && is_ball(out.holder)) {
      std::swap(out.held, out.holder);
      out.sign = -1.0;
    }
    return out;
  }
  /// Only balls have contacts with a curvature.
  [[nodiscard]] bool is_ball(std::size_t which) const noexcept {
    for (std::size_t i = 0; i < std::min<std::size_t>(answer.contacts, rtbus::kContactSlots); ++i) {
      if (answer.contact_body[i] == which) return answer.contact_curvature_per_m[i] > 0.0;
    }
    return false;
  }
  /// A quaternion is none where its length is farther from 1.
  [[nodiscard]] bool knows_orientation() const noexcept {
    constexpr double kUnit = 1e-3;
    const rtbus::Quat& q = answer.body_orientation_wxyz[row];
    return std::abs(Eigen::Quaterniond(q[0], q[1], q[2], q[3]).norm() - 1.0) <= kUnit;
  }
  /// Of the frame of its shape, from the centre, in that frame.
  [[nodiscard]] Eigen::Vector3d origin_B_m() const noexcept {
    return q_WB().conjugate() * rtbus::vector_of(answer.body_origin_from_centre_m[row]);
  }
  [[nodiscard]] BodyMotion motion() const noexcept {
    return {centre_m(), rtbus::vector_of(answer.body_velocity_m_s[row]),
            rtbus::vector_of(answer.body_angular_velocity_rad_s[row]), q_WB()};
  }
};

/// From the instant that an answer describes to now, and what the hand gave the body in that time.
struct SinceAnswer {
  std::uint64_t from_ns = 0;
  std::uint64_t now_ns = 0;
  int parts = 1;         ///< In which the re-simulation goes.
  double tick_s = 1e-3;  ///< Period of the loop.
  const ImpulseHistory& history;
  const Impulse& sum;                ///< Of the hand impulses, now.
  OtherHands::Since others;          ///< What other hands gave it.
  SolverContact* scratch = nullptr;  ///< Room for the rows of all supports.
  const Tuning& tuning;
  const KnownShapes& shapes;
  double world_lag_s = 0.0;  ///< The world of the answer is so much older than the hand's sample (WorldClock).
  bool networked = false;    ///< The answer has come over a network, and is old.
  double proxy_kg = 0.0;     ///< Mass of the proxy in a tick: h(hK + B).

  /// For which the world moves on.
  [[nodiscard]] double seconds() const noexcept {
    return from_ns < now_ns ? std::max(tick_s, rtbus::seconds_between(from_ns, now_ns) + world_lag_s) : 0.0;
  }
  /// Sum of the hand impulses at that time.
  [[nodiscard]] Impulse given_at(std::uint64_t time_ns) const noexcept { return history.at(time_ns, sum); }
};

/// The end of one step, for the bodies.
struct StepSolution {
  const SolverBody* bodies = nullptr;
  const SolverContact* rows = nullptr;
  double h = 0.0;                                        ///< How long it is [s].
  Eigen::Vector3d pushed_n_s = Eigen::Vector3d::Zero();  ///< By the proxy, on the body.
};

}  // namespace haptic
