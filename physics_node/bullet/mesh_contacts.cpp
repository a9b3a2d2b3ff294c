#include "physics_node/bullet/mesh_contacts.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <new>
#include <span>

#include <BulletCollision/CollisionDispatch/btConvexConcaveCollisionAlgorithm.h>
#include <BulletCollision/CollisionShapes/btConcaveShape.h>
#include <BulletCollision/CollisionShapes/btTriangleCallback.h>

#include "physics_node/bullet/body_points.hpp"
#include "physics_node/bullet/units.hpp"
#include "rtbus/shapes/surface.hpp"

namespace physics::bullet {

using Eigen::Vector3d;
namespace shapes = rtbus::shapes;

namespace {

/// A point on the edge of two triangles is above both: a share of their area.
constexpr double kOnEdge = 1e-6;
/// Triangles whose normals differ by less (a cosine) are one plane: by 1.4 mrad, as coordinates in a file are rounded.
constexpr double kSamePlane = 1.0 - 1e-6;
/// Points over them that are nearer are one: a share of the distance at which they touch.
constexpr double kSamePoint = 0.1;

struct Triangle {
  std::array<Vector3d, 3> corner;
  Vector3d area;      ///< Twice as long as the area, either way.
  shapes::Face face;  ///< Without edges, on the skin of the triangle; it looks at the body.

  Triangle(const btVector3* vertices, const btTransform& mesh, double skin, const Vector3d& body) {
    for (std::size_t i = 0; i < 3; ++i) corner[i] = from_bullet(mesh * vertices[i]);
    area = (corner[1] - corner[0]).cross(corner[2] - corner[0]);
    face.normal = area.normalized();
    if (face.normal.dot(body - corner[0]) < 0.0) face.normal = -face.normal;
    face.centre_m = corner[0] + skin * face.normal;
  }
  [[nodiscard]] bool is_under(const Vector3d& point) const {
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector3d& from = corner[i];
      const double inside = area.dot((corner[(i + 1) % 3] - from).cross(point - from));
      if (inside < -kOnEdge * area.squaredNorm()) return false;
    }
    return true;
  }
};

/// Gathers the points of a body that touch the planes of triangles near it.
class Gather final : public btTriangleCallback {
 public:
  Gather(const btCollisionObjectWrapper& body, const btTransform& mesh, double skin, double within)
      : body_(body), mesh_(mesh), skin_(skin), within_(within), points_(within) {}

  void processTriangle(btVector3* vertices, int, int) override {
    if (!possible_) return;
    const Triangle triangle(vertices, mesh_, skin_, from_bullet(body_.getWorldTransform().getOrigin()));
    if (!shapes::has_area(triangle.corner[0], triangle.corner[1], triangle.corner[2])) return;
    // Neighbours of a flat part share their plane.
    const Vector3d& normal = triangle.face.normal;
    const double height = normal.dot(triangle.face.centre_m);
    if (normal != plane_normal_ || height != plane_height_) points_.find(body_, triangle.face);
    plane_normal_ = normal;
    plane_height_ = height;
    for (const TouchPoint& each : points_.all()) {
      const bool over = triangle.is_under(each.point);
      std::size_t i = 0;
      while (i < count_ && !is_same(touched_[i], each)) ++i;
      possible_ = i < touched_.size() && each.gap > -within_;
      if (!possible_) return;
      // Of the two sides of a plate the nearer one holds.
      const bool known = i < count_ && over_[i];
      if (i == count_ || (over && (!known || each.gap < touched_[i].gap))) touched_[i] = each;
      over_[i] = known || over;
      count_ = std::max(count_, i + 1);
    }
  }

  /// @returns whether all of them are above the mesh.
  [[nodiscard]] bool is_flat() const {
    return possible_ && count_ > 0 &&
           std::all_of(over_.begin(), over_.begin() + static_cast<std::ptrdiff_t>(count_),
                       [](bool over) { return over; });
  }
  [[nodiscard]] std::span<const TouchPoint> touched() const { return {touched_.data(), count_}; }

