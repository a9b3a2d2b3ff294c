#include "physics_node/bullet/nearest.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <BulletCollision/NarrowPhaseCollision/btGjkEpaPenetrationDepthSolver.h>
#include <BulletCollision/NarrowPhaseCollision/btGjkPairDetector.h>
#include <BulletCollision/NarrowPhaseCollision/btPointCollector.h>

namespace physics::bullet {
namespace {

using Eigen::Vector3d;

/// Around a core: distance to its nearest point, less the margin.
NearPoint around(const Vector3d& p, const Vector3d& core, double margin, const Vector3d& if_inside) {
  const Vector3d offset = p - core;
  const double distance = offset.norm();
  const Vector3d normal = distance > 1e-12 ? Vector3d(offset / distance) : if_inside;
  return {core + normal * margin, normal, distance - margin};
}

NearPoint nearest_box(const btBoxShape& box, const Vector3d& p) {
  const Vector3d half = from_bullet(box.getHalfExtentsWithMargin());
  const Vector3d core = half - Vector3d::Constant(static_cast<double>(box.getMargin()));
  const Vector3d clamped = p.cwiseMax(-core).cwiseMin(core);
  if (clamped != p) return around(p, clamped, static_cast<double>(box.getMargin()), Vector3d::UnitY());
  const rtbus::shapes::SurfacePoint face =
      rtbus::shapes::nearest_surface(rtbus::shapes::Shape{rtbus::shapes::Box{half}}, p);
  return {face.point_m, face.normal, face.distance_m};
}

/// The axis is y. In the half-plane of the point a cylinder is a rectangle.
NearPoint nearest_cylinder(const btCylinderShape& cylinder, const Vector3d& p) {
  const Vector3d half = from_bullet(cylinder.getHalfExtentsWithMargin());
  const auto margin = static_cast<double>(cylinder.getMargin());
  const double from_axis = std::hypot(p.x(), p.z());
  const Vector3d outward = from_axis > 1e-12 ? Vector3d(p.x() / from_axis, 0, p.z() / from_axis) : Vector3d::UnitX();
  const double core_radius = half.x() - margin;
  const double core_height = half.y() - margin;
  if (from_axis > core_radius || std::abs(p.y()) > core_height) {
    const Vector3d core =
        outward * std::min(from_axis, core_radius) + Vector3d::UnitY() * std::clamp(p.y(), -core_height, core_height);
    return around(p, core, margin, outward);
  }
  const double to_side = half.x() - from_axis;
  const double to_cap = half.y() - std::abs(p.y());
  if (to_side < to_cap) return {outward * half.x() + Vector3d::UnitY() * p.y(), outward, -to_side};
  const Vector3d up(0, p.y() < 0.0 ? -1.0 : 1.0, 0);
  return {Vector3d(p.x(), up.y() * half.y(), p.z()), up, -to_cap};
}

/// Of a mesh, whose frame `p` is in: the same places that the loop finds by itself.
void nearest_surface(const rtbus::shapes::Surface& surface, const Vector3d& p, double reach,
                     std::vector<NearPoint>& out) {
  std::array<rtbus::shapes::Surface::Minimum, rtbus::shapes::Surface::kMostMinima> found;
  const std::size_t count = surface.minima(p, reach, found);
  for (std::size_t i = 0; i < count; ++i) out.push_back(around(p, found[i].point_m, 0.0, Vector3d::UnitY()));
}

void nearest_hull(const btConvexShape& hull, const btTransform& pose, const Vector3d& centre, double radius,
                  double max_gap, std::vector<NearPoint>& out) {
  btSphereShape sphere(static_cast<btScalar>(radius));
  btVoronoiSimplexSolver simplex;
  btGjkEpaPenetrationDepthSolver depth;
  btGjkPairDetector detector(&sphere, &hull, &simplex, &depth);
  btGjkPairDetector::ClosestPointInput input;
  input.m_transformA = btTransform(btQuaternion::getIdentity(), to_bullet(centre));
  input.m_transformB = pose;
  btPointCollector nearest;
  detector.getClosestPoints(input, nearest, nullptr);
  if (!nearest.m_hasResult || static_cast<double>(nearest.m_distance) > max_gap) return;
  out.push_back({from_bullet(nearest.m_pointInWorld), from_bullet(nearest.m_normalOnBInWorld).normalized(),
                 static_cast<double>(nearest.m_distance)});
}

}  // namespace

void nearest_points(const MadeShape& made, const btTransform& pose, const Vector3d& centre, double radius,
                    double max_gap, std::vector<NearPoint>& out) {
  const btCollisionShape& shape = *made.shape;
  if (shape.getShapeType() == CONVEX_HULL_SHAPE_PROXYTYPE) {
    nearest_hull(static_cast<const btConvexShape&>(shape), pose, centre, radius, max_gap, out);
    return;
  }
  const Eigen::Quaterniond q_WB = from_bullet(pose.getRotation());
  const Vector3d p_WB = from_bullet(pose.getOrigin());
  const Vector3d p = q_WB.conjugate() * (centre - p_WB);
  std::vector<NearPoint> in_body;
  switch (shape.getShapeType()) {
    case STATIC_PLANE_PROXYTYPE:
      in_body.push_back({Vector3d(p.x(), 0, p.z()), Vector3d::UnitY(), p.y()});
      break;
    case SPHERE_SHAPE_PROXYTYPE: {
      const auto ball = static_cast<double>(static_cast<const btSphereShape&>(shape).getRadius());
      in_body.push_back(around(p, Vector3d::Zero(), ball, Vector3d::UnitY()));
      break;
    }
    case BOX_SHAPE_PROXYTYPE:
      in_body.push_back(nearest_box(static_cast<const btBoxShape&>(shape), p));
      break;
    case CAPSULE_SHAPE_PROXYTYPE: {
      const auto& capsule = static_cast<const btCapsuleShape&>(shape);
      const auto half = static_cast<double>(capsule.getHalfHeight());
      in_body.push_back(around(p, Vector3d(0, std::clamp(p.y(), -half, half), 0),
                               static_cast<double>(capsule.getRadius()), Vector3d::UnitX()));
      break;
    }
    case CYLINDER_SHAPE_PROXYTYPE:
      in_body.push_back(nearest_cylinder(static_cast<const btCylinderShape&>(shape), p));
      break;
    case TRIANGLE_MESH_SHAPE_PROXYTYPE:
      nearest_surface(*made.surface, p, radius + max_gap, in_body);
      break;
    default:
      break;  // make_shape() makes no other
  }
  for (const NearPoint& each : in_body) {
    const double gap = each.gap - radius;
    if (gap <= max_gap) out.push_back({q_WB * each.point + p_WB, q_WB * each.normal, gap});
  }
}

}  // namespace physics::bullet
