#include "physics_node/bullet/body_points.hpp"

#include <algorithm>

#include "physics_node/bullet/units.hpp"
#include "rtbus/shapes/hull_points.hpp"

namespace physics::bullet {

using Eigen::Vector3d;
namespace shapes = rtbus::shapes;

namespace {

constexpr int kInPile = -1, kAlone = 1, kBullets = 2;  // -1 is what Bullet begins with

}  // namespace

bool is_met_at_all_points(const btCollisionObjectWrapper& body) {
  return body.getCollisionObject()->getUserIndex2() == kAlone;
}

void set_in_pile(btCollisionObject& body, bool in_pile) {
  if (body.getUserIndex2() != kBullets) body.setUserIndex2(in_pile ? kInPile : kAlone);
}

void leave_to_bullet(btCollisionObject& body) { body.setUserIndex2(kBullets); }

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

void replace_points(std::span<const TouchPoint> points, btPersistentManifold& manifold, btManifoldResult& out) {
  const auto one = static_cast<double>(manifold.getContactBreakingThreshold());
  std::array<const TouchPoint*, 2 * shapes::FacePoints::kMost> kept{};
  std::size_t count = 0;
  for (std::size_t i = 0; i < std::min(points.size(), kept.size()); ++i) {
    const auto is_lower = [&](std::size_t k) {
      return k != i && (points[k].point - points[i].point).norm() < one &&
             (points[k].gap < points[i].gap || (points[k].gap == points[i].gap && k < i));
    };
    bool lowest = true;
    for (std::size_t k = 0; k < points.size(); ++k) lowest = lowest && !is_lower(k);
    if (lowest) kept[count++] = &points[i];
  }
  while (count > MANIFOLD_CACHE_SIZE) {
    const auto end = kept.begin() + static_cast<std::ptrdiff_t>(count--);
    const auto highest =
        std::max_element(kept.begin(), end, [](const TouchPoint* a, const TouchPoint* b) { return a->gap < b->gap; });
    std::copy(highest + 1, end, highest);
  }
  std::array<btManifoldPoint, MANIFOLD_CACHE_SIZE> before;
  const int known = manifold.getNumContacts();
  for (int i = 0; i < known; ++i) before[static_cast<std::size_t>(i)] = manifold.getContactPoint(i);
  manifold.clearManifold();
  for (std::size_t i = 0; i < count; ++i) {
    const TouchPoint& each = *kept[i];
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
  const Vector3d& normal = face.normal;
  shapes::FacePoints points;
  count_ = 0;
  switch (shape.getShapeType()) {
    case BOX_SHAPE_PROXYTYPE: {
      const Vector3d half = from_bullet(static_cast<const btBoxShape&>(shape).getHalfExtentsWithMargin());
      shapes::face_points(shapes::Box{half}, q_WB, centre, face, points);
      return add(points);
    }
    case CONVEX_HULL_SHAPE_PROXYTYPE: {
      const auto skin = static_cast<double>(static_cast<const btConvexHullShape&>(shape).getMargin());
      const auto& hull = *static_cast<const shapes::Hull*>(shape.getUserPointer());
      shapes::hull_points(hull, q_WB, centre - skin * normal, face, points, within_);
      return add(points);
    }
    case CYLINDER_SHAPE_PROXYTYPE: {
      const Vector3d half = from_bullet(static_cast<const btCylinderShape&>(shape).getHalfExtentsWithMargin());
      const Vector3d ahead = q_WB * Vector3d(Vector3d::UnitX());
      shapes::face_points(shapes::Cylinder{half.x(), 2.0 * half.y()}, q_WB, centre, face, ahead, points);
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
