#include "rtbus/config/closed_surface.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <tuple>
#include <utility>
#include <vector>

#include "rtbus/shapes/surface.hpp"

namespace rtbus::config {
namespace {

using Eigen::Vector3d;
using Triangle = std::array<std::uint32_t, 3>;

/// Points of a spiral whose turns keep the golden angle between them: no two lie close, none lie on one line.
std::vector<Vector3d> fibonacci_sphere(std::size_t count) {
  const double golden_rad = std::numbers::pi * (3.0 - std::sqrt(5.0));
  std::vector<Vector3d> out;
  for (std::size_t i = 0; i < count; ++i) {
    const double y = 1.0 - (2.0 * static_cast<double>(i) + 1.0) / static_cast<double>(count);
    const double ring = std::sqrt(1.0 - y * y), angle_rad = golden_rad * static_cast<double>(i);
    out.emplace_back(ring * std::cos(angle_rad), y, ring * std::sin(angle_rad));
  }
  return out;
}

/// Convex hull of points that all lie on it, one point after the other: what a new point sees is taken away, and the
/// rim of the hole joined to the point. Quadratic in their number, which is small.
class SphereHull {
 public:
  explicit SphereHull(const std::vector<Vector3d>& points) : points_(points) {
    add({0, 1, 2}), add({0, 2, 1});  // two sides of one triangle: the next point sees one of them
    for (std::uint32_t p = 3; p < points.size(); ++p) insert(p);
  }
  [[nodiscard]] const std::vector<Triangle>& triangles() const noexcept { return triangles_; }

 private:
  void add(const Triangle& t) {
    triangles_.push_back(t);
    normals_.push_back((points_[t[1]] - points_[t[0]]).cross(points_[t[2]] - points_[t[0]]));
  }

  void insert(std::uint32_t p) {
    std::vector<std::pair<std::uint32_t, std::uint32_t>> seen_edges;
    std::size_t kept = 0;
    for (std::size_t i = 0; i < triangles_.size(); ++i) {
      const Triangle t = triangles_[i];
      if ((points_[p] - points_[t[0]]).dot(normals_[i]) > 0.0) {
        for (int k = 0; k < 3; ++k) seen_edges.emplace_back(t[k], t[(k + 1) % 3]);
        continue;
      }
      triangles_[kept] = t;
      normals_[kept++] = normals_[i];
    }
    triangles_.resize(kept);
    normals_.resize(kept);
    for (const auto& [a, b] : seen_edges) {  // an edge on the rim is seen from one side only
      if (std::find(seen_edges.begin(), seen_edges.end(), std::pair(b, a)) == seen_edges.end()) add({a, b, p});
    }
  }

