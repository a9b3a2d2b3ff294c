#include "rtbus/shapes/surface.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Geometry>

namespace rtbus::shapes {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

/// What leads this far (as a share of both lengths' product) towards the query leads there; below it is rounding.
constexpr double kRounding = 1e-12;
/// Nodes of more triangles have no bound of their normals: it would hardly be narrow, and it takes time to make.
constexpr std::size_t kBounded = 256;
/// Normals that are farther from an axis leave nothing out.
constexpr double kWide = 0.1;
/// For floats, and for what counts as a minimum within rounding.
constexpr double kCosineMargin = 1e-5;

Vector3d normal_of(const std::array<Vector3d, 3>& corner) {
  return (corner[1] - corner[0]).cross(corner[2] - corner[0]).normalized();
}

Vector3f rounded_down(const Vector3d& v) {
  return v.unaryExpr(
      [](double x) { return std::nextafter(static_cast<float>(x), -std::numeric_limits<float>::infinity()); });
}
Vector3f rounded_up(const Vector3d& v) {
  return v.unaryExpr(
      [](double x) { return std::nextafter(static_cast<float>(x), std::numeric_limits<float>::infinity()); });
}

}  // namespace

bool has_area(const Vector3d& a, const Vector3d& b, const Vector3d& c) noexcept {
  const double longest_m = std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
  return (b - a).cross(c - a).norm() > kRounding * longest_m * longest_m;
}

std::vector<std::uint32_t> joined(const std::vector<Vector3d>& vertices_m) {
  std::vector<std::uint32_t> order(vertices_m.size()), out(vertices_m.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<std::uint32_t>(i);
  const auto less = [&](std::uint32_t a, std::uint32_t b) {
    const Vector3d &u = vertices_m[a], &v = vertices_m[b];
    return std::lexicographical_compare(u.data(), u.data() + 3, v.data(), v.data() + 3) || (u == v && a < b);
  };
  std::sort(order.begin(), order.end(), less);
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool again = i > 0 && vertices_m[order[i]] == vertices_m[order[i - 1]];
    out[order[i]] = again ? out[order[i - 1]] : order[i];
  }
  return out;
}

Vector3d nearest_on_triangle(const Vector3d& p, const std::array<Vector3d, 3>& corner, TrianglePart& part) noexcept {
  const auto& [a, b, c] = corner;
  const auto at_corner = [&](std::uint8_t i) {
    part = {TrianglePart::kCorner, i};
    return corner[i];
  };
  const auto on_edge = [&](std::uint8_t i, double share) {
    part = {TrianglePart::kEdge, i};
    return Vector3d(corner[i] + share * (corner[(i + 1u) % 3u] - corner[i]));
  };
  const Vector3d ab = b - a, ac = c - a, ap = p - a;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0.0 && d2 <= 0.0) return at_corner(0);
  const Vector3d bp = p - b;
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0.0 && d4 <= d3) return at_corner(1);
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) return on_edge(0, d1 / (d1 - d3));
  const Vector3d cp = p - c;
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0.0 && d5 <= d6) return at_corner(2);
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) return on_edge(2, 1.0 - d2 / (d2 - d6));
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0.0 && d4 >= d3 && d5 >= d6) return on_edge(1, (d4 - d3) / ((d4 - d3) + (d5 - d6)));
  const double sum = va + vb + vc;
  if (!(sum > 0.0)) return at_corner(0);
  part = {TrianglePart::kFace, 0};
  return a + ab * (vb / sum) + ac * (vc / sum);
}

Surface::Surface(const std::vector<Vector3d>& vertices_m, const std::vector<std::array<std::uint32_t, 3>>& triangles)
    : vertices_m_(vertices_m) {
  const std::vector<std::uint32_t> same = joined(vertices_m);
  triangles_.reserve(triangles.size());
  for (const auto& indices : triangles) {
    Triangle triangle;
    for (std::size_t i = 0; i < 3; ++i) {
      triangle.vertex[i] = same[indices[i]];
      triangle.corner[i] = vertices_m_[triangle.vertex[i]];
    }
    const auto& [a, b, c] = triangle.corner;
    if (has_area(a, b, c)) triangles_.push_back(triangle);  // else its edges are those of its neighbours
  }
  Normals normals;
  find_neighbours(normals);
  if (!triangles_.empty()) build(0, triangles_.size(), normals);
}

