#include "haptic_node/rendering/interpolation.hpp"

#include <algorithm>
#include <cmath>

namespace haptic {

void Interpolation::reset() noexcept {
  cycles_per_step_ = 1.0;
  cycle_ = 0.0;
  from_n_.setZero();
  to_n_.setZero();
  rendered_n_.setZero();
}

RenderOutput Interpolation::render(const RenderInput& input) noexcept {
  RenderOutput out;
  if (!input.proxy.valid) {
    reset();
    out.proxy_position_m = input.position_m;
    return out;
  }
  if (input.proxy.fresh) {
    from_n_ = paper_ ? to_n_ : rendered_n_;
    to_n_ = input.proxy.server_force_n;
    cycles_per_step_ = std::max(1.0, std::round(input.proxy.period_s / input.dt_s));
    cycle_ = 0.0;
  }
  const double share = std::min(1.0, (paper_ ? cycle_ : cycle_ + 1.0) / cycles_per_step_);
  cycle_ += 1.0;
  rendered_n_ = from_n_ + share * (to_n_ - from_n_);
  out.force_n = rendered_n_;
  out.proxy_position_m = input.proxy.position_m;
  out.proxy_velocity_m_s = input.proxy.velocity_m_s;
  return out;
}

}  // namespace haptic