  const std::vector<Vector3d>& points_;
  std::vector<Triangle> triangles_;
  std::vector<Vector3d> normals_;
};

/// 1 in a direction, falling off with the angle to it.
double lobe(const Vector3d& direction, const Vector3d& towards, double width_rad) {
  const double angle_rad = std::acos(std::clamp(direction.dot(towards.normalized()), -1.0, 1.0));
  return std::exp(-(angle_rad / width_rad) * (angle_rad / width_rad));
}

/// In units of about half the rabbit's length.
double rabbit_radius(const Vector3d& d) {
  double r = 1.0 / d.cwiseQuotient(Vector3d(0.72, 0.80, 0.95)).norm();
  r += 0.42 * lobe(d, {0.0, 0.62, 0.80}, 0.50);  // head
  r += 0.10 * lobe(d, {0.0, 0.32, 1.00}, 0.22);  // nose
  for (const double side : {-1.0, 1.0}) {
    r += 0.95 * lobe(d, {0.36 * side, 1.0, 0.16}, 0.22);     // ears
    r += 0.14 * lobe(d, {0.75 * side, -0.30, -0.35}, 0.40);  // haunches
    r += 0.16 * lobe(d, {0.35 * side, -0.55, 0.85}, 0.28);   // paws
  }
  r += 0.16 * lobe(d, {0.0, 0.0, -1.0}, 0.26);  // tail
  constexpr double kBase = 0.60;
  return d.y() < 0.0 ? std::min(r, kBase / -d.y()) : r;
}

using Edge = std::pair<std::uint32_t, std::uint32_t>;

std::map<Edge, int> directed_edges(const TriangleMesh& mesh) {
  std::map<Edge, int> out;
  for (const Triangle& t : mesh.triangles) {
    for (int k = 0; k < 3; ++k) ++out[{t[k], t[(k + 1) % 3]}];
  }
  return out;
}

/// As in the file, where vertices count from 1.
std::string name_of(const Edge& edge) {
  return "the edge from vertex " + std::to_string(edge.first + 1) + " to vertex " + std::to_string(edge.second + 1);
}

}  // namespace

TriangleMesh make_star_surface(std::size_t nodes, const std::function<double(const Vector3d&)>& radius_m) {
  TriangleMesh mesh;
  mesh.vertices_m = fibonacci_sphere(nodes);
  mesh.triangles = SphereHull(mesh.vertices_m).triangles();
  for (Vector3d& vertex : mesh.vertices_m) vertex *= radius_m(vertex);
  return mesh;
}

TriangleMesh make_rabbit(std::size_t nodes, double height_m) {
  TriangleMesh mesh = make_star_surface(nodes, rabbit_radius);
  Vector3d low = mesh.vertices_m.front(), high = low;
  for (const Vector3d& vertex : mesh.vertices_m) low = low.cwiseMin(vertex), high = high.cwiseMax(vertex);
  const double scale = height_m / (high.y() - low.y());
  const Vector3d base(0.5 * (low.x() + high.x()), low.y(), 0.5 * (low.z() + high.z()));
  for (Vector3d& vertex : mesh.vertices_m) vertex = scale * (vertex - base);
  return mesh;
}

TriangleMesh make_ball(std::size_t nodes, double radius_m) {
  return make_star_surface(nodes, [radius_m](const Vector3d&) { return radius_m; });
}

std::string skin_fault(const TriangleMesh& mesh) {
  std::vector<bool> used(mesh.vertices_m.size(), false);
  for (const Triangle& t : mesh.triangles) {
    for (int k = 0; k < 3; ++k) {
      used[t[k]] = true;
      const Edge edge(t[k], t[(k + 1) % 3]);
      if (mesh.vertices_m[edge.first] == mesh.vertices_m[edge.second]) return name_of(edge) + " has no length";
    }
  }
  const auto unused = std::find(used.begin(), used.end(), false);
  if (unused == used.end()) return {};
  return "vertex " + std::to_string(unused - used.begin() + 1) + " belongs to no face";
}

std::string closed_fault(const TriangleMesh& mesh) {
  const auto edges = directed_edges(mesh);
  for (const auto& [edge, count] : edges) {
    if (count > 1) return name_of(edge) + " is in " + std::to_string(count) + " faces that go the same way round";
    if (!edges.contains({edge.second, edge.first})) return name_of(edge) + " belongs to one face only";
  }
  if (enclosed_volume_m3(mesh) <= 0.0) return "its faces look inwards (clockwise from outside)";
  return {};
}

std::vector<std::string> surface_faults(const TriangleMesh& mesh) {
  const auto count_of = [](std::size_t count, const char* one, const char* many) {
    return count == 1 ? one : std::to_string(count) + many;
  };
  const auto at_line = [&mesh](std::size_t triangle) {
    return mesh.file + (triangle < mesh.lines.size() ? ":" + std::to_string(mesh.lines[triangle]) : "");
  };
  struct Side {
    std::uint32_t low, high, triangle;
    bool operator<(const Side& o) const { return std::tie(low, high, triangle) < std::tie(o.low, o.high, o.triangle); }
  };
  const std::vector<std::uint32_t> same = shapes::joined(mesh.vertices_m);
  std::vector<Side> sides;
  sides.reserve(3 * mesh.triangles.size());
  std::size_t flat = 0, first_flat = 0;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Triangle& t = mesh.triangles[i];
    if (!shapes::has_area(mesh.vertices_m[t[0]], mesh.vertices_m[t[1]], mesh.vertices_m[t[2]])) {
      if (flat++ == 0) first_flat = i;
      continue;
    }
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [low, high] = std::minmax(same[t[k]], same[t[(k + 1) % 3]]);
      sides.push_back({low, high, static_cast<std::uint32_t>(i)});
    }
  }
  std::sort(sides.begin(), sides.end());
  std::size_t crowded = 0, first_crowded = mesh.triangles.size();
  for (std::size_t begin = 0, end = 0; begin < sides.size(); begin = end) {
    while (end < sides.size() && sides[end].low == sides[begin].low && sides[end].high == sides[begin].high) ++end;
    if (end - begin <= 2) continue;
    ++crowded;
    first_crowded = std::min<std::size_t>(first_crowded, sides[begin + 2].triangle);
  }
  std::vector<std::string> out;
  if (flat > 0)
    out.push_back(at_line(first_flat) + ": " + count_of(flat, "a face", " faces") + " without area left out");
  if (crowded > 0) {
    out.push_back(at_line(first_crowded) + ": " + count_of(crowded, "an edge", " edges") +
                  " of more than two faces; each face is felt");
  }
  return out;
}

double enclosed_volume_m3(const TriangleMesh& mesh) {
  double volume_m3 = 0.0;
  for (const Triangle& t : mesh.triangles) {
    volume_m3 += mesh.vertices_m[t[0]].dot(mesh.vertices_m[t[1]].cross(mesh.vertices_m[t[2]])) / 6.0;
  }
  return volume_m3;
}

std::vector<std::array<std::uint32_t, 2>> edges_of(const TriangleMesh& mesh) {
  const auto edges = directed_edges(mesh);
  std::vector<std::array<std::uint32_t, 2>> out;
  for (const auto& [edge, count] : edges) {
    if (edge.first < edge.second || !edges.contains({edge.second, edge.first}))
      out.push_back({edge.first, edge.second});
  }
  return out;
}

}  // namespace rtbus::config
