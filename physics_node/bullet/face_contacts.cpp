#include "physics_node/bullet/face_contacts.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <new>

#include <BulletCollision/CollisionDispatch/btBoxBoxCollisionAlgorithm.h>
#include <BulletCollision/CollisionDispatch/btConvexConvexAlgorithm.h>
#include <BulletCollision/CollisionDispatch/btConvexPlaneCollisionAlgorithm.h>

#include "physics_node/bullet/units.hpp"
#include "rtbus/shapes/face_points.hpp"

namespace physics::bullet {

using Eigen::Vector3d;
namespace shapes = rtbus::shapes;

namespace {

/// A cylinder that leans by less (a sine) stands: where a box ends its rim is cut off.
constexpr double kUpright = 0.01;

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
  for (const int shape : BodyPoints::kShapes) {
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
  if (!BodyPoints::knows(held) || (is_box(held) && is_box(holder) && !stands(holder))) {
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
    fallback_ = new (memory) btConvexPlaneCollisionAlgorithm(manifold_, info, &held, &holder, false, 1, 0);
  } else if (is_box(held)) {
    void* const memory = m_dispatcher->allocateCollisionAlgorithm(sizeof(btBoxBoxCollisionAlgorithm));
    fallback_ = new (memory) btBoxBoxCollisionAlgorithm(manifold_, info, &held, &holder);
  } else {
    btCollisionAlgorithmConstructionInfo same(info);
    same.m_manifold = manifold_;
    fallback_ = factory.others_->CreateCollisionAlgorithm(same, &held, &holder);
  }
}

FaceContacts::~FaceContacts() {
  fallback_->~btCollisionAlgorithm();
  m_dispatcher->freeCollisionAlgorithm(fallback_);
  m_dispatcher->releaseManifold(manifold_);
}

/// @returns whether the face holds all of them: none is beyond an edge, or so deep that another face is nearer.
bool FaceContacts::are_held_by(const shapes::Face& face, const BodyPoints& points) {
  if (!std::isfinite(face.half_u_m)) return true;
  return std::all_of(points.all().begin(), points.all().end(),
                     [&](const TouchPoint& each) { return each.gap >= -points.within() && face.is_under(each.point); });
}

/// @returns false: they are to be found by Bullet.
bool FaceContacts::find(const btCollisionObjectWrapper& held, const btCollisionObjectWrapper& holder, BodyPoints& out) {
  const Eigen::Quaterniond q_WB = from_bullet(held.getWorldTransform().getRotation());
  const Vector3d centre = from_bullet(held.getWorldTransform().getOrigin());
  const shapes::PlacedShape below = placed(holder);
  if (is_box(held) && is_box(holder)) {
    const auto& box = static_cast<const btBoxShape&>(*held.getCollisionShape());
    shapes::FacePoints points;
    (void)shapes::face_points(shapes::Box{from_bullet(box.getHalfExtentsWithMargin())}, q_WB, centre, below, points);
    out.add(points);
    return !is_sliver(points, out.within());
  }
  const shapes::Face face = *shapes::face_towards(below, centre);
  out.find(held, face.without_edges());
  if (are_held_by(face, out)) return true;
  const Vector3d axis = q_WB * Vector3d(Vector3d::UnitY());
  const bool stands =
      held.getCollisionShape()->getShapeType() == CYLINDER_SHAPE_PROXYTYPE && axis.cross(face.normal).norm() < kUpright;
  if (!stands) return false;
  out.find(held, face);
  return !out.all().empty() && are_held_by(face, out);
}

void FaceContacts::processCollision(const btCollisionObjectWrapper* first, const btCollisionObjectWrapper* second,
                                    const btDispatcherInfo& info, btManifoldResult* out) {
  const btCollisionObjectWrapper& held = holder_first_ ? *second : *first;
  const btCollisionObjectWrapper& holder = holder_first_ ? *first : *second;
  // In the order of the manifold: Bullet does not turn a normal round.
  out->setBody0Wrap(&held);
  out->setBody1Wrap(&holder);
  out->setPersistentManifold(manifold_);
  BodyPoints found(static_cast<double>(manifold_->getContactBreakingThreshold()));
  if (is_met_at_all_points(held) && (stands(holder) || is_met_at_all_points(holder)) && find(held, holder, found)) {
    replace_points(found.all(), *manifold_, *out);
  } else {
    fallback_->processCollision(&held, &holder, info, out);
    out->refreshContactPoints();
  }
  out->setBody0Wrap(first);
  out->setBody1Wrap(second);
}

}  // namespace physics::bullet
