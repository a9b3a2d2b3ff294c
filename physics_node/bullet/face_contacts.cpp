#include "physics_node/bullet/face_contacts.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <new>

#include <BulletCollision/CollisionDispatch/btBoxBoxCollisionAlgorithm.h>
#include <BulletCollision/CollisionDispatch/btConvexConvexAlgorithm.h>
#include <BulletCollision/CollisionDispatch/btConvexPlaneCollisionAlgorithm.h>

#include "physics_node/bullet/units.hpp"
#include "rtbus/shapes/face_points.hpp"
#include "rtbus/shapes/hull_points.hpp"

namespace physics::bullet {

using Eigen::Vector3d;
namespace shapes = rtbus::shapes;

namespace {

constexpr std::array kShapes{BOX_SHAPE_PROXYTYPE, CONVEX_HULL_SHAPE_PROXYTYPE, CYLINDER_SHAPE_PROXYTYPE,
                             CAPSULE_SHAPE_PROXYTYPE};
/// A cylinder that leans by more (a sine) has not its rim alone at the edge of a box.
constexpr double kStands = 0.01;

shapes::PlacedShape placed(const btCollisionObjectWrapper& holder) {
  const btTransform& pose = holder.getWorldTransform();
  shapes::PlacedShape out{shapes::Plane{}, from_bullet(pose.getRotation()), from_bullet(pose.getOrigin())};
  const btCollisionShape& shape = *holder.getCollisionShape();
  if (shape.getShapeType() == BOX_SHAPE_PROXYTYPE) {
    out.shape = shapes::Box{from_bullet(static_cast<const btBoxShape&>(shape).getHalfExtentsWithMargin())};
  }
  return out;
}

bool is_box(const btCollisionObjectWrapper& body) {
  return body.getCollisionShape()->getShapeType() == BOX_SHAPE_PROXYTYPE;
}

/// Whether the area is thinner than that: at the end of one table and the beginning of the next one, as high, a box is
/// on the upper side of that as much as before its front.
bool is_sliver(const shapes::FacePoints& area, double thin) {
  if (area.count < 3) return false;
  const Vector3d from = area.point_m[2] - area.point_m[0];
  const Vector3d across = area.point_m[area.count - 1] - area.point_m[1];
  const double longest = std::max(from.norm(), across.norm());
  return 0.5 * from.cross(across).norm() < thin * longest;
}

bool stands(const btCollisionObjectWrapper& body) { return body.getCollisionObject()->isStaticOrKinematicObject(); }

}  // namespace

FaceContacts::Factories::Factories(btCollisionConfiguration& bullets)
    : on_plane_(false, bullets.getCollisionAlgorithmCreateFunc(CONVEX_HULL_SHAPE_PROXYTYPE, STATIC_PLANE_PROXYTYPE)),
      under_plane_(true, bullets.getCollisionAlgorithmCreateFunc(STATIC_PLANE_PROXYTYPE, CONVEX_HULL_SHAPE_PROXYTYPE)),
      on_box_(false, bullets.getCollisionAlgorithmCreateFunc(CONVEX_HULL_SHAPE_PROXYTYPE, BOX_SHAPE_PROXYTYPE)),
      under_box_(true, bullets.getCollisionAlgorithmCreateFunc(BOX_SHAPE_PROXYTYPE, CONVEX_HULL_SHAPE_PROXYTYPE)),
      two_boxes_(false, bullets.getCollisionAlgorithmCreateFunc(BOX_SHAPE_PROXYTYPE, BOX_SHAPE_PROXYTYPE)) {}

void FaceContacts::Factories::add_to(btCollisionDispatcher& dispatcher) {
  for (const int shape : kShapes) {
    dispatcher.registerCollisionCreateFunc(shape, STATIC_PLANE_PROXYTYPE, &on_plane_);
    dispatcher.registerCollisionCreateFunc(STATIC_PLANE_PROXYTYPE, shape, &under_plane_);
    dispatcher.registerCollisionCreateFunc(shape, BOX_SHAPE_PROXYTYPE, &on_box_);
    dispatcher.registerCollisionCreateFunc(BOX_SHAPE_PROXYTYPE, shape, &under_box_);
  }
  dispatcher.registerCollisionCreateFunc(BOX_SHAPE_PROXYTYPE, BOX_SHAPE_PROXYTYPE, &two_boxes_);
}

btCollisionAlgorithm* FaceContacts::Factory::CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                                      const btCollisionObjectWrapper* first,
                                                                      const btCollisionObjectWrapper* second) {
  const bool holder_first = m_swapped || (is_box(*first) && is_box(*second) && stands(*first));
  const btCollisionObjectWrapper& held = holder_first ? *second : *first;
  const btCollisionObjectWrapper& holder = holder_first ? *first : *second;
  const bool unknown = held.getCollisionShape()->getShapeType() == CONVEX_HULL_SHAPE_PROXYTYPE &&
                       held.getCollisionShape()->getUserPointer() == nullptr;
  if (unknown || (is_box(held) && is_box(holder) && !stands(holder))) {
    return others_->CreateCollisionAlgorithm(info, first, second);
  }
  static_assert(sizeof(FaceContacts) <= sizeof(btConvexConvexAlgorithm), "Bullet's pool has room for one of its own");
  void* const memory = info.m_dispatcher1->allocateCollisionAlgorithm(sizeof(FaceContacts));
  return new (memory) FaceContacts(info, first, second, *this, holder_first);
}

