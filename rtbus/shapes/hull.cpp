#include "rtbus/shapes/hull.hpp"

#include <algorithm>

#include <Eigen/Dense>

namespace rtbus::shapes {
namespace {

using Eigen::Vector3d;
using Weights = std::array<double, 4>;

constexpr int kMostSteps = 64;        ///< More than any query of 256 points has been seen to need.
constexpr double kRelative = 1e-14;   ///< Of squared lengths: gains below it are rounding.
constexpr double kInside = 1e-24;     ///< Likewise: a distance of 1e-12 of the size is none.
constexpr double kDependent = 1e-12;  ///< Smallest pivot over the largest of points that span something.

/// A simplex of at most four points of the hull, less the query, and the weights of its point nearest to the origin.
struct Simplex {
  std::array<Vector3d, 4> vertex;
  std::array<std::uint32_t, 4> index{};
  Weights weight{};
  std::size_t count = 0;

  void add(std::uint32_t point, const Vector3d& at) {
    index[count] = point;
    weight[count] = 0.0;
    vertex[count++] = at;
  }
  void drop(std::size_t i) {
    --count;
    for (; i < count; ++i) {
      vertex[i] = vertex[i + 1];
      index[i] = index[i + 1];
      weight[i] = weight[i + 1];
    }
  }
  [[nodiscard]] Vector3d nearest() const {
    Vector3d out = Vector3d::Zero();
    for (std::size_t i = 0; i < count; ++i) out += weight[i] * vertex[i];
    return out;
  }
};

/// Weights of the point nearest to the origin in the plane, line or point through all vertices; may be negative.
/// @returns false where the vertices do not span it.
bool affine_weights(const Simplex& simplex, Weights& out) {
  out = {1.0};
  if (simplex.count < 2) return simplex.count == 1;
  using Edges = Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 3>;
  const auto edges_count = static_cast<Eigen::Index>(simplex.count - 1);
  Edges edges(3, edges_count);
  for (Eigen::Index i = 0; i < edges_count; ++i) {
    edges.col(i) = simplex.vertex[static_cast<std::size_t>(i) + 1] - simplex.vertex[0];
  }
  const Eigen::ColPivHouseholderQR<Edges> qr(edges);
  const auto pivots = qr.matrixQR().diagonal().cwiseAbs();
  if (!(pivots.minCoeff() > kDependent * pivots.maxCoeff())) return false;
  const Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 3, 1> share = qr.solve(-simplex.vertex[0]);
  for (Eigen::Index i = 0; i < edges_count; ++i) {
    out[static_cast<std::size_t>(i) + 1] = share[i];
    out[0] -= share[i];
  }
  return true;
}

/// Moves the weights to the nearest point of the simplex itself, and drops the vertices that do not carry it.
bool reduce(Simplex& simplex) {
  while (simplex.count > 0) {
    Weights goal{};
    if (!affine_weights(simplex, goal)) return false;
    double step = 1.0;
    std::size_t first = simplex.count;
    for (std::size_t i = 0; i < simplex.count; ++i) {
      if (goal[i] > 0.0) continue;
      const double part = simplex.weight[i] / (simplex.weight[i] - goal[i]);
      if (first == simplex.count || !(part >= step)) {
        step = simplex.weight[i] > 0.0 ? part : 0.0;
        first = i;
      }
    }
    if (first == simplex.count) {
      simplex.weight = goal;
      return true;
    }
    for (std::size_t i = 0; i < simplex.count; ++i) simplex.weight[i] += step * (goal[i] - simplex.weight[i]);
    simplex.drop(first);
  }
  return false;
}

/// The vertices of the last query, where its nearest point still is one of theirs; else nothing.
void begin(const Hull& hull, const Vector3d& p, const NearestFeature& feature, Simplex& out) {
  out.count = 0;
  for (std::size_t i = 0; i < std::min<std::size_t>(feature.count, 4); ++i) {
    if (feature.points[i] < hull.points_m.size()) out.add(feature.points[i], hull.points_m[feature.points[i]] - p);
  }
  Weights weights{};
  const bool spans = out.count > 0 && affine_weights(out, weights);
  const auto end = weights.begin() + static_cast<std::ptrdiff_t>(out.count);
  if (!spans || std::any_of(weights.begin(), end, [](double weight) { return weight <= 0.0; })) {
    out.count = 0;
  } else {
    out.weight = weights;
  }
}

}  // namespace

bool nearest_point(const Hull& hull, const Vector3d& p, NearestFeature& feature, Vector3d& out_m) noexcept {
  if (hull.points_m.empty()) return false;
  Simplex simplex;
  begin(hull, p, feature, simplex);
  if (simplex.count == 0) {
    simplex.add(0, hull.points_m[0] - p);
    simplex.weight[0] = 1.0;
  }
  Vector3d x = simplex.nearest();
  double size = 0.0;
  for (int step = 0; step < kMostSteps; ++step) {
    std::uint32_t best = 0;
    double least = 0.0;
    for (std::uint32_t i = 0; i < hull.points_m.size(); ++i) {
      const Vector3d at = hull.points_m[i] - p;
      const double along = x.dot(at);
      if (step == 0) size = std::max(size, at.squaredNorm());
      if (i == 0 || along < least) {
        least = along;
        best = i;
      }
    }
    if (x.squaredNorm() <= kInside * size) return false;
    if (x.squaredNorm() - least <= kRelative * size || simplex.count == 4) break;
    const auto used = simplex.index.begin() + static_cast<std::ptrdiff_t>(simplex.count);
    if (std::find(simplex.index.begin(), used, best) != used) break;
    const Simplex before = simplex;
    simplex.add(best, hull.points_m[best] - p);
    if (!reduce(simplex)) {  // the new point adds nothing but rounding
      simplex = before;
      break;
    }
    x = simplex.nearest();
  }
  if (x.squaredNorm() <= kInside * size || simplex.count == 4) return false;
  feature.points = simplex.index;
  feature.count = static_cast<std::uint32_t>(simplex.count);
  out_m = p + x;
  return true;
}

}  // namespace rtbus::shapes
