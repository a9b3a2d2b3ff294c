#include "physics_node/bullet/bullet_shapes.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <LinearMath/btConvexHullComputer.h>

namespace physics::bullet {
namespace {

using Eigen::Vector3d;
namespace config = rtbus::config;
namespace shapes = rtbus::shapes;

constexpr double kSkin = 0.005;        // of the shortest extent
constexpr double kLargestScale = 1e5;  // 100 µm; below it the range of positions becomes the limit

/// A box lies within its margin, not around it: it rounds its edges for the general algorithm.
/// Bullet's own choice, a tenth of the smallest half extent and at most 0.04 units of 0.6.
btScalar margin_of_box(double smallest_half_m, double scale) {
  return static_cast<btScalar>(std::min(0.1 * smallest_half_m * scale, 0.04 * kToleranceScale));
}

/// Centre of volume: the hull's faces, cut into triangles, span tetrahedra with its first vertex.
Vector3d centroid_m(const btConvexHullComputer& hull) {
  const auto vertex = [&hull](int i) { return from_bullet(hull.vertices[i]); };
  const Vector3d apex = vertex(0);
  Vector3d moment = Vector3d::Zero();
  double volume = 0.0;
  for (int face = 0; face < hull.faces.size(); ++face) {
    const btConvexHullComputer::Edge* const first = &hull.edges[hull.faces[face]];
    const Vector3d a = vertex(first->getSourceVertex());
    for (const auto* edge = first->getNextEdgeOfFace(); edge->getTargetVertex() != first->getSourceVertex();
         edge = edge->getNextEdgeOfFace()) {
      const Vector3d b = vertex(edge->getSourceVertex());
      const Vector3d c = vertex(edge->getTargetVertex());
      const double tetrahedron = (a - apex).dot((b - apex).cross(c - apex));
      volume += tetrahedron;
      moment += tetrahedron * (apex + a + b + c) / 4.0;
    }
  }
  return volume != 0.0 ? Vector3d(moment / volume) : apex;
}

MadeShape make_hull(const config::TriangleMesh& points, double scale) {
  std::vector<double> coordinates;
  for (const Vector3d& vertex : points.vertices_m)
    coordinates.insert(coordinates.end(), vertex.data(), vertex.data() + 3);
  btConvexHullComputer hull;
  hull.compute(coordinates.data(), 3 * sizeof(double), static_cast<int>(points.vertices_m.size()), 0, 0);

  MadeShape out;
  out.centre_m = centroid_m(hull);
  auto shape = std::make_unique<btConvexHullShape>();
  shapes::Hull corners;
  for (int i = 0; i < hull.vertices.size(); ++i) {
    const Vector3d from_centre_m = from_bullet(hull.vertices[i]) - out.centre_m;
    shape->addPoint(to_bullet(from_centre_m, scale), false);
    corners.points_m.push_back(scale * from_centre_m);
  }
  if (corners.points_m.size() <= shapes::Hull::kMost) {
    out.hull = std::make_unique<const shapes::Hull>(std::move(corners));
    shape->setUserPointer(const_cast<shapes::Hull*>(out.hull.get()));  // Bullet keeps no pointer to const
  }
  shape->setMargin(static_cast<btScalar>(kSkin * points.extents_m().minCoeff() * scale));
  shape->recalcLocalAabb();
  out.shape = std::move(shape);
  return out;
}

MadeShape make_mesh(const config::TriangleMesh& surface, double scale) {
  MadeShape out;
  out.triangles = std::make_unique<btTriangleMesh>();
  for (const auto& [a, b, c] : surface.triangles) {
    out.triangles->addTriangle(to_bullet(surface.vertices_m[a], scale), to_bullet(surface.vertices_m[b], scale),
                               to_bullet(surface.vertices_m[c], scale));
  }
  out.shape = std::make_unique<btBvhTriangleMeshShape>(out.triangles.get(), true);
  out.shape->setMargin(static_cast<btScalar>(kSkin * kGoodExtent));
  std::vector<Vector3d> vertices = surface.vertices_m;
  for (Vector3d& vertex : vertices) vertex *= scale;
  out.surface = std::make_unique<const shapes::Surface>(vertices, surface.triangles);
  return out;
}

}  // namespace

MadeShape make_shape(const config::BodyShape& shape, double scale) {
  const auto length = [scale](double metres) { return static_cast<btScalar>(metres * scale); };
  MadeShape out;
  if (const auto* sphere = std::get_if<shapes::Sphere>(&shape)) {
    out.shape = std::make_unique<btSphereShape>(length(sphere->radius_m));
  } else if (const auto* box = std::get_if<shapes::Box>(&shape)) {
    out.shape = std::make_unique<btBoxShape>(to_bullet(box->half_size_m, scale));
    out.shape->setMargin(margin_of_box(box->half_size_m.minCoeff(), scale));
  } else if (const auto* capsule = std::get_if<config::Capsule>(&shape)) {
    out.shape = std::make_unique<btCapsuleShape>(length(capsule->radius_m),
                                                 length(capsule->length_m - 2.0 * capsule->radius_m));
  } else if (const auto* cylinder = std::get_if<config::Cylinder>(&shape)) {
    out.shape = std::make_unique<btCylinderShape>(
        btVector3(length(cylinder->radius_m), length(0.5 * cylinder->length_m), length(cylinder->radius_m)));
    // A rim is rounded on planes too: with Bullet's own choice a cylinder tips over as if it were a tenth thinner.
    out.shape->setMargin(length(kSkin * smallest_extent_m(shape)));
  } else if (const auto* hull = std::get_if<config::ConvexHull>(&shape)) {
    out = make_hull(*hull->points, scale);
  } else if (const auto* mesh = std::get_if<config::Mesh>(&shape)) {
    out = make_mesh(*mesh->surface, scale);
  } else {
    out.shape = std::make_unique<btStaticPlaneShape>(btVector3(0, 1, 0), btScalar(0));
  }
  return out;
}

double smallest_extent_m(const config::BodyShape& shape) {
  if (const auto* sphere = std::get_if<shapes::Sphere>(&shape)) return 2.0 * sphere->radius_m;
  if (const auto* box = std::get_if<shapes::Box>(&shape)) return 2.0 * box->half_size_m.minCoeff();
  if (const auto* capsule = std::get_if<config::Capsule>(&shape)) return 2.0 * capsule->radius_m;
  if (const auto* cylinder = std::get_if<config::Cylinder>(&shape)) {
    return std::min(2.0 * cylinder->radius_m, cylinder->length_m);
  }
  if (const auto* hull = std::get_if<config::ConvexHull>(&shape)) return hull->points->extents_m().minCoeff();
  return 0.0;
}

double smallest_moving_extent_m(const config::Scene& scene) {
  double smallest = 0.0;
  for (const config::Body& body : scene.bodies) {
    if (body.type != config::BodyType::kDynamic) continue;
    const double extent = smallest_extent_m(body.shape);
    if (smallest == 0.0 || extent < smallest) smallest = extent;
  }
  for (const config::SoftBody& body : scene.soft_bodies) {
    const double extent = body.mesh->extents_m().minCoeff();
    if (smallest == 0.0 || extent < smallest) smallest = extent;
  }
  return smallest > 0.0 ? smallest : kDefaultExtentM;
}

double length_scale(double extent_m) { return std::min(kGoodExtent / extent_m, kLargestScale); }

}  // namespace physics::bullet
