#pragma once
/// @file body_pile.hpp
/// A body of a pile, held by bodies that move themselves: how it moves when it is pushed, as far as two answers of
/// physics can tell. Frame W, SI units.
#include <algorithm>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "haptic_node/rendering/body_motion.hpp"
#include "rtbus/realtime.hpp"

namespace haptic {

/// A pile gives way like a damper:
///
///   v = v_mean + mobility · (F − F_mean)
///
/// v_mean and F_mean are its speed and the push on it in the mean over the last period of physics. Cubes that are
/// pushed through each other at full rate do so (docs/decisions/0008). Without the push it does not spring back:
/// against F_mean it comes no faster than v_mean. What an answer changes in both means is blended in: at once, a speed
/// is a jump of the damper's force. @realtime Yes.
class PileBody {
 public:
  /// Where an answer had a body, and what the hand had given it until then.
  struct Known {
    std::uint64_t time_ns = 0;  ///< 0: no answer yet.
    Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
    Eigen::Vector3d given_n_s = Eigen::Vector3d::Zero();
  };

  /// @param before Of the answer before. @param given_n_s Hand impulse until this answer's instant.
  /// @param hand_m_s How fast the hand moves.
  Eigen::Quaterniond take(const ToldBody& told, const SinceAnswer& since, const Known& before,
                          const Eigen::Vector3d& given_n_s, double hand_m_s,
                          BodyMotion& motion) noexcept RTBUS_NONBLOCKING;

  /// Told: it moved at `speed_m_s` under `push_n`, both means over the last period.
  /// @param lasting_m_s Speeds beyond that are over by the time they are told.
  void learn(const Eigen::Vector3d& push_n, const Eigen::Vector3d& speed_m_s,
             double lasting_m_s) noexcept RTBUS_NONBLOCKING;

  void set_mobility(double mobility_m_s_n) noexcept { mobility_m_s_n_ = mobility_m_s_n; }

  /// Answers are late: it comes to rest, and gives way no more.
  void brake(double slower) noexcept RTBUS_NONBLOCKING;

  /// Completes the row of a contact with the proxy. @param hand_m_s Velocity of the hand.
  void fill_row(const Eigen::Vector3d& hand_m_s, double h, SolverContact& row) const noexcept RTBUS_NONBLOCKING;

  /// As its contacts took it to move when they were solved. @param share Of what the last answer changed, brought in.
  void advance(const StepSolution& step, double share, BodyMotion& motion) noexcept RTBUS_NONBLOCKING;

  /// The way in `seconds`, in which it was given `impulse_n_s`.
  [[nodiscard]] Eigen::Vector3d way_m(const Eigen::Vector3d& impulse_n_s,
                                      double seconds) const noexcept RTBUS_NONBLOCKING;

  /// Its speed if nothing pushed and nothing held it: what a contact starts from.
  [[nodiscard]] Eigen::Vector3d free_m_s() const noexcept RTBUS_NONBLOCKING {
    return flow_.speed_m_s - mobility_m_s_n_ * flow_.push_n;
  }
  /// It comes along `normal` no faster than this.
  [[nodiscard]] double advance_m_s(const Eigen::Vector3d& normal) const noexcept RTBUS_NONBLOCKING {
    return std::max(0.0, normal.dot(flow_.speed_m_s));
  }
  /// The last answer told what holds it. Bodies of a pile bounce: for an instant nothing may.
  [[nodiscard]] bool held() const noexcept { return held_; }
  [[nodiscard]] const Eigen::Vector3d& speed_m_s() const noexcept { return flow_.speed_m_s; }

 private:
  [[nodiscard]] Eigen::Vector3d surface_m_s(const Eigen::Vector3d& hand_m_s,
                                            const Eigen::Vector3d& normal) const noexcept;

  /// Means over a period: that fast under that push.
  struct Flow {
    Eigen::Vector3d push_n = Eigen::Vector3d::Zero();
    Eigen::Vector3d speed_m_s = Eigen::Vector3d::Zero();
  };
  bool held_ = false;
  double mobility_m_s_n_ = 0.0;  ///< m/s per N.
  Flow flow_;                    ///< It is taken to go so …
  Flow told_;                    ///< … and comes to this.
};

}  // namespace haptic
