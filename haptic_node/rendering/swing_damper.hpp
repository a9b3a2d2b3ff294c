#pragma once
/// @file swing_damper.hpp
/// What takes the energy out of a body that swings under a hand at rest. Frame W, SI units.
#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include "haptic_node/rendering/contact_solver.hpp"
#include "haptic_node/rendering/tuning.hpp"

namespace haptic {

/// A box or a hull on its edge is an oscillator on the spring of the hand. Where the coupling has no damping nothing
/// ends its swing. So while the hand rests, a contact pushes more as the body comes, and less as it goes:
///
///   F = (1 + share · s) · F_solved,     s from −1 (goes) to 1 (comes).
///
/// That is the damping of K. H. Hunt and F. R. E. Crossley ("Coefficient of restitution interpreted as damping in
/// vibroimpact", J. Appl. Mech. 42, 1975), bounded: it never pulls, is nothing where nothing moves, and is no more than
/// Tuning::swing_share of the force. The body gets what the hand gets. One thread. @realtime Everything.
class SwingDamper {
 public:
  explicit SwingDamper(const Tuning& tuning) noexcept : share_(tuning.swing_share) {}

  void forget() noexcept { swing_ = size_ = sum_ = 0.0; }

  /// A solved row of the proxy on anything else.
  void see(const SolverContact& row) noexcept { size_ += row.normal_n_s; }
  /// On a body whose surface there comes at the hand at `relative_m_s`.
  void see(const SolverContact& row, const Eigen::Vector3d& relative_m_s) noexcept {
    see(row);
    sum_ += row.normal_n_s * std::clamp(row.normal.dot(relative_m_s) / kWhole_m_s, -1.0, 1.0);
  }

  /// After all rows of a step. @param rests The hand does.
  void follow(bool rests) noexcept {
    const double now = rests && size_ > 0.0 && std::isfinite(sum_) ? sum_ / size_ : 0.0;
    swing_ -= std::expm1(-1.0 / kFollows) * (now - swing_);
    size_ = sum_ = 0.0;
  }

  /// On the proxy, besides the solved row.
  [[nodiscard]] Eigen::Vector3d more_n_s(const SolverContact& row) const noexcept {
    return share_ * swing_ * row.normal_n_s * row.normal;
  }

 private:
  /// From this speed on it pushes by the whole share more. What is slower stands still.
  static constexpr double kWhole_m_s = 1e-3;
  /// In so many ticks it follows, so that no answer is a step. A box that is met at its shape swings once in 28 ticks
  /// at most, on its edge in 14 (FreeBody): what follows later would drive it.
  static constexpr double kFollows = 3.0;
  double share_;                   ///< Tuning::swing_share.
  double swing_ = 0.0;             ///< s, from −1 to 1.
  double size_ = 0.0, sum_ = 0.0;  ///< Of the step's rows.
};

}  // namespace haptic
