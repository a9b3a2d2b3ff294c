#include "haptic_node/rendering/body_pile.hpp"

#include <algorithm>

namespace haptic {

using Eigen::Quaterniond;
using Eigen::Vector3d;

Quaterniond PileBody::take(const ToldBody& told, const SinceAnswer& since, const Known& before,
                           const Vector3d& given_n_s, double hand_m_s, BodyMotion& motion) noexcept {
  const Vector3d centre_m = told.centre_m();
  const double lasting_m_s = std::max(since.tuning.pile_own_speed_m_s, hand_m_s);
  held_ = told.supports > 0;
  if (held_) {
    set_mobility(since.tuning.pile_mobility_s *
                 std::min(told.loosest_per_kg, told.answer.body_inverse_mass_per_kg[told.row]));
  }
  const Flow before_answer = flow_;
  if (before.time_ns != 0 && since.from_ns > before.time_ns) {
    // Among bodies that give way to each other the speed of an instant is noise: the mean since the last answer is not.
    const double apart_s = rtbus::seconds_between(before.time_ns, since.from_ns);
    learn((given_n_s - before.given_n_s) / apart_s, (centre_m - before.centre_m) / apart_s, lasting_m_s);
  }
  motion.centre_m = centre_m + way_m(since.sum.linear_n_s - given_n_s, since.seconds());
  told_ = flow_;
  // Behind a network it is a round trip old as it is. Brought in later still, a stack swung there by 0.054 N.
  if (!since.networked) flow_ = before_answer;
  if (!told.complete) motion.slow_down(lasting_m_s);
  return Quaterniond::Identity();
}

void PileBody::learn(const Vector3d& push_n, const Vector3d& speed_m_s, double lasting_m_s) noexcept {
  flow_ = {push_n, speed_m_s};
  if (const double speed = speed_m_s.norm(); speed > lasting_m_s) flow_.speed_m_s *= lasting_m_s / speed;
}

void PileBody::brake(double slower) noexcept {
  flow_.speed_m_s *= slower;
  told_.speed_m_s *= slower;
  mobility_m_s_n_ *= slower;
}

/// What the proxy rubs against. Along the normal the pile moves as it is known to. Across it, it goes along with the
/// hand, as far as both move the same way, and else stands: were the proxy dragged by what an answer says, the spring
/// to the hand would pull the body back one and a half periods late, and stacks swing under a hand at rest.
Vector3d PileBody::surface_m_s(const Vector3d& hand_m_s, const Vector3d& normal) const noexcept {
  const Vector3d across_m_s = hand_m_s - normal.dot(hand_m_s) * normal;
  const double square = across_m_s.squaredNorm();
  Vector3d out = normal.dot(free_m_s()) * normal;
  if (square > 0.0) out += std::clamp(across_m_s.dot(flow_.speed_m_s) / square, 0.0, 1.0) * across_m_s;
  return out;
}

void PileBody::fill_row(const Vector3d& hand_m_s, double h, SolverContact& row) const noexcept {
  row.surface_velocity_m_s = surface_m_s(hand_m_s, row.normal);
  row.softness_per_kg = mobility_m_s_n_ / h;
  row.advance_m_s = advance_m_s(row.normal);
}

void PileBody::advance(const StepSolution& step, double share, BodyMotion& motion) noexcept {
  const Vector3d way = way_m(step.pushed_n_s, step.h);
  motion.centre_m += way;
  motion.velocity_m_s = way / step.h;
  motion.angular_velocity_rad_s.setZero();
  flow_.push_n += share * (told_.push_n - flow_.push_n);
  flow_.speed_m_s += share * (told_.speed_m_s - flow_.speed_m_s);
}

Vector3d PileBody::way_m(const Vector3d& impulse_n_s, double seconds) const noexcept {
  Vector3d way = mobility_m_s_n_ * impulse_n_s + seconds * free_m_s();
  const double size = flow_.push_n.norm();
  if (size <= 0.0) return way;
  const Vector3d along = flow_.push_n / size;
  const double short_m = std::min(0.0, along.dot(flow_.speed_m_s)) * seconds - along.dot(way);
  if (short_m > 0.0) way += short_m * along;
  return way;
}

}  // namespace haptic
