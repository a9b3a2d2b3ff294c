#include "physics_node/bullet/plane_contacts.hpp"

#include <array>
#include <new>

#include <BulletCollision/CollisionDispatch/btConvexConvexAlgorithm.h>

#include "physics_node/bullet/units.hpp"
#include "rtbus/shapes/face_points.hpp"
#include "rtbus/shapes/hull_points.hpp"

namespace physics::bullet {

using Eigen::Vector3d;
namespace shapes = rtbus::shapes;

btCollisionAlgorithm* PlaneContacts::Factory::CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                                       const btCollisionObjectWrapper* first,
                                                                       const btCollisionObjectWrapper* second) {
  const btCollisionShape& shape = *(m_swapped ? second : first)->getCollisionShape();
  if (shape.getShapeType() == CONVEX_HULL_SHAPE_PROXYTYPE && shape.getUserPointer() == nullptr) {
    return others_->CreateCollisionAlgorithm(info, first, second);
  }
  static_assert(sizeof(PlaneContacts) <= sizeof(btConvexConvexAlgorithm), "Bullet's pool has room for one of its own");
  void* const memory = info.m_dispatcher1->allocateCollisionAlgorithm(sizeof(PlaneContacts));
  return new (memory) PlaneContacts(info, first, second, m_swapped);
}

PlaneContacts::PlaneContacts(const btCollisionAlgorithmConstructionInfo& info, const btCollisionObjectWrapper* first,
                             const btCollisionObjectWrapper* second, bool plane_first)
    : btCollisionAlgorithm(info),
      manifold_(m_dispatcher->getNewManifold((plane_first ? second : first)->getCollisionObject(),
                                             (plane_first ? first : second)->getCollisionObject())),
      bullets_(manifold_, info, first, second, plane_first, 1, 0),
      plane_first_(plane_first) {}

PlaneContacts::~PlaneContacts() { m_dispatcher->releaseManifold(manifold_); }

/// Points of the body, and how far they are above the plane.
struct PlaneContacts::Found {
  static constexpr std::size_t kMost = 2 * shapes::FacePoints::kMost;
  std::array<Vector3d, kMost> point{};
  std::array<double, kMost> gap{};
  std::size_t count = 0;

  void add(const Vector3d& at, double above) {
    point[count] = at;
    gap[count++] = above;
  }
  /// @param along From each to another one.
  void add(const shapes::FacePoints& points, const Vector3d& along = Vector3d::Zero()) {
    for (std::size_t i = 0; i < points.count; ++i) {
      add(points.point_m[i] + along, points.gap_m[i] + points.normal.dot(along));
    }
  }
};

/// Lengths are Bullet's units. @param within Of a hull points that are so little higher than its lowest one.
void PlaneContacts::find(const btCollisionShape& shape, const btTransform& pose, const btTransform& plane,
                         double within, Found& out) {
  const shapes::PlacedShape below{shapes::Plane{}, from_bullet(plane.getRotation()), from_bullet(plane.getOrigin())};
  const Eigen::Quaterniond q_WB = from_bullet(pose.getRotation());
  const Vector3d centre = from_bullet(pose.getOrigin()), axis = q_WB * Vector3d(Vector3d::UnitY());
  const Vector3d up = below.q_WB * Vector3d(Vector3d::UnitY());
  shapes::FacePoints points;
  switch (shape.getShapeType()) {
    case BOX_SHAPE_PROXYTYPE: {
      const Vector3d half = from_bullet(static_cast<const btBoxShape&>(shape).getHalfExtentsWithMargin());
      (void)shapes::face_points(shapes::Box{half}, q_WB, centre, below, points);
      return out.add(points);
    }
    case CONVEX_HULL_SHAPE_PROXYTYPE: {
      const auto skin = static_cast<double>(static_cast<const btConvexHullShape&>(shape).getMargin());
      const auto& hull = *static_cast<const shapes::Hull*>(shape.getUserPointer());
      shapes::hull_points(hull, q_WB, centre - skin * up, below, points, within);
      return out.add(points);
    }
    case CYLINDER_SHAPE_PROXYTYPE: {
      const Vector3d half = from_bullet(static_cast<const btCylinderShape&>(shape).getHalfExtentsWithMargin());
      const Vector3d ahead = q_WB * Vector3d(Vector3d::UnitX());
      (void)shapes::face_points(shapes::Cylinder{half.x(), 2.0 * half.y()}, q_WB, centre, below, ahead, points);
      out.add(points);
      return out.add(points, (axis.dot(up) > 0.0 ? 2.0 : -2.0) * half.y() * axis);
    }
    default: {
      const auto& capsule = static_cast<const btCapsuleShape&>(shape);
      const Vector3d half = static_cast<double>(capsule.getHalfHeight()) * axis;
      for (const Vector3d& end : {Vector3d(centre + half), Vector3d(centre - half)}) {
        const Vector3d lowest = end - static_cast<double>(capsule.getRadius()) * up;
        out.add(lowest, up.dot(lowest - below.p_WB));
      }
    }
  }
}

void PlaneContacts::processCollision(const btCollisionObjectWrapper* first, const btCollisionObjectWrapper* second,
                                     const btDispatcherInfo& info, btManifoldResult* out) {
  const btCollisionObjectWrapper& held = plane_first_ ? *second : *first;
  const btTransform& plane = (plane_first_ ? *first : *second).getWorldTransform();
  if (held.getCollisionObject()->getUserIndex2() != kAlone) {
    bullets_.processCollision(first, second, info, out);
    out->refreshContactPoints();
    return;
  }
  const auto within = static_cast<double>(manifold_->getContactBreakingThreshold());
  Found found;
  find(*held.getCollisionShape(), held.getWorldTransform(), plane, within, found);

  // Each goes on from the impulses of the nearest one before.
  std::array<btManifoldPoint, MANIFOLD_CACHE_SIZE> before;
  const int known = manifold_->getNumContacts();
  for (int i = 0; i < known; ++i) before[static_cast<std::size_t>(i)] = manifold_->getContactPoint(i);
  manifold_->clearManifold();
  out->setPersistentManifold(manifold_);
  const btVector3 up = plane.getBasis().getColumn(1);
  for (std::size_t i = 0; i < found.count && manifold_->getNumContacts() < MANIFOLD_CACHE_SIZE; ++i) {
    if (found.gap[i] >= within) continue;
    const auto gap = static_cast<btScalar>(found.gap[i]);
    out->addContactPoint(up, to_bullet(found.point[i]) - gap * up, gap);
  }
  for (int i = 0; i < manifold_->getNumContacts(); ++i) {
    btManifoldPoint& point = manifold_->getContactPoint(i);
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

}  // namespace physics::bullet