FaceContacts::FaceContacts(const btCollisionAlgorithmConstructionInfo& info, const btCollisionObjectWrapper* first,
                           const btCollisionObjectWrapper* second, const Factory& factory, bool holder_first)
    : btCollisionAlgorithm(info), holder_first_(holder_first) {
  const btCollisionObjectWrapper& held = holder_first_ ? *second : *first;
  const btCollisionObjectWrapper& holder = holder_first_ ? *first : *second;
  manifold_ = m_dispatcher->getNewManifold(held.getCollisionObject(), holder.getCollisionObject());
  if (holder.getCollisionShape()->getShapeType() == STATIC_PLANE_PROXYTYPE) {
    void* const memory = m_dispatcher->allocateCollisionAlgorithm(sizeof(btConvexPlaneCollisionAlgorithm));
    bullets_ = new (memory) btConvexPlaneCollisionAlgorithm(manifold_, info, &held, &holder, false, 1, 0);
  } else if (is_box(held)) {
    void* const memory = m_dispatcher->allocateCollisionAlgorithm(sizeof(btBoxBoxCollisionAlgorithm));
    bullets_ = new (memory) btBoxBoxCollisionAlgorithm(manifold_, info, &held, &holder);
  } else {
    btCollisionAlgorithmConstructionInfo same(info);
    same.m_manifold = manifold_;
    bullets_ = factory.others_->CreateCollisionAlgorithm(same, &held, &holder);
  }
}

FaceContacts::~FaceContacts() {
  bullets_->~btCollisionAlgorithm();
  m_dispatcher->freeCollisionAlgorithm(bullets_);
  m_dispatcher->releaseManifold(manifold_);
}

/// Points of the body, and how far they are above the face. Lengths are Bullet's units.
struct FaceContacts::Found {
  static constexpr std::size_t kMost = 2 * shapes::FacePoints::kMost;
  Vector3d normal;
  std::array<Vector3d, kMost> point{};
  std::array<double, kMost> gap{};
  std::size_t count = 0;
  double within = 0.0;  ///< What is farther does not touch.

  void add(const Vector3d& at, double above) {
    if (above >= within) return;
    point[count] = at;
    gap[count++] = above;
  }
  /// @param along From each to another one.
  void add(const shapes::FacePoints& points, const Vector3d& along = Vector3d::Zero()) {
    for (std::size_t i = 0; i < points.count; ++i) {
      add(points.point_m[i] + along, points.gap_m[i] + points.normal.dot(along));
    }
  }
  /// Whether the face holds all of them: none is beyond an edge, or so deep that another face is nearer.
  [[nodiscard]] bool are_held_by(const shapes::Face& face) const {
    for (std::size_t i = 0; i < count; ++i) {
      if (std::isfinite(face.half_u_m) && (gap[i] < -within || !face.is_under(point[i]))) return false;
    }
    return true;
  }
};

