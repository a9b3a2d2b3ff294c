#pragma once
/// @file surface.hpp
/// A surface of triangles, open or closed, and the places on it where its distance to a point has a local minimum: what
/// a ball around that point touches.
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace rtbus::shapes {

/// Part of a triangle where a point is.
struct TrianglePart {
  enum Kind : std::uint8_t { kFace, kEdge, kCorner } kind = kFace;
  std::uint8_t index = 0;  ///< Edge i leads from corner i to corner i + 1.
};

/// The point of the triangle nearest to `p`, and the part it is on. C. Ericson, "Real-Time Collision Detection", 2005,
/// section 5.1.5. Of a triangle without area: some point of it. @realtime Yes.
[[nodiscard]] Eigen::Vector3d nearest_on_triangle(const Eigen::Vector3d& p,
                                                  const std::array<Eigen::Vector3d, 3>& corner,
                                                  TrianglePart& part) noexcept;

/// Wider than rounding: what is flatter has no normal.
[[nodiscard]] bool has_area(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) noexcept;

/// Of each vertex the number that stands for all at the same place.
[[nodiscard]] std::vector<std::uint32_t> joined(const std::vector<Eigen::Vector3d>& vertices_m);

/// Triangles in a tree of boxes, and which of them are neighbours. Does not change once it is made.
class Surface {
 public:
  /// Repeated vertices count as one. Triangles without area are left out.
  /// @param vertices_m In the body's frame. @param triangles Indices into `vertices_m`, each in range.
  Surface(const std::vector<Eigen::Vector3d>& vertices_m, const std::vector<std::array<std::uint32_t, 3>>& triangles);

  /// So many of one surface are enough: a smooth one has one near a ball, a crease two, a corner three.
  static constexpr std::size_t kMostMinima = 8;

  /// A place where the distance is smaller than everywhere around it on the surface.
  struct Minimum {
    Eigen::Vector3d point_m = Eigen::Vector3d::Zero();  ///< On the surface, in the body's frame.
    double distance_m = 0.0;                            ///< To the query, ≥ 0: a surface has no inside here.
    std::uint64_t feature = 0;                          ///< Face, edge or corner that it is on; the same in each query.
  };
  /// The minima nearer than `reach_m` to `p`, in no order; the nearest ones where `out` is too short.
  /// @param p In the body's frame. @param reach_m How far from `p`, > 0. @param out Where they go. @returns their
  /// number. @realtime Yes: no allocation; the time grows with the number of triangles within reach.
  [[nodiscard]] std::size_t minima(const Eigen::Vector3d& p, double reach_m, std::span<Minimum> out) const noexcept;

  [[nodiscard]] std::size_t triangle_count() const noexcept { return triangles_.size(); }

 private:
  struct Triangle {
    std::array<Eigen::Vector3d, 3> corner;
    std::array<std::uint32_t, 3> vertex{};
    std::array<std::uint32_t, 3> edge{};  ///< Edge i leads from corner i to corner i + 1.
  };
  /// A leaf has triangles; else the left child is the next node.
  struct Node {
    Eigen::Vector3f low, high;
    std::uint32_t first = 0;  ///< Triangle of a leaf, else the right child.
    std::uint32_t count = 0;  ///< Triangles of a leaf, else 0.
    /// All normals at its vertices are nearer to the axis than that; −1: they are anywhere.
    Eigen::Vector3f axis = Eigen::Vector3f::UnitY();
    float cosine = -1.0F;
  };
  /// Of all faces at a vertex, for the making of a tree: those of i are [first[i], first[i + 1]).
  struct Normals {
    std::vector<std::uint32_t> first;
    std::vector<Eigen::Vector3d> normal;
    std::vector<bool> open;  ///< The vertex is on an edge that does not join two faces, turned alike.
  };
  static constexpr std::size_t kLeaf = 4;

  void find_neighbours(Normals& out);
  void build(std::size_t first, std::size_t count, const Normals& normals);
  void bound_normals(std::size_t first, std::size_t count, const Normals& normals, Node& out) const;
  [[nodiscard]] static bool turns_away(const Node& node, const Eigen::Vector3d& p) noexcept;
  [[nodiscard]] bool is_minimum(const Triangle& triangle, TrianglePart part, const Eigen::Vector3d& way,
                                const Eigen::Vector3d& at) const noexcept;

  std::vector<Node> nodes_;
  std::vector<Triangle> triangles_;  ///< In the order of the leaves.
  std::vector<Eigen::Vector3d> vertices_m_;
  // Of each edge the vertices across it, of each vertex its neighbours: those of i are [first[i], first[i + 1]).
  std::vector<std::uint32_t> across_first_, across_, ring_first_, ring_;
  std::vector<std::array<std::uint32_t, 2>> edge_ends_;
};

}  // namespace rtbus::shapes
