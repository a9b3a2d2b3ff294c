#include "haptic_node/rendering/direct.hpp"

#include <algorithm>
#include <utility>

namespace haptic {

Direct::Direct(double stiffness_n_per_m, double damping_n_s_per_m, const Mapping& mapping,
               std::vector<rtbus::shapes::PlacedShape> shapes)
    : stiffness_n_per_m_(stiffness_n_per_m),
      damping_n_s_per_m_(damping_n_s_per_m),
      mapping_(mapping),
      god_(std::move(shapes)) {}

RenderOutput Direct::render(const RenderInput& input) noexcept {
  const Eigen::Vector3d tip_W = mapping_.position_to_world(input.position_m);
  if (!placed_) {
    god_.place(tip_W);  // the first cycle may find the tip inside a body
    placed_ = true;
  }
  god_.follow(tip_W);

  RenderOutput out;
  out.proxy_position_m = mapping_.position_to_device(god_.position_m());
  const Eigen::Vector3d depth = out.proxy_position_m - input.position_m;
  const double depth_m = depth.norm();
  if (!god_.touching() || depth_m <= 0.0) return out;
  const Eigen::Vector3d normal = depth / depth_m;
  const double force = stiffness_n_per_m_ * depth_m - damping_n_s_per_m_ * normal.dot(input.velocity_m_s);
  out.force_n = std::max(force, 0.0) * normal;
  return out;
}

}  // namespace haptic
