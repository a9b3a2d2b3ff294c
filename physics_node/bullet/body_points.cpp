#include "physics_node/bullet/body_points.hpp"

#include <limits>

#include "physics_node/bullet/units.hpp"
#include "rtbus/shapes/hull_points.hpp"

namespace physics::bullet {

using Eigen::Vector3d;
namespace shapes = rtbus::shapes;

bool BodyPoints::knows(const btCollisionObjectWrapper& held) {
  const btCollisionShape& shape = *held.getCollisionShape();
  return shape.getShapeType() != CONVEX_HULL_SHAPE_PROXYTYPE || shape.getUserPointer() != nullptr;
}

void BodyPoints::add(const Vector3d& point, const Vector3d& normal, double gap) {
  if (gap < within_) points_[count_++] = {point, normal, gap};
}

void BodyPoints::add(const shapes::FacePoints& points, const Vector3d& along) {
  for (std::size_t i = 0; i < points.count; ++i) {
    add(points.point_m[i] + along, points.normal, points.gap_m[i] + points.normal.dot(along));
  }
}

void tell(std::span<const TouchPoint> points, btPersistentManifold& manifold, btManifoldResult& out) {
  std::array<btManifoldPoint, MANIFOLD_CACHE_SIZE> before;
  const int known = manifold.getNumContacts();
  for (int i = 0; i < known; ++i) before[static_cast<std::size_t>(i)] = manifold.getContactPoint(i);
  manifold.clearManifold();
  for (const TouchPoint& each : points) {
    if (manifold.getNumContacts() == MANIFOLD_CACHE_SIZE) break;
    const Vector3d below = each.point - each.gap * each.normal;
    out.addContactPoint(to_bullet(each.normal), to_bullet(below), static_cast<btScalar>(each.gap));
  }
  for (int i = 0; i < manifold.getNumContacts(); ++i) {
    btManifoldPoint& point = manifold.getContactPoint(i);
    const btManifoldPoint* nearest = nullptr;
    for (int k = 0; k < known; ++k) {
      const btManifoldPoint& each = before[static_cast<std::size_t>(k)];
      if (nearest == nullptr ||
          each.m_localPointA.distance2(point.m_localPointA) < nearest->m_localPointA.distance2(point.m_localPointA)) {
        nearest = &each;
      }
    }
    if (nearest == nullptr) continue;
    point.m_appliedImpulse = nearest->m_appliedImpulse;
    point.m_appliedImpulseLateral1 = nearest->m_appliedImpulseLateral1;
    point.m_appliedImpulseLateral2 = nearest->m_appliedImpulseLateral2;
    point.m_lateralFrictionDir1 = nearest->m_lateralFrictionDir1;
    point.m_lateralFrictionDir2 = nearest->m_lateralFrictionDir2;
    point.m_lifeTime = nearest->m_lifeTime;
  }
}

void BodyPoints::find(const btCollisionObjectWrapper& held, const shapes::Face& face) {
  const btCollisionShape& shape = *held.getCollisionShape();
  const Eigen::Quaterniond q_WB = from_bullet(held.getWorldTransform().getRotation());
  const Vector3d centre = from_bullet(held.getWorldTransform().getOrigin());
  const Vector3d axis = q_WB * Vector3d(Vector3d::UnitY());
  shapes::Face endless = face;
  endless.half_u_m = endless.half_v_m = std::numeric_limits<double>::infinity();
  shapes::FacePoints points;
  const Vector3d& normal = face.normal;
  switch (shape.getShapeType()) {
    case BOX_SHAPE_PROXYTYPE: {
      const Vector3d half = from_bullet(static_cast<const btBoxShape&>(shape).getHalfExtentsWithMargin());
      shapes::face_points(shapes::Box{half}, q_WB, centre, endless, points);
      return add(points);
    }
    case CONVEX_HULL_SHAPE_PROXYTYPE: {
      const auto skin = static_cast<double>(static_cast<const btConvexHullShape&>(shape).getMargin());
      const auto& hull = *static_cast<const shapes::Hull*>(shape.getUserPointer());
      shapes::hull_points(hull, q_WB, centre - skin * normal, endless, points, within_);
      return add(points);
    }
    case CYLINDER_SHAPE_PROXYTYPE: {
      const Vector3d half = from_bullet(static_cast<const btCylinderShape&>(shape).getHalfExtentsWithMargin());
      const Vector3d ahead = q_WB * Vector3d(Vector3d::UnitX());
      shapes::face_points(shapes::Cylinder{half.x(), 2.0 * half.y()}, q_WB, centre, endless, ahead, points);
      add(points);
      return add(points, (axis.dot(normal) > 0.0 ? 2.0 : -2.0) * half.y() * axis);
    }
    default: {
      const auto& capsule = static_cast<const btCapsuleShape&>(shape);
      const Vector3d half = static_cast<double>(capsule.getHalfHeight()) * axis;
      for (const Vector3d& end : {Vector3d(centre + half), Vector3d(centre - half)}) {
        const Vector3d lowest = end - static_cast<double>(capsule.getRadius()) * normal;
        add(lowest, normal, normal.dot(lowest - face.centre_m));
      }
    }
  }
}

}  // namespace physics::bullet
