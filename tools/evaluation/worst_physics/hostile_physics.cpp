#include "tools/evaluation/worst_physics/hostile_physics.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>

#include "rtbus/eigen.hpp"

namespace tools {

namespace {

using Eigen::Vector3d;
using rtbus::array_of;
using rtbus::vector_of;

// The limits of rtbus/sane_sample.cpp.
constexpr double kPosition_m = 1e6, kVelocity_m_s = 1e6, kForce_n = 1e9;
/// Slower than this a motion has no direction to push along.
constexpr double kMoves_m_s = 0.02;
constexpr double kSteepMass = 1e9;

std::uint64_t after(std::uint64_t now_ns, double seconds) { return now_ns + static_cast<std::uint64_t>(seconds * 1e9); }

}  // namespace

HostilePhysics::HostilePhysics(const HostilePlan& plan, double stiffness_n_per_m, std::uint64_t seed,
                               std::uint64_t until_ns)
    : plan_(plan), stiffness_n_per_m_(stiffness_n_per_m), until_ns_(until_ns), random_(seed), axis_(direction()) {}

Vector3d HostilePhysics::direction() {
  Vector3d out;
  do {
    out = {random_.between(-1.0, 1.0), random_.between(-1.0, 1.0), random_.between(-1.0, 1.0)};
  } while (out.norm() < 0.1 || out.norm() > 1.0);
  return out.normalized();
}

/// Of any magnitude up to the limit.
double HostilePhysics::wild(double limit) {
  return (random_.chance(0.5) ? 1.0 : -1.0) * random_.log_between(1e-6, limit) * (1.0 - 1e-9);
}

Vector3d HostilePhysics::wanted_force_n(const Vector3d& velocity_m_s, double t_s) {
  const double speed = velocity_m_s.norm();
  switch (plan_.push) {
    case HostilePlan::Push::kAlong:
      if (speed > plan_.speed_m_s) return Vector3d::Zero();
      return plan_.force_n * (speed > kMoves_m_s ? Vector3d(velocity_m_s / speed) : axis_);
    case HostilePlan::Push::kFaster:
      if (speed > plan_.speed_m_s) return Vector3d::Zero();
      return plan_.force_n * (speed > kMoves_m_s ? Vector3d(velocity_m_s / plan_.speed_m_s) : axis_);
    case HostilePlan::Push::kResonant:
      if (speed > plan_.speed_m_s) return Vector3d::Zero();
      return plan_.force_n * std::sin(2.0 * std::numbers::pi * plan_.frequency_hz * t_s) * axis_;
    case HostilePlan::Push::kWalk:
      walk_m_ += 0.1 * plan_.force_n / stiffness_n_per_m_ * direction();
      return stiffness_n_per_m_ * walk_m_;
    case HostilePlan::Push::kJump:
    case HostilePlan::Push::kSteady:
      return plan_.force_n * axis_;
  }
  return Vector3d::Zero();
}

void HostilePhysics::answer(Harness::Answer& answer) {
  rtbus::ProxyState& proxy = answer.proxy.value;
  const std::uint64_t now_ns = answer.proxy.stamp_ns;
  if (proxy.mapping_epoch != epoch_) {
    epoch_ = proxy.mapping_epoch;
    work_j_ = true_work_j_ = 0.0;
  }
  if (now_ns >= until_ns_) {
    // What it claimed cannot be taken back: from here on the sum goes on as the true one does.
    proxy.coupling_work_j += work_j_ - true_work_j_;
    return;
  }
  ++lies_;
  true_work_j_ = proxy.coupling_work_j;
  if (plan_.silent_every_s > 0.0) {
    if (next_silence_ns_ == 0) next_silence_ns_ = after(now_ns, plan_.silent_every_s);
    answer.silent = now_ns >= next_silence_ns_;
    if (now_ns >= after(next_silence_ns_, plan_.silent_s)) next_silence_ns_ = after(now_ns, plan_.silent_every_s);
    if (answer.silent) return;
  }
  if (now_ns >= next_change_ns_) {
    next_change_ns_ = after(now_ns, plan_.change_s);
    if (plan_.push != HostilePlan::Push::kSteady) axis_ = direction();
    if (plan_.push == HostilePlan::Push::kWalk) walk_m_.setZero();
  }
  const Vector3d force_n = wanted_force_n(vector_of(answer.device.velocity_m_s), 1e-9 * static_cast<double>(now_ns));
  lie_about_proxy(answer, force_n);
  if (answer.contacts == nullptr) return;
  rtbus::ProxyContacts& contacts = answer.contacts->value;
  contacts.device_time_ns = proxy.device_time_ns;
  contacts.step_s = proxy.step_s;
  lie_about_contacts(answer.device, force_n, contacts);
}

void HostilePhysics::lie_about_proxy(Harness::Answer& answer, const Vector3d& force_n) {
  rtbus::ProxyState& proxy = answer.proxy.value;
  const Vector3d tip_m = vector_of(answer.device.position_m);
  proxy.position_m = array_of(Vector3d(tip_m + force_n / stiffness_n_per_m_));
  proxy.velocity_m_s = answer.device.velocity_m_s;
  proxy.hand_force_n = array_of(force_n);
  const bool touches = !random_.chance(plan_.free_share);
  proxy.contact_force_n = touches ? array_of(force_n) : rtbus::Vec3{};
  work_j_ += plan_.lie_alternates && (lies_ % 2) != 0 ? -plan_.lie_j : plan_.lie_j;
  proxy.coupling_work_j = work_j_;
  proxy.step_s = plan_.step_s;
  proxy.device_time_ns -= std::min(proxy.device_time_ns, static_cast<std::uint64_t>(plan_.age_s * 1e9));
  if (random_.chance(plan_.wild_share)) {
    for (double& x : proxy.position_m) x = wild(random_.chance(0.5) ? kPosition_m : 0.1);
    for (double& v : proxy.velocity_m_s) v = wild(kVelocity_m_s);
    for (double& f : proxy.hand_force_n) f = wild(kForce_n);
    proxy.step_s = std::abs(wild(3600.0));
  }
  if (random_.chance(plan_.insane_share)) proxy.position_m[1] = std::numeric_limits<double>::quiet_NaN();
}

void HostilePhysics::lie_about_contacts(const rtbus::DeviceState& hand, const Vector3d& force_n,
                                        rtbus::ProxyContacts& out) {
  const Vector3d tip_m = vector_of(hand.position_m), proxy_m = vector_of(hand.target_position_m);
  const double norm_n = force_n.norm();
  const Vector3d normal = norm_n > 0.0 ? Vector3d(force_n / norm_n) : axis_;
  // A surface that is where the loop's own proxy is, and goes to where it would pull with the wanted force.
  const Vector3d goal_m = tip_m + force_n / stiffness_n_per_m_;
  Vector3d surface_m_s = vector_of(hand.velocity_m_s) + (goal_m - proxy_m) / plan_.plate_s;
  if (random_.chance(plan_.wild_share)) surface_m_s = wild(0.5 * kVelocity_m_s) * direction();
  if (random_.chance(plan_.rename_share)) ++names_;
  out.proxy_position_m = hand.target_position_m;
  out.proxy_velocity_m_s = hand.target_velocity_m_s;
  out.radius_m = 0.01;
  out.contacts = static_cast<std::uint32_t>(norm_n > 0.0 ? plan_.contacts : 0);
  out.bodies = out.contacts;
  out.supports = out.bodies > 0 ? static_cast<std::uint32_t>(plan_.supports) : 0;
  for (std::size_t row = 0; row < out.contacts; ++row) {
    fill_contact(row, proxy_m, row == 0 ? normal : Vector3d((normal + 0.5 * direction()).normalized()), surface_m_s,
                 out);
  }
  fill_bodies(surface_m_s, out);
  fill_supports(out);
  if (plan_.compliance_m_per_n > 0.0 && plan_.kinematic_share < 1.0) fill_yields(proxy_m, normal, out);
}

void HostilePhysics::fill_contact(std::size_t row, const Vector3d& proxy_m, const Vector3d& normal,
                                  const Vector3d& surface_m_s, rtbus::ProxyContacts& out) {
  const bool flips = random_.chance(plan_.flip_share);
  const double gap_m = plan_.jump_m * random_.between(-1.0, 1.0);
  const Vector3d n = flips ? Vector3d(-normal) : normal;
  out.contact_body[row] = static_cast<std::uint32_t>(row);
  out.contact_normal[row] = array_of(n);
  out.contact_gap_m[row] = gap_m;
  out.contact_point_m[row] = array_of(Vector3d(proxy_m - (out.proxy_radius_m + gap_m) * n));
  out.contact_velocity_m_s[row] = array_of(surface_m_s);
  out.contact_friction[row] = plan_.friction;
  out.contact_curvature_per_m[row] = random_.chance(plan_.wild_share) ? std::abs(wild(1e6)) : 0.0;
}

void HostilePhysics::fill_bodies(const Vector3d& surface_m_s, rtbus::ProxyContacts& out) {
  constexpr std::uint32_t kKinematic = 1;
  for (std::size_t row = 0; row < out.bodies; ++row) {
    // A body is what it is for as long as it has its name: soft ones come last, as the engines list them.
    Random nature(std::uint64_t{names_} * 64 + row + 1);
    const bool moves_itself = nature.chance(plan_.kinematic_share);
    const std::uint32_t other = 2 * static_cast<std::uint32_t>(nature.below(2));  // static or dynamic
    out.body_kind[row] = moves_itself ? kKinematic : other;
    const bool dynamic = out.body_kind[row] == 2;
    const double inverse = dynamic ? plan_.inverse_mass_per_kg : 0.0;
    out.body_index[row] = (names_ * 16 + static_cast<std::uint32_t>(row)) % 1000;
    out.body_centre_m[row] = out.contact_point_m[row];
    out.body_velocity_m_s[row] = other == 0 && !moves_itself ? rtbus::Vec3{} : array_of(surface_m_s);
    out.body_angular_velocity_rad_s[row] = {};
    out.body_inverse_mass_per_kg[row] = inverse;
    out.body_inverse_inertia_per_kg_m2[row] = {inverse, 0.0, 0.0, inverse, 0.0, inverse};
    out.contact_inverse_mass_per_kg[row] = {inverse, 0.0, 0.0, inverse, 0.0, inverse};
    const double push_n = dynamic ? plan_.force_n : 0.0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      out.body_external_force_n[row][axis] = push_n * out.contact_normal[row][axis];
    }
    out.body_external_torque_n_m[row] = out.body_friction_force_n[row] = out.body_friction_torque_n_m[row] = {};
    out.body_proxy_force_n[row] = {};
    out.body_friction_bound_n[row] = dynamic ? plan_.friction * push_n : 0.0;
    if (random_.chance(plan_.wild_share)) out.body_external_force_n[row] = {wild(kForce_n), wild(kForce_n), wild(1.0)};
  }
}

