#include "rtbus/config/body_motion.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace rtbus::config {
namespace {

using Eigen::Vector3d;

PlacedAt place(const SinusoidMotion& motion, const Vector3d& p, const Eigen::Quaterniond& q, double t_s) {
  const double phase = 2.0 * std::numbers::pi * motion.frequency_hz * std::max(0.0, t_s - motion.start_s);
  return {p + motion.travel_m * (0.5 - 0.5 * std::cos(phase)), q};
}

PlacedAt place(const WaypointMotion& motion, const Vector3d& p, const Eigen::Quaterniond& q, double t_s) {
  const double end_s = motion.times_s.back();
  const double t = motion.repeat ? std::fmod(std::max(0.0, t_s), end_s) : std::clamp(t_s, 0.0, end_s);
  const auto next = static_cast<std::size_t>(std::upper_bound(motion.times_s.begin(), motion.times_s.end(), t) -
                                             motion.times_s.begin());
  if (next == motion.times_s.size()) return {motion.positions_m.back(), q};
  const double from_s = next == 0 ? 0.0 : motion.times_s[next - 1];
  const Vector3d from_m = next == 0 ? p : motion.positions_m[next - 1];
  const double s = (t - from_s) / (motion.times_s[next] - from_s);
  return {from_m + (motion.positions_m[next] - from_m) * (s * s * (3.0 - 2.0 * s)), q};
}

PlacedAt place(const SpinMotion& motion, const Vector3d& p, const Eigen::Quaterniond& q, double t_s) {
  const double t = std::max(0.0, t_s - motion.start_s);
  const double angle = t < motion.ramp_s ? motion.rate_rad_s * t * t / (2.0 * motion.ramp_s)
                                         : motion.rate_rad_s * (t - 0.5 * motion.ramp_s);
  return {p, (Eigen::AngleAxisd(std::fmod(angle, 2.0 * std::numbers::pi), motion.axis) * q).normalized()};
}

PlacedAt place(const TargetMotion&, const Vector3d& p, const Eigen::Quaterniond& q, double) { return {p, q}; }

Vector3d shortened(const Vector3d& v, double most) {
  const double norm = v.norm();
  return norm <= most ? v : Vector3d(v * (most / norm));
}

}  // namespace

PlacedAt step_toward(const TargetMotion& motion, const Vector3d& home_m, const PlacedAt& now, const PlacedAt& target,
                     double step_s) {
  const Vector3d wanted_m = home_m + shortened(target.p_WB - home_m, motion.reach_m);
  const Eigen::AngleAxisd turn(now.q_WB.angularDistance(target.q_WB) > 0.0
                                   ? Eigen::Quaterniond(target.q_WB * now.q_WB.conjugate())
                                   : Eigen::Quaterniond::Identity());
  // The short way round.
  const double angle = turn.angle() > std::numbers::pi ? turn.angle() - 2.0 * std::numbers::pi : turn.angle();
  const double most = motion.max_rate_rad_s * step_s;
  return {now.p_WB + shortened(wanted_m - now.p_WB, motion.max_speed_m_s * step_s),
          (Eigen::AngleAxisd(std::clamp(angle, -most, most), turn.axis()) * now.q_WB).normalized()};
}

PlacedAt pose_at(const BodyMotion& motion, const Vector3d& p_WB, const Eigen::Quaterniond& q_WB, double t_s) {
  return std::visit([&](const auto& each) { return place(each, p_WB, q_WB, t_s); }, motion);
}

}  // namespace rtbus::config