/// @returns false: they are to be found by Bullet.
bool FaceContacts::find(const btCollisionObjectWrapper& held, const btCollisionObjectWrapper& holder, Found& out) {
  const btCollisionShape& shape = *held.getCollisionShape();
  const Eigen::Quaterniond q_WB = from_bullet(held.getWorldTransform().getRotation());
  const Vector3d centre = from_bullet(held.getWorldTransform().getOrigin());
  const Vector3d axis = q_WB * Vector3d(Vector3d::UnitY());
  const shapes::PlacedShape below = placed(holder);
  const shapes::Face face = *shapes::face_towards(below, centre);
  shapes::FacePoints points;
  out.normal = face.normal;
  switch (shape.getShapeType()) {
    case BOX_SHAPE_PROXYTYPE: {
      const Vector3d half = from_bullet(static_cast<const btBoxShape&>(shape).getHalfExtentsWithMargin());
      (void)shapes::face_points(shapes::Box{half}, q_WB, centre, below, points);
      out.normal = points.normal;
      out.add(points);
      return !is_sliver(points, out.within);
    }
    case CONVEX_HULL_SHAPE_PROXYTYPE: {
      const auto skin = static_cast<double>(static_cast<const btConvexHullShape&>(shape).getMargin());
      const auto& hull = *static_cast<const shapes::Hull*>(shape.getUserPointer());
      shapes::hull_points(hull, q_WB, centre - skin * face.normal, face, points, out.within);
      out.add(points);
      break;
    }
    case CYLINDER_SHAPE_PROXYTYPE: {
      const Vector3d half = from_bullet(static_cast<const btCylinderShape&>(shape).getHalfExtentsWithMargin());
      const Vector3d ahead = q_WB * Vector3d(Vector3d::UnitX());
      const shapes::Cylinder cylinder{half.x(), 2.0 * half.y()};
      shapes::Face endless = face;
      endless.half_u_m = endless.half_v_m = std::numeric_limits<double>::infinity();
      shapes::face_points(cylinder, q_WB, centre, endless, ahead, points);
      out.add(points);
      out.add(points, (axis.dot(face.normal) > 0.0 ? 2.0 : -2.0) * half.y() * axis);
      if (out.are_held_by(face) || axis.cross(face.normal).norm() > kStands) break;
      out.count = 0;
      shapes::face_points(cylinder, q_WB, centre, face, ahead, points);
      out.add(points);
      break;
    }
    default: {
      const auto& capsule = static_cast<const btCapsuleShape&>(shape);
      const Vector3d half = static_cast<double>(capsule.getHalfHeight()) * axis;
      for (const Vector3d& end : {Vector3d(centre + half), Vector3d(centre - half)}) {
        const Vector3d lowest = end - static_cast<double>(capsule.getRadius()) * face.normal;
        out.add(lowest, face.normal.dot(lowest - face.centre_m));
      }
    }
  }
  return out.are_held_by(face);
}

bool FaceContacts::is_alone(const btCollisionObjectWrapper& body) {
  return body.getCollisionObject()->getUserIndex2() == kAlone;
}

void FaceContacts::processCollision(const btCollisionObjectWrapper* first, const btCollisionObjectWrapper* second,
                                    const btDispatcherInfo& info, btManifoldResult* out) {
  const btCollisionObjectWrapper& held = holder_first_ ? *second : *first;
  const btCollisionObjectWrapper& holder = holder_first_ ? *first : *second;
  // In the order of the manifold: Bullet does not turn a normal round.
  out->setBody0Wrap(&held);
  out->setBody1Wrap(&holder);
  out->setPersistentManifold(manifold_);
  Found found;
  found.within = static_cast<double>(manifold_->getContactBreakingThreshold());
  if (is_alone(held) && (stands(holder) || is_alone(holder)) && find(held, holder, found)) {
    tell(found, *out);
  } else {
    bullets_->processCollision(&held, &holder, info, out);
    out->refreshContactPoints();
  }
  out->setBody0Wrap(first);
  out->setBody1Wrap(second);
}

/// Each goes on from the impulses of the nearest one before.
void FaceContacts::tell(const Found& found, btManifoldResult& out) {
  std::array<btManifoldPoint, MANIFOLD_CACHE_SIZE> before;
  const int known = manifold_->getNumContacts();
  for (int i = 0; i < known; ++i) before[static_cast<std::size_t>(i)] = manifold_->getContactPoint(i);
  manifold_->clearManifold();
  const btVector3 up = to_bullet(found.normal);
  for (std::size_t i = 0; i < found.count && manifold_->getNumContacts() < MANIFOLD_CACHE_SIZE; ++i) {
    const auto gap = static_cast<btScalar>(found.gap[i]);
    out.addContactPoint(up, to_bullet(found.point[i]) - gap * up, gap);
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
