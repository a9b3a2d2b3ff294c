#include "haptic_node/rendering/remote_virtual_coupling.hpp"

#include <algorithm>
#include <cmath>

namespace haptic {

void RemoteVirtualCoupling::follow(const RenderInput& input) noexcept {
  const bool from_here = !placed_;
  if (input.proxy.fresh || !placed_) {
    from_m_ = placed_ ? at_m_ : input.proxy.position_m;
    placed_ = true;
    cycles_per_step_ = std::max(1.0, std::round(input.proxy.period_s / input.dt_s));
    cycle_ = 0.0;
  }
  cycle_ += 1.0;
  const Eigen::Vector3d way_m = input.proxy.position_m - from_m_;
  at_m_ = from_m_ + std::min(1.0, cycle_ / cycles_per_step_) * way_m;
  if (cycles_per_step_ <= 1.0) {
    velocity_m_s_ = input.proxy.velocity_m_s;
  } else if (cycle_ <= cycles_per_step_) {
    velocity_m_s_ = way_m / (cycles_per_step_ * input.dt_s);
  } else {
    velocity_m_s_.setZero();
  }
  lag_behind(from_here, input.dt_s);
}

void RemoteVirtualCoupling::lag_behind(bool from_here, double dt_s) noexcept {
  if (from_here || lag_s_ <= 0.0) {
    lagging_m_ = at_m_;
    return;
  }
  const Eigen::Vector3d way_m = dt_s / (lag_s_ + dt_s) * (at_m_ - lagging_m_);
  lagging_m_ += way_m;
  velocity_m_s_ = way_m / dt_s;
}

RenderOutput RemoteVirtualCoupling::render(const RenderInput& input) noexcept {
  RenderOutput out;
  if (!input.proxy.valid) {
    placed_ = false;
    out.proxy_position_m = input.position_m;
    return out;
  }
  if (paper_) {
    out.proxy_position_m = input.proxy.position_m;
    out.proxy_velocity_m_s = input.proxy.velocity_m_s;
    out.force_n =
        stiffness_n_per_m_ * (out.proxy_position_m - input.position_m) - damping_n_s_per_m_ * input.velocity_m_s;
    return out;
  }
  follow(input);
  out.proxy_position_m = lagging_m_;
  out.proxy_velocity_m_s = velocity_m_s_;
  out.force_n =
      stiffness_n_per_m_ * (lagging_m_ - input.position_m) + damping_n_s_per_m_ * (velocity_m_s_ - input.velocity_m_s);
  return out;
}

}  // namespace haptic
