#pragma once
/// @file body_shape.hpp
/// The shapes a scene may give to a body. Plane, sphere and box are exact (rtbus/shapes) and known to every engine and
/// to the `direct` method; the others need an engine that is told so by name.
#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "rtbus/config/document.hpp"
#include "rtbus/shapes/shapes.hpp"

namespace rtbus::config {

using shapes::Capsule;
using shapes::Cylinder;

/// What an OBJ file holds, polygons cut into triangles, lengths already in metres.
struct TriangleMesh {
  std::vector<Eigen::Vector3d> vertices_m;
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< Indices into vertices_m, counter-clockwise from outside.
  std::vector<std::uint32_t> lines;                     ///< Of the file, one for each triangle; none of a made mesh.
  std::string file;
  bool unit_assumed = false;  ///< Of a file without `metres_per_unit`: its numbers were taken as metres.

  /// Of the box that holds it, along the axes. There is at least one vertex.
  [[nodiscard]] Eigen::Vector3d extents_m() const {
    Eigen::Vector3d low = vertices_m.front();
    Eigen::Vector3d high = low;
    for (const Eigen::Vector3d& vertex : vertices_m) {
      low = low.cwiseMin(vertex);
      high = high.cwiseMax(vertex);
    }
    return high - low;
  }
};

/// The convex hull of a file's vertices; its origin is the file's.
struct ConvexHull {
  std::shared_ptr<const TriangleMesh> points;
};

/// A file's triangles as a surface; of static bodies only.
struct Mesh {
  std::shared_ptr<const TriangleMesh> surface;
};

using BodyShape = std::variant<shapes::Plane, shapes::Sphere, shapes::Box, Capsule, Cylinder, ConvexHull, Mesh>;

/// As in YAML: "box", "convex_hull", …
[[nodiscard]] std::string_view name_of(const BodyShape& shape) noexcept;

/// Edges of the smallest box, along the axes of the body, that holds it [m]; zero of a plane, which has no end.
[[nodiscard]] Eigen::Vector3d extents_m(const BodyShape& shape);

/// Reads `shape: {box: {size_m: […]}}` of a body: one key that names the shape, its dimensions below. Throws Error.
[[nodiscard]] BodyShape read_body_shape(Map& body);

/// Reads the keys `file` and `metres_per_unit` of a mesh, and the file. Throws Error.
[[nodiscard]] std::shared_ptr<const TriangleMesh> read_mesh_file(Map& keys);

/// Reads vertices and faces of a Wavefront OBJ file and multiplies coordinates by `metres_per_unit`. Everything but `v`
/// and `f` lines is ignored. Throws Error, which names file and line.
[[nodiscard]] TriangleMesh read_obj(const std::string& file, double metres_per_unit);

}  // namespace rtbus::config