void Surface::find_neighbours(Normals& out) {
  struct Side {
    std::uint32_t low, high, across, triangle, index;
  };
  std::vector<Side> sides;
  sides.reserve(3 * triangles_.size());
  for (std::size_t t = 0; t < triangles_.size(); ++t) {
    for (std::uint32_t i = 0; i < 3; ++i) {
      const auto& vertex = triangles_[t].vertex;
      const auto [low, high] = std::minmax(vertex[i], vertex[(i + 1) % 3]);
      sides.push_back({low, high, vertex[(i + 2) % 3], static_cast<std::uint32_t>(t), i});
    }
  }
  std::sort(sides.begin(), sides.end(),
            [](const Side& a, const Side& b) { return std::pair(a.low, a.high) < std::pair(b.low, b.high); });
  std::vector<std::array<std::uint32_t, 2>> leads;  // from a vertex to a neighbour
  for (std::size_t s = 0; s < sides.size(); ++s) {
    const Side& side = sides[s];
    if (s == 0 || side.low != sides[s - 1].low || side.high != sides[s - 1].high) {
      across_first_.push_back(static_cast<std::uint32_t>(across_.size()));
      edge_ends_.push_back({side.low, side.high});
      leads.push_back({side.low, side.high});
      leads.push_back({side.high, side.low});
    }
    triangles_[side.triangle].edge[side.index] = static_cast<std::uint32_t>(edge_ends_.size() - 1);
    across_.push_back(side.across);
  }
  across_first_.push_back(static_cast<std::uint32_t>(across_.size()));
  out.open.assign(vertices_m_.size(), false);
  for (std::size_t s = 0, end = 0; s < sides.size(); s = end) {
    while (end < sides.size() && sides[end].low == sides[s].low && sides[end].high == sides[s].high) ++end;
    const auto upward = [&](const Side& side) { return triangles_[side.triangle].vertex[side.index] == side.low; };
    if (end - s != 2 || upward(sides[s]) == upward(sides[s + 1])) {
      out.open[sides[s].low] = out.open[sides[s].high] = true;
    }
  }
  out.first.assign(vertices_m_.size() + 1, 0);
  for (const Triangle& triangle : triangles_) {
    for (const std::uint32_t vertex : triangle.vertex) ++out.first[vertex + 1];
  }
  for (std::size_t i = 1; i < out.first.size(); ++i) out.first[i] += out.first[i - 1];
  out.normal.resize(3 * triangles_.size());
  std::vector<std::uint32_t> next(out.first.begin(), out.first.end() - 1);
  for (const Triangle& triangle : triangles_) {
    for (const std::uint32_t vertex : triangle.vertex) out.normal[next[vertex]++] = normal_of(triangle.corner);
  }
  std::sort(leads.begin(), leads.end());
  ring_first_.assign(vertices_m_.size() + 1, 0);
  for (const auto& [from, to] : leads) {
    ++ring_first_[from + 1];
    ring_.push_back(to);
  }
  for (std::size_t i = 1; i < ring_first_.size(); ++i) ring_first_[i] += ring_first_[i - 1];
}

/// Halves the triangles at the median of their centres along the longest side of the box. Recursion: log2(n) deep.
void Surface::build(std::size_t first, std::size_t count, const Normals& normals) {
  const auto begin = triangles_.begin() + static_cast<std::ptrdiff_t>(first);
  const auto end = begin + static_cast<std::ptrdiff_t>(count);
  Vector3d low = begin->corner[0], high = low;
  for (auto each = begin; each != end; ++each) {
    for (const Vector3d& corner : each->corner) {
      low = low.cwiseMin(corner);
      high = high.cwiseMax(corner);
    }
  }
  const std::size_t node = nodes_.size();
  nodes_.push_back({rounded_down(low), rounded_up(high), static_cast<std::uint32_t>(first),
                    count <= kLeaf ? static_cast<std::uint32_t>(count) : 0u});
  if (count <= kBounded) bound_normals(first, count, normals, nodes_[node]);
  if (count <= kLeaf) return;
  Eigen::Index axis = 0;
  (void)(high - low).maxCoeff(&axis);
  const auto centre = [axis](const Triangle& t) { return t.corner[0][axis] + t.corner[1][axis] + t.corner[2][axis]; };
  const std::size_t half = count / 2;
  std::nth_element(begin, begin + static_cast<std::ptrdiff_t>(half), end,
                   [&](const Triangle& a, const Triangle& b) { return centre(a) < centre(b); });
  build(first, half, normals);
  nodes_[node].first = static_cast<std::uint32_t>(nodes_.size());
  build(first + half, count - half, normals);
}

void Surface::bound_normals(std::size_t first, std::size_t count, const Normals& normals, Node& out) const {
  Vector3d sum = Vector3d::Zero();
  for (std::size_t i = first; i < first + count; ++i) sum += normal_of(triangles_[i].corner);
  if (sum.norm() <= kRounding) return;
  const Vector3f axis = sum.normalized().cast<float>();
  double least = 1.0;
  for (std::size_t i = first; i < first + count; ++i) {
    for (const std::uint32_t vertex : triangles_[i].vertex) {
      if (normals.open[vertex]) return;
      for (std::uint32_t k = normals.first[vertex]; k < normals.first[vertex + 1]; ++k) {
        least = std::min(least, axis.cast<double>().dot(normals.normal[k]));
      }
    }
  }
  if (least < kWide) return;
  out.axis = axis;
  out.cosine = static_cast<float>(least - kCosineMargin);
}

