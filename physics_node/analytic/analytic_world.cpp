#include "physics_node/analytic/analytic_world.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "physics_node/analytic/contact_sweep.hpp"

namespace physics {
namespace {

using Eigen::Vector3d;

Vector3d clamp_each(const Vector3d& value, double limit) { return value.cwiseMax(-limit).cwiseMin(limit); }

}  // namespace

AnalyticWorld::AnalyticWorld(std::vector<rtbus::shapes::PlacedShape> shapes) : shapes_(std::move(shapes)) {}

std::size_t AnalyticWorld::add_proxy(const ProxyParameters& parameters) {
  const bool finite = std::isfinite(parameters.mass_kg) && std::isfinite(parameters.radius_m) &&
                      std::isfinite(parameters.friction) && parameters.position_m.allFinite();
  if (!finite || parameters.mass_kg <= 0.0 || parameters.radius_m < 0.0 || parameters.friction < 0.0) {
    throw std::invalid_argument("a proxy needs a mass above 0 kg, and a radius and a friction of 0 or more");
  }
  Proxy proxy;
  proxy.parameters = parameters;
  proxy.target.position_m = clamp_each(parameters.position_m, kMaxPositionM);
  proxy.state.position_m = proxy.target.position_m;
  proxies_.push_back(std::move(proxy));
  return proxies_.size() - 1;
}

void AnalyticWorld::reset_proxy(std::size_t index, const Vector3d& position_m) {
  Proxy& proxy = proxies_.at(index);
  if (!position_m.allFinite()) return;
  proxy.released = proxy.placed = false;
  proxy.state = ProxyReadout{};
  proxy.state.position_m = clamp_each(position_m, kMaxPositionM);
  proxy.target.position_m = proxy.state.position_m;
  proxy.target.velocity_m_s.setZero();
  proxy.target.force_n.setZero();
}

void AnalyticWorld::release_proxy(std::size_t index) {
  const Vector3d place = proxies_.at(index).state.position_m;  // a copy: the state is cleared before it is used
  reset_proxy(index, place);
  proxies_[index].released = true;
}

void AnalyticWorld::place_proxy(std::size_t index, const Vector3d& position_m, const Vector3d& velocity_m_s) {
  Proxy& proxy = proxies_.at(index);
  if (proxy.released || !position_m.allFinite() || !velocity_m_s.allFinite()) return;
  proxy.placed = true;
  proxy.state = ProxyReadout{};
  proxy.state.position_m = clamp_each(position_m, kMaxPositionM);
  proxy.state.velocity_m_s = clamp_each(velocity_m_s, kMaxVelocityMS);
}

void AnalyticWorld::set_proxy_target(std::size_t index, const ProxyTarget& target) {
  Proxy& proxy = proxies_.at(index);
  if (!target.position_m.allFinite() || !target.velocity_m_s.allFinite() || !std::isfinite(target.stiffness_n_per_m) ||
      !std::isfinite(target.damping_n_s_per_m) || !target.force_n.allFinite()) {
    return;
  }
  proxy.target.position_m = clamp_each(target.position_m, kMaxPositionM);
  proxy.target.velocity_m_s = clamp_each(target.velocity_m_s, kMaxVelocityMS);
  proxy.target.stiffness_n_per_m = std::clamp(target.stiffness_n_per_m, 0.0, kMaxStiffnessNPerM);
  proxy.target.damping_n_s_per_m = std::clamp(target.damping_n_s_per_m, 0.0, kMaxDampingNSPerM);
  proxy.target.force_n = clamp_each(target.force_n, kMaxForceN);
}

void AnalyticWorld::step(double step_s) {
  if (!std::isfinite(step_s) || step_s <= 0.0) return;
  const double h = std::clamp(step_s, kMinStepS, kMaxStepS);
  for (Proxy& proxy : proxies_) {
    if (!proxy.released && !proxy.placed) step_proxy(proxy, h);
  }
}

ProxyReadout AnalyticWorld::proxy(std::size_t index) const { return proxies_.at(index).state; }

void AnalyticWorld::contacts(std::size_t index, double radius_m, ContactSet& out) const {
  const Proxy& proxy = proxies_.at(index);
  out.radius_m = radius_m;
  out.proxy_radius_m = proxy.parameters.radius_m;
  out.proxy_mass_kg = proxy.parameters.mass_kg;
  FoundContacts found;
  for (std::size_t i = 0; i < shapes_.size() && !proxy.released; ++i) {
    const rtbus::shapes::SurfacePoint nearest = rtbus::shapes::nearest_surface(shapes_[i], proxy.state.position_m);
    const double gap_m = nearest.distance_m - proxy.parameters.radius_m;
    if (gap_m > radius_m) continue;
    Contact contact;
    contact.point_m = nearest.point_m;
    contact.normal = nearest.normal;
    contact.gap_m = gap_m;
    contact.friction = proxy.parameters.friction * shapes_[i].friction;
    if (const auto* ball = std::get_if<rtbus::shapes::Sphere>(&shapes_[i].shape))
      contact.curvature_per_m = 1.0 / ball->radius_m;
    contact.row = static_cast<std::uint32_t>(i);
    found.push_back(contact);
  }
  keep_nearest(found, out);
  for (BodyBehind& body : out.bodies) body.centre_m = shapes_[body.body].p_WB;
}

BodyPose AnalyticWorld::body_pose(std::size_t body) const {
  const rtbus::shapes::PlacedShape& placed = shapes_.at(body);
  return {placed.p_WB, placed.q_WB};
}

void AnalyticWorld::step_proxy(Proxy& proxy, double h) const {
  const double m = proxy.parameters.mass_kg;
  const double K = proxy.target.stiffness_n_per_m;
  const double B = proxy.target.damping_n_s_per_m;
  const Vector3d& x_T = proxy.target.position_m;
  const Vector3d& v_T = proxy.target.velocity_m_s;
  const Vector3d& F = proxy.target.force_n;
  ProxyReadout& state = proxy.state;
  const Vector3d v = state.velocity_m_s;

  // What penetrates is moved out as a displacement: the spring sees it, the velocity does not.
  const Vector3d x = analytic::push_out(shapes_, proxy.parameters.radius_m, state.position_m, kRecoverySpeedMS * h);

  // Where spring and damper alone would bring it, implicitly.
  const double effective_mass_kg = m + h * B + h * h * K;
  const Vector3d v_free = (m * v + h * (K * (x_T - x) + B * v_T + F)) / effective_mass_kg;

  const analytic::Mover mover{proxy.parameters.radius_m, proxy.parameters.friction};
  const analytic::SweepResult swept = analytic::sweep(shapes_, mover, x, x + h * v_free);

  // The mean velocity of the step is its end velocity. A path that bends around an obstacle may be longer than the free
  // one; inelastic bodies only take speed away, so the velocity that is kept is not.
  const Vector3d v_mean = swept.contacts == 0 ? v_free : Vector3d((swept.end_m - x) / h);
  const double speed = v_mean.norm();
  const double free_speed = v_free.norm();
  const Vector3d v_next = speed > free_speed ? Vector3d(v_mean * (free_speed / speed)) : v_mean;

  state.position_m = swept.end_m;
  state.velocity_m_s = v_next;
  state.contacts = swept.contacts;
  state.coupling_force_n = K * (x_T - state.position_m) + B * (v_T - v_mean) + F;
  state.contact_force_n = Vector3d::Zero();
  if (swept.contacts > 0) state.contact_force_n = m * (v_next - v) / h - state.coupling_force_n;
}

std::size_t AnalyticWorld::solved_contacts() const noexcept {
  std::size_t points = 0;
  for (const Proxy& proxy : proxies_) points += proxy.state.contacts;
  return points;
}

}  // namespace physics
