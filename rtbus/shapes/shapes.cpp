#include "rtbus/shapes/shapes.hpp"

#include <algorithm>
#include <cmath>

namespace rtbus::shapes {
namespace {

constexpr double kCentre_m = 1e-300;  // below it p / |p| runs into subnormal numbers

SurfacePoint nearest(const Plane&, const Eigen::Vector3d& p) noexcept {
  return {p.y(), Eigen::Vector3d::UnitY(), Eigen::Vector3d(p.x(), 0.0, p.z())};
}

SurfacePoint nearest(const Sphere& sphere, const Eigen::Vector3d& p) noexcept {
  // hypot scales before it squares: near the centre the naive norm would underflow and the normal lose its unit length.
  const double from_centre_m = std::hypot(p.x(), p.y(), p.z());
  const Eigen::Vector3d normal =
      from_centre_m > kCentre_m ? Eigen::Vector3d(p / from_centre_m) : Eigen::Vector3d(Eigen::Vector3d::UnitY());
  return {from_centre_m - sphere.radius_m, normal, normal * sphere.radius_m};
}

}  // namespace

SurfacePoint nearest_surface(const Box& box, const Eigen::Vector3d& p) noexcept {
  // Outside: the nearest point is p clamped to the box, on a face, an edge or a corner.
  const Eigen::Vector3d clamped = p.cwiseMax(-box.half_size_m).cwiseMin(box.half_size_m);
  const Eigen::Vector3d offset = p - clamped;
  const double outside_m = std::hypot(offset.x(), offset.y(), offset.z());
  if (outside_m > 0.0) {
    const Eigen::Vector3d scaled = offset / outside_m;
    return {outside_m, scaled.normalized(), clamped};
  }

  // Inside or on the surface: the face with the smallest depth.
  const Eigen::Vector3d depth = p.cwiseAbs() - box.half_size_m;  // ≤ 0 on each axis
  int axis = 0;
  for (int i = 1; i < 3; ++i) {
    if (depth[i] > depth[axis]) {
      axis = i;
    }
  }
  const double side = p[axis] < 0.0 ? -1.0 : 1.0;
  SurfacePoint out;
  out.distance_m = depth[axis];
  out.normal = Eigen::Vector3d::Zero();
  out.normal[axis] = side;
  out.point_m = p;
  out.point_m[axis] = side * box.half_size_m[axis];
  return out;
}

SurfacePoint nearest_surface(const Capsule& capsule, const Eigen::Vector3d& p) noexcept {
  const double half_m = 0.5 * capsule.length_m - capsule.radius_m;
  const Eigen::Vector3d core(0.0, std::clamp(p.y(), -half_m, half_m), 0.0), way = p - core;
  const double from_core_m = std::hypot(way.x(), way.y(), way.z());
  const Eigen::Vector3d normal =
      from_core_m > kCentre_m ? Eigen::Vector3d(way / from_core_m) : Eigen::Vector3d(Eigen::Vector3d::UnitX());
  return {from_core_m - capsule.radius_m, normal, core + normal * capsule.radius_m};
}

SurfacePoint nearest_surface(const Cylinder& cylinder, const Eigen::Vector3d& p) noexcept {
  const double from_axis_m = std::hypot(p.x(), p.z()), half_m = 0.5 * cylinder.length_m;
  const Eigen::Vector3d outward = from_axis_m > kCentre_m ? Eigen::Vector3d(p.x() / from_axis_m, 0, p.z() / from_axis_m)
                                                          : Eigen::Vector3d(Eigen::Vector3d::UnitX());
  const Eigen::Vector3d up(0.0, p.y() < 0.0 ? -1.0 : 1.0, 0.0);
  const double beside_m = from_axis_m - cylinder.radius_m, beyond_m = std::abs(p.y()) - half_m;
  if (beside_m > 0.0 || beyond_m > 0.0) {
    const double out_m = std::max(beside_m, 0.0), over_m = std::max(beyond_m, 0.0);
    const double distance_m = std::hypot(out_m, over_m);
    const Eigen::Vector3d point_m =
        outward * std::min(from_axis_m, cylinder.radius_m) + up * std::min(std::abs(p.y()), half_m);
    return {distance_m, ((out_m * outward + over_m * up) / distance_m).normalized(), point_m};
  }
  if (beside_m >= beyond_m) return {beside_m, outward, outward * cylinder.radius_m + Eigen::Vector3d(0, p.y(), 0)};
  return {beyond_m, up, Eigen::Vector3d(p.x(), up.y() * half_m, p.z())};
}

SurfacePoint nearest_surface(const Shape& shape, const Eigen::Vector3d& p) noexcept {
  // get_if instead of visit: visit has a throwing path, which has no place in the loop.
  if (const Sphere* sphere = std::get_if<Sphere>(&shape)) {
    return nearest(*sphere, p);
  }
  if (const Box* box = std::get_if<Box>(&shape)) {
    return nearest_surface(*box, p);
  }
  return nearest(Plane{}, p);
}

SurfacePoint nearest_surface(const PlacedShape& placed, const Eigen::Vector3d& p_W) noexcept {
  const SurfacePoint in_body = nearest_surface(placed.shape, placed.q_WB.conjugate() * (p_W - placed.p_WB));
  return {in_body.distance_m, placed.q_WB * in_body.normal, placed.q_WB * in_body.point_m + placed.p_WB};
}

}  // namespace rtbus::shapes
