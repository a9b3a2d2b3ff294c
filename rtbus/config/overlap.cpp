#include "rtbus/config/overlap.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include "rtbus/config/closed_surface.hpp"

namespace rtbus::config {
namespace {

using Eigen::Vector3d;

constexpr double kInfinite_m = std::numeric_limits<double>::infinity();
/// Of the smaller body's least extent.
constexpr double kOverlap = 0.1;

/// A ball of which the body is made: a corner has the radius 0.
struct Probe {
  Vector3d p_B;
  double radius_m = 0.0;
};

Vector3d centre_of(const TriangleMesh& mesh) {
  Vector3d sum = Vector3d::Zero();
  for (const Vector3d& vertex : mesh.vertices_m) sum += vertex;
  return sum / static_cast<double>(mesh.vertices_m.size());
}

/// Is p in the convex hull of the points? The nearest point of the hull is a weighted mean of vertices; each step moves
/// weight from the worst vertex to the best (M. Frank, P. Wolfe, "An algorithm for quadratic programming", 1956, in its
/// pairwise form). Outside, a plane soon parts p from all vertices.
bool hull_contains(const std::vector<Vector3d>& points, const Vector3d& p) {
  constexpr int kMaxSteps = 1000;
  constexpr double kNearShare = 1e-5;  // of the largest distance from p
  double farthest_m = 0.0;
  for (const Vector3d& point : points) farthest_m = std::max(farthest_m, (point - p).norm());
  std::vector<double> weights(points.size(), 0.0);
  weights.front() = 1.0;
  Vector3d nearest = points.front() - p;
  for (int step = 0; step < kMaxSteps && nearest.norm() >= kNearShare * farthest_m; ++step) {
    std::size_t best = 0, worst = 0;
    double least = kInfinite_m, most = -kInfinite_m;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const double along = nearest.dot(points[i] - p);
      if (along < least) least = along, best = i;
      if (weights[i] > 0.0 && along > most) most = along, worst = i;
    }
    if (least > 0.0) return false;  // all of the hull lies on one side of p
    const Vector3d way = points[best] - points[worst];
    if (way.squaredNorm() <= 0.0) break;
    const double share = std::clamp(-nearest.dot(way) / way.squaredNorm(), 0.0, weights[worst]);
    weights[best] += share;
    weights[worst] -= share;
    nearest += share * way;
  }
  return true;
}

/// Does a ray from p leave a closed mesh one time more than it enters? A direction that meets no edge of what people
/// draw.
bool mesh_contains(const TriangleMesh& mesh, const Vector3d& p) {
  const Vector3d ray = Vector3d(0.5718, 0.7431, 0.3476).normalized();
  bool inside = false;
  for (const auto& triangle : mesh.triangles) {
    const Vector3d a = mesh.vertices_m[triangle[0]];
    const Vector3d ab = mesh.vertices_m[triangle[1]] - a, ac = mesh.vertices_m[triangle[2]] - a;
    const Vector3d across = ray.cross(ac);
    const double volume = ab.dot(across);
    if (volume == 0.0) continue;
    const double u = (p - a).dot(across) / volume;
    const Vector3d other = (p - a).cross(ab);
    const double v = ray.dot(other) / volume;
    if (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && ac.dot(other) / volume > 0.0) inside = !inside;
  }
  return inside;
}

bool encloses(const TriangleMesh& mesh) { return !mesh.triangles.empty() && closed_fault(mesh).empty(); }

/// Is p, in the body's frame, deeper than depth_m? A negative depth: nearer than that from outside.
struct Depth {
  Vector3d p;
  double depth_m;

