#include "haptic_node/rendering/remote_virtual_coupling.hpp"

namespace haptic {

RenderOutput RemoteVirtualCoupling::render(const RenderInput& input) noexcept {
  RenderOutput out;
  if (!input.proxy.valid) {
    out.proxy_position_m = input.position_m;
    return out;
  }
  out.proxy_position_m = input.proxy.position_m;
  out.proxy_velocity_m_s = input.proxy.velocity_m_s;
  out.force_n = stiffness_n_per_m_ * (input.proxy.position_m - input.position_m);
  if (paper_) {
    out.force_n -= damping_n_s_per_m_ * input.velocity_m_s;
  } else {
    out.force_n += damping_n_s_per_m_ * (input.proxy.velocity_m_s - input.velocity_m_s);
  }
  return out;
}

}  // namespace haptic
