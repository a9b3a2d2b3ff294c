#include "rtbus/shapes/shapes.hpp"

#include <cmath>

namespace rtbus::shapes {
namespace {

SurfacePoint nearest(const Plane&, const Eigen::Vector3d& p) noexcept {
  return {p.y(), Eigen::Vector3d::UnitY(), Eigen::Vector3d(p.x(), 0.0, p.z())};
}

SurfacePoint nearest(const Sphere& sphere, const Eigen::Vector3d& p) noexcept {
  // hypot scales before it squares: near the centre the naive norm would underflow and the normal lose its unit length.
  const double from_centre_m = std::hypot(p.x(), p.y(), p.z());
  constexpr double kCentre_m = 1e-300;  // below it p / |p| runs into subnormal numbers
  const Eigen::Vector3d normal =
      from_centre_m > kCentre_m ? Eigen::Vector3d(p / from_centre_m) : Eigen::Vector3d(Eigen::Vector3d::UnitY());
  return {from_centre_m - sphere.radius_m, normal, normal * sphere.radius_m};
}

SurfacePoint nearest(const Box& box, const Eigen::Vector3d& p) noexcept {
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

}  // namespace

SurfacePoint nearest_surface(const Shape& shape, const Eigen::Vector3d& p) noexcept {
  // get_if instead of visit: visit has a throwing path, which has no place in the loop.
  if (const Sphere* sphere = std::get_if<Sphere>(&shape)) {
    return nearest(*sphere, p);
  }
  if (const Box* box = std::get_if<Box>(&shape)) {
    return nearest(*box, p);
  }
  return nearest(Plane{}, p);
}

SurfacePoint nearest_surface(const PlacedShape& placed, const Eigen::Vector3d& p_W) noexcept {
  const SurfacePoint in_body = nearest_surface(placed.shape, placed.q_WB.conjugate() * (p_W - placed.p_WB));
  return {in_body.distance_m, placed.q_WB * in_body.normal, placed.q_WB * in_body.point_m + placed.p_WB};
}

}  // namespace rtbus::shapes
