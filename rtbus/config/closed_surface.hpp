#pragma once
/// @file closed_surface.hpp
/// Triangle meshes as the skin of a body: made by rule, and checked when they come from a file.
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "rtbus/config/body_shape.hpp"

namespace rtbus::config {

/// A star-shaped surface: `nodes` ≥ 4 points spread evenly over the sphere (Fibonacci), joined by their convex hull
/// (which on a sphere is the Delaunay triangulation), each moved out to `radius_m(direction)` > 0. Closed and without
/// handles: V nodes, 3V − 6 edges, 2V − 4 faces, counter-clockwise from outside. The same on every machine but for
/// rounding.
[[nodiscard]] TriangleMesh make_star_surface(std::size_t nodes,
                                             const std::function<double(const Eigen::Vector3d&)>& radius_m);

/// The same as a rabbit that sits: head towards +z, two ears up, a flat base at y = 0, origin in the middle of it.
[[nodiscard]] TriangleMesh make_rabbit(std::size_t nodes, double height_m);

/// The same as a ball around the origin.
[[nodiscard]] TriangleMesh make_ball(std::size_t nodes, double radius_m);

/// What keeps a mesh from being the skin of something: a vertex in no face, an edge of no length. Empty: nothing does.
[[nodiscard]] std::string skin_fault(const TriangleMesh& mesh);

/// What keeps it from enclosing a volume: an edge that does not belong to exactly two faces, in opposite directions, or
/// faces that look inwards. Empty: nothing does.
[[nodiscard]] std::string closed_fault(const TriangleMesh& mesh);

/// What a file's mesh has that a surface has not, each with file and line: a face without area, which is left out, and
/// an edge of more than two faces, which are all felt. Empty: nothing.
[[nodiscard]] std::vector<std::string> surface_faults(const TriangleMesh& mesh);

/// By the divergence theorem; meaningful for a closed mesh, negative when its faces look inwards [m³].
[[nodiscard]] double enclosed_volume_m3(const TriangleMesh& mesh);

/// Its edges, each once, as pairs of vertices.
[[nodiscard]] std::vector<std::array<std::uint32_t, 2>> edges_of(const TriangleMesh& mesh);

}  // namespace rtbus::config