 private:
  [[nodiscard]] bool is_same(const TouchPoint& a, const TouchPoint& b) const {
    return a.normal.dot(b.normal) > kSamePlane && (a.point - b.point).norm() < kSamePoint * within_;
  }
  const btCollisionObjectWrapper& body_;
  const btTransform& mesh_;
  double skin_, within_;
  BodyPoints points_;  ///< Over the plane of the last triangle, which has this normal and height.
  Vector3d plane_normal_ = Vector3d::Zero();
  double plane_height_ = 0.0;
  std::array<TouchPoint, MANIFOLD_CACHE_SIZE> touched_;
  std::array<bool, MANIFOLD_CACHE_SIZE> over_{};
  std::size_t count_ = 0;
  bool possible_ = true;
};

}  // namespace

MeshContacts::Factories::Factories(btCollisionConfiguration& bullets)
    : on_mesh_(false,
               bullets.getCollisionAlgorithmCreateFunc(CONVEX_HULL_SHAPE_PROXYTYPE, TRIANGLE_MESH_SHAPE_PROXYTYPE)),
      under_mesh_(
          true, bullets.getCollisionAlgorithmCreateFunc(TRIANGLE_MESH_SHAPE_PROXYTYPE, CONVEX_HULL_SHAPE_PROXYTYPE)) {}

void MeshContacts::Factories::add_to(btCollisionDispatcher& dispatcher) {
  for (const int shape : BodyPoints::kShapes) {
    dispatcher.registerCollisionCreateFunc(shape, TRIANGLE_MESH_SHAPE_PROXYTYPE, &on_mesh_);
    dispatcher.registerCollisionCreateFunc(TRIANGLE_MESH_SHAPE_PROXYTYPE, shape, &under_mesh_);
  }
}

btCollisionAlgorithm* MeshContacts::Factory::CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                                      const btCollisionObjectWrapper* first,
                                                                      const btCollisionObjectWrapper* second) {
  btCollisionAlgorithm* const bullets = others_->CreateCollisionAlgorithm(info, first, second);
  if (!BodyPoints::knows(m_swapped ? *second : *first)) return bullets;
  static_assert(sizeof(MeshContacts) <= sizeof(btConvexConcaveCollisionAlgorithm), "Bullet's pool has room for it");
  void* const memory = info.m_dispatcher1->allocateCollisionAlgorithm(sizeof(MeshContacts));
  return new (memory) MeshContacts(info, bullets, m_swapped);
}

MeshContacts::MeshContacts(const btCollisionAlgorithmConstructionInfo& info, btCollisionAlgorithm* bullets,
                           bool mesh_first)
    : btCollisionAlgorithm(info), fallback_(bullets), mesh_first_(mesh_first) {
  btManifoldArray manifolds;
  bullets->getAllContactManifolds(manifolds);
  manifold_ = manifolds[0];
}

MeshContacts::~MeshContacts() {
  fallback_->~btCollisionAlgorithm();
  m_dispatcher->freeCollisionAlgorithm(fallback_);
}

void MeshContacts::processCollision(const btCollisionObjectWrapper* first, const btCollisionObjectWrapper* second,
                                    const btDispatcherInfo& info, btManifoldResult* out) {
  const btCollisionObjectWrapper& body = mesh_first_ ? *second : *first;
  const btCollisionObjectWrapper& mesh = mesh_first_ ? *first : *second;
  if (!is_met_at_all_points(body)) return fallback_->processCollision(first, second, info, out);
  const auto& shape = static_cast<const btConcaveShape&>(*mesh.getCollisionShape());
  const btScalar within = manifold_->getContactBreakingThreshold();
  const btScalar around = within + shape.getMargin();
  btVector3 low, high;
  body.getCollisionShape()->getAabb(mesh.getWorldTransform().inverse() * body.getWorldTransform(), low, high);
  const btVector3 more(around, around, around);
  Gather gather(body, mesh.getWorldTransform(), static_cast<double>(shape.getMargin()), static_cast<double>(within));
  shape.processAllTriangles(&gather, low - more, high + more);
  if (!gather.is_flat()) return fallback_->processCollision(first, second, info, out);
  out->setBody0Wrap(&body);
  out->setBody1Wrap(&mesh);
  out->setPersistentManifold(manifold_);
  replace_points(gather.touched(), *manifold_, *out);
  out->setBody0Wrap(first);
  out->setBody1Wrap(second);
}

}  // namespace physics::bullet