/// What yields pushes where it is wanted to, and has moved when it is looked at again.
void HostilePhysics::fill_yields(const Vector3d& proxy_m, const Vector3d& normal, rtbus::ProxyContacts& out) {
  out.yields = 1 + static_cast<std::uint32_t>(random_.below(static_cast<int>(rtbus::kYieldSlots)));
  out.yield_stiffness_n_per_m = 1.0 / plan_.compliance_m_per_n;
  out.yield_stiffness_across_n_per_m = random_.chance(0.5) ? 0.0 : out.yield_stiffness_n_per_m;
  out.yield_friction = plan_.friction;
  out.yield_rest = 1.0 - plan_.flip_share;  // no draw of its own: seeds keep their plans
  for (std::size_t row = 0; row < out.yields; ++row) {
    const Vector3d n = random_.chance(plan_.flip_share) ? Vector3d(-normal) : normal;
    out.yield_after_s[row] = static_cast<double>(row) * plan_.step_s;
    out.yield_tool_m[row] = array_of(Vector3d(proxy_m + plan_.jump_m * random_.between(-1.0, 1.0) * n));
    out.yield_reaction_n[row] = array_of(Vector3d(plan_.force_n * n));
    out.yield_normal[row] = array_of(n);
    out.yield_gap_m[row] = 0.0;
    if (random_.chance(plan_.wild_share)) out.yield_reaction_n[row] = {wild(kForce_n), wild(1.0), wild(kForce_n)};
  }
}

void HostilePhysics::fill_supports(rtbus::ProxyContacts& out) {
  for (std::size_t row = 0; row < out.supports; ++row) {
    const std::size_t body = row % out.bodies;
    out.support_body[row] = static_cast<std::uint32_t>(body);
    out.support_point_m[row] = out.body_centre_m[body];
    out.support_normal[row] = array_of(direction());
    out.support_force_n[row] = random_.log_between(1e-3, 1e3);
    out.support_friction[row] = plan_.friction;
    out.support_velocity_m_s[row] = out.body_velocity_m_s[body];
    out.support_inverse_mass_per_kg[row] = random_.chance(0.5) ? 0.0 : random_.log_between(1e-9, kSteepMass);
    out.support_points[row] = static_cast<std::uint32_t>(1 + random_.below(4));
  }
}

}  // namespace tools
