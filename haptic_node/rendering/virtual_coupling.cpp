#include "haptic_node/rendering/virtual_coupling.hpp"

#include <utility>

namespace haptic {

using Eigen::Vector3d;

VirtualCoupling::VirtualCoupling(double stiffness_n_per_m, double damping_n_s_per_m, double mass_kg, bool paper,
                                 const Mapping& mapping, std::vector<rtbus::shapes::PlacedShape> shapes)
    : stiffness_n_per_m_(stiffness_n_per_m),
      damping_n_s_per_m_(damping_n_s_per_m),
      mass_kg_(mass_kg),
      paper_(paper),
      mapping_(mapping),
      proxy_(std::move(shapes)) {}

void VirtualCoupling::step(const Vector3d& tip_W, const Vector3d& tip_velocity_W, double h) noexcept {
  const double to_world = mapping_.config().gain_to_world();
  const double K = stiffness_n_per_m_ * to_world;
  const double B = damping_n_s_per_m_ * to_world;
  const Vector3d stretch = tip_W - proxy_.position_m();
  Vector3d v_free;
  if (paper_) {
    v_free = velocity_W_ + h / mass_kg_ * (K * stretch - B * velocity_W_);
  } else {
    v_free = (mass_kg_ * velocity_W_ + h * (K * stretch + B * tip_velocity_W)) / (mass_kg_ + h * (B + h * K));
  }
  const Vector3d before = proxy_.position_m();
  proxy_.follow(before + h * v_free);
  velocity_W_ = v_free;
  if (!proxy_.touching()) return;
  // Inelastic bodies only take speed away; a way that bends round an edge may be longer than the free one.
  const Vector3d mean = (proxy_.position_m() - before) / h;
  const double speed = mean.norm();
  const double free_speed = v_free.norm();
  velocity_W_ = speed > free_speed ? Vector3d(mean * (free_speed / speed)) : mean;
}

RenderOutput VirtualCoupling::render(const RenderInput& input) noexcept {
  const Vector3d tip_W = mapping_.position_to_world(input.position_m);
  if (!placed_) {
    proxy_.place(tip_W);
    velocity_W_.setZero();
    placed_ = true;
  }
  step(tip_W, mapping_.velocity_to_world(input.velocity_m_s), input.dt_s);

  RenderOutput out;
  out.proxy_position_m = mapping_.position_to_device(proxy_.position_m());
  out.proxy_velocity_m_s = mapping_.velocity_to_device(velocity_W_);
  const Vector3d damped_m_s =
      paper_ ? Vector3d(-input.velocity_m_s) : Vector3d(out.proxy_velocity_m_s - input.velocity_m_s);
  out.force_n = stiffness_n_per_m_ * (out.proxy_position_m - input.position_m) + damping_n_s_per_m_ * damped_m_s;
  return out;
}

}  // namespace haptic