/// Whether no point of the node is a minimum: D. E. Johnson, E. Cohen, "Spatialized normal cone hierarchies", I3D 2001.
/// The way from a minimum to the query is a mean of the normals that meet there. This holds where the faces around a
/// vertex are a graph over some plane, closed around it; else the node has no bound.
bool Surface::turns_away(const Node& node, const Vector3d& p) noexcept {
  if (node.cosine < 0.0F) return false;
  const Vector3d low = node.low.cast<double>(), high = node.high.cast<double>();
  const Vector3d way = p - 0.5 * (low + high);
  const double square = way.squaredNorm(), spread = 0.25 * (high - low).squaredNorm() / square;
  const double cosine = static_cast<double>(node.cosine);
  if (spread >= 1.0) return false;
  // The cosine of both half angles together; beyond 90 degrees they leave nothing out.
  const double both = cosine * std::sqrt(1.0 - spread) - std::sqrt((1.0 - cosine * cosine) * spread);
  return both > 0.0 && std::abs(node.axis.cast<double>().dot(way)) < both * std::sqrt(square);
}

/// @param way From `at`, which is on that part of the triangle, to the query. No neighbour leads nearer to it.
bool Surface::is_minimum(const Triangle& triangle, TrianglePart part, const Vector3d& way,
                         const Vector3d& at) const noexcept {
  const double length = way.norm();
  if (part.kind == TrianglePart::kFace) return true;
  if (part.kind == TrianglePart::kCorner) {
    const std::uint32_t vertex = triangle.vertex[part.index];
    for (std::uint32_t i = ring_first_[vertex]; i < ring_first_[vertex + 1]; ++i) {
      const Vector3d along = vertices_m_[ring_[i]] - at;
      if (along.dot(way) > kRounding * along.norm() * length) return false;
    }
    return true;
  }
  const std::uint32_t edge = triangle.edge[part.index];
  const Vector3d& start = vertices_m_[edge_ends_[edge][0]];
  const Vector3d along = (vertices_m_[edge_ends_[edge][1]] - start).normalized();
  for (std::uint32_t i = across_first_[edge]; i < across_first_[edge + 1]; ++i) {
    const Vector3d to = vertices_m_[across_[i]] - start;
    const Vector3d into = to - along.dot(to) * along;
    if (into.dot(way) > kRounding * into.norm() * length) return false;
  }
  return true;
}

std::size_t Surface::minima(const Vector3d& p, double reach_m, std::span<Minimum> out) const noexcept {
  if (nodes_.empty() || out.empty()) return 0;
  std::size_t found = 0;
  double reach = reach_m;  // less once `out` is full
  const auto keep = [&](const Minimum& minimum) {
    for (std::size_t i = 0; i < found; ++i) {
      if (out[i].feature == minimum.feature) return;
    }
    if (found < out.size()) {
      out[found++] = minimum;
    } else {
      *std::max_element(out.begin(), out.end(),
                        [](const Minimum& a, const Minimum& b) { return a.distance_m < b.distance_m; }) = minimum;
    }
    if (found < out.size()) return;
    reach = 0.0;
    for (const Minimum& each : out) reach = std::max(reach, each.distance_m);
  };
  std::array<std::uint32_t, 64> stack;  // halves: depth 21 for the most triangles
  std::size_t height = 0;
  stack[height++] = 0;
  while (height > 0) {
    const std::uint32_t index = stack[--height];
    const Node& node = nodes_[index];
    const Vector3d outside =
        (node.low.cast<double>() - p).cwiseMax(p - node.high.cast<double>()).cwiseMax(Vector3d::Zero());
    if (outside.squaredNorm() > reach * reach || turns_away(node, p)) continue;
    if (node.count == 0) {
      stack[height++] = node.first;
      stack[height++] = index + 1;
      continue;
    }
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      const Triangle& triangle = triangles_[i];
      TrianglePart part;
      const Vector3d at = nearest_on_triangle(p, triangle.corner, part);
      const Vector3d way = p - at;
      if (way.squaredNorm() >= reach * reach || !is_minimum(triangle, part, way, at)) continue;
      const std::uint64_t id = part.kind == TrianglePart::kFace   ? i
                               : part.kind == TrianglePart::kEdge ? triangle.edge[part.index]
                                                                  : triangle.vertex[part.index];
      keep({at, way.norm(), (static_cast<std::uint64_t>(part.kind) << 32) | id});
    }
  }
  return found;
}

}  // namespace rtbus::shapes