  bool operator()(const shapes::Plane&) const { return p.y() < -depth_m; }
  bool operator()(const shapes::Sphere& sphere) const { return p.norm() - sphere.radius_m < -depth_m; }
  bool operator()(const shapes::Box& box) const {
    return shapes::nearest_surface(shapes::Shape(box), p).distance_m < -depth_m;
  }
  bool operator()(const Capsule& capsule) const {
    const double half_m = 0.5 * capsule.length_m - capsule.radius_m;
    const Vector3d axis(0.0, std::clamp(p.y(), -half_m, half_m), 0.0);
    return (p - axis).norm() - capsule.radius_m < -depth_m;
  }
  bool operator()(const Cylinder& cylinder) const {
    const double side_m = std::hypot(p.x(), p.z()) - cylinder.radius_m;
    return std::max(side_m, std::abs(p.y()) - 0.5 * cylinder.length_m) < -depth_m;
  }
  bool operator()(const ConvexHull& hull) const {
    // Deeper: still inside when it is moved away from the centre by as much.
    const Vector3d out = p - centre_of(*hull.points);
    const double away_m = out.norm();
    const Vector3d moved = away_m > 0.0 ? Vector3d(p + out * (std::max(depth_m, -away_m) / away_m)) : p;
    return hull_contains(hull.points->vertices_m, moved);
  }
  bool operator()(const Mesh& mesh) const { return encloses(*mesh.surface) && mesh_contains(*mesh.surface, p); }
};

void add_corners(const Vector3d& half_m, std::vector<Probe>& out) {
  for (int corner = 0; corner < 8; ++corner) {
    const Vector3d sign((corner & 1) != 0 ? 1.0 : -1.0, (corner & 2) != 0 ? 1.0 : -1.0, (corner & 4) != 0 ? 1.0 : -1.0);
    out.push_back({half_m.cwiseProduct(sign)});
  }
}

std::vector<Probe> probes_of(const BodyShape& shape) {
  std::vector<Probe> out;
  if (const auto* sphere = std::get_if<shapes::Sphere>(&shape)) return {{Vector3d::Zero(), sphere->radius_m}};
  if (const auto* capsule = std::get_if<Capsule>(&shape)) {
    const double half_m = 0.5 * capsule->length_m - capsule->radius_m;
    return {{{0.0, half_m, 0.0}, capsule->radius_m}, {{0.0, -half_m, 0.0}, capsule->radius_m}};
  }
  if (const auto* box = std::get_if<shapes::Box>(&shape)) {
    add_corners(box->half_size_m, out);
    out.push_back({Vector3d::Zero()});
  }
  if (const auto* cylinder = std::get_if<Cylinder>(&shape)) {
    constexpr int kRim = 8;
    for (int i = 0; i < kRim; ++i) {
      const double angle_rad = 2.0 * std::numbers::pi * i / kRim;
      for (const double end : {-0.5, 0.5}) {
        out.push_back({{cylinder->radius_m * std::cos(angle_rad), end * cylinder->length_m,
                        cylinder->radius_m * std::sin(angle_rad)}});
      }
    }
    out.push_back({Vector3d::Zero()});
  }
  if (const auto* hull = std::get_if<ConvexHull>(&shape)) {
    for (const Vector3d& vertex : hull->points->vertices_m) out.push_back({vertex});
    out.push_back({centre_of(*hull->points)});
  }
  return out;
}

bool is_mesh(const Body& body) { return std::holds_alternative<Mesh>(body.shape); }
bool is_plane(const Body& body) { return std::holds_alternative<shapes::Plane>(body.shape); }

/// Is a probe of `body` deeper than depth_m in `solid`? In a mesh only the centre of the body counts: what stands on
/// the skin of one touches it with its corners.
bool reaches_into(const Body& body, const Body& solid, double depth_m) {
  if (is_mesh(solid)) return is_inside(solid, body.p_WB, 0.0);
  const std::vector<Probe> probes = probes_of(body.shape);
  return std::any_of(probes.begin(), probes.end(), [&](const Probe& probe) {
    return is_inside(solid, body.p_WB + body.q_WB * probe.p_B, depth_m - probe.radius_m);
  });
}

/// Around the body in W; endless of a plane.
struct Bounds {
  Vector3d low_m, high_m;
};

Bounds bounds_of(const Body& body) {
  if (is_plane(body)) return {Vector3d::Constant(-kInfinite_m), Vector3d::Constant(kInfinite_m)};
  Vector3d centre = Vector3d::Zero();  // of the box in the body's frame; a file's origin is anywhere
  if (const auto* hull = std::get_if<ConvexHull>(&body.shape)) centre = centre_of(*hull->points);
  if (const auto* mesh = std::get_if<Mesh>(&body.shape)) centre = centre_of(*mesh->surface);
  const double radius_m = extents_m(body.shape).norm();
  const Vector3d middle = body.p_WB + body.q_WB * centre;
  return {middle.array() - radius_m, middle.array() + radius_m};
}

bool meet(const Bounds& a, const Bounds& b) {
  return (a.low_m.array() <= b.high_m.array()).all() && (b.low_m.array() <= a.high_m.array()).all();
}

bool overlap(const Body& a, const Body& b) {
  double least_m = kInfinite_m;
  for (const Body* each : {&a, &b}) {
    if (!is_plane(*each) && !is_mesh(*each)) least_m = std::min(least_m, extents_m(each->shape).minCoeff());
  }
  const double depth_m = kOverlap * least_m;
  return reaches_into(a, b, depth_m) || reaches_into(b, a, depth_m);
}

}  // namespace

bool is_inside(const Body& body, const Vector3d& p_W, double depth_m) {
  return std::visit(Depth{body.q_WB.conjugate() * (p_W - body.p_WB), depth_m}, body.shape);
}

bool is_inside(const SoftBody& body, const Vector3d& p_W) {
  return encloses(*body.mesh) && mesh_contains(*body.mesh, body.q_WB.conjugate() * (p_W - body.p_WB));
}

std::vector<std::string> overlap_warnings(const Scene& scene) {
  // Sorted along x, only those are compared whose bounds meet there.
  std::vector<std::pair<Bounds, const Body*>> order;
  for (const Body& body : scene.bodies) order.emplace_back(bounds_of(body), &body);
  std::stable_sort(order.begin(), order.end(),
                   [](const auto& a, const auto& b) { return a.first.low_m.x() < b.first.low_m.x(); });
  std::size_t pairs = 0;
  std::pair<const Body*, const Body*> first;
  for (std::size_t i = 0; i < order.size(); ++i) {
    for (std::size_t j = i + 1; j < order.size(); ++j) {
      const auto& [a_bounds, a] = order[i];
      const auto& [b_bounds, b] = order[j];
      if (b_bounds.low_m.x() > a_bounds.high_m.x()) break;
      const bool a_moves = a->type == BodyType::kDynamic, b_moves = b->type == BodyType::kDynamic;
      if ((!a_moves && !b_moves) || !meet(a_bounds, b_bounds) || !overlap(*a, *b)) continue;
      if (pairs++ == 0) first = a_moves ? std::pair(a, b) : std::pair(b, a);
    }
  }
  if (pairs == 0) return {};
  std::string text = first.first->source + " (" + first.first->name + ") starts inside " + first.second->name;
  if (pairs > 1) text += ", and " + std::to_string(pairs - 1) + " more pairs of bodies overlap";
  return {text + ": the contact pushes it out with a jerk; move its position_m, which is that of its centre"};
}

}  // namespace rtbus::config
