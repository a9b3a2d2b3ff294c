#include "rtbus/shapes/face_points.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <variant>

namespace rtbus::shapes {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kFacing = 0.95;  // cosine

/// A rectangle, or a plane without edges.
struct Face {
  Vector3d normal, centre_m;
  Vector3d u = Vector3d::UnitX(), v = Vector3d::UnitZ();  ///< Unit, along the edges.
  double half_u_m = std::numeric_limits<double>::infinity(), half_v_m = half_u_m;
};

/// The face of a box that looks most along `direction` of W.
Face face_of(const Box& box, const Quaterniond& q_WB, const Vector3d& p_WB, const Vector3d& direction) noexcept {
  const Vector3d local = q_WB.conjugate() * direction;
  Eigen::Index axis = 0;
  local.cwiseAbs().maxCoeff(&axis);
  const Eigen::Index next = (axis + 1) % 3, last = (axis + 2) % 3;
  Face out;
  out.normal = q_WB * Vector3d((local[axis] < 0.0 ? -1.0 : 1.0) * Vector3d::Unit(axis));
  out.centre_m = p_WB + box.half_size_m[axis] * out.normal;
  out.u = q_WB * Vector3d(Vector3d::Unit(next));
  out.v = q_WB * Vector3d(Vector3d::Unit(last));
  out.half_u_m = box.half_size_m[next];
  out.half_v_m = box.half_size_m[last];
  return out;
}

bool holding_face(const PlacedShape& holder, const Vector3d& toward, Face& out) noexcept {
  if (std::holds_alternative<Plane>(holder.shape)) {
    out.normal = holder.q_WB * Vector3d(Vector3d::UnitY());
    out.centre_m = holder.p_WB;
    out.u = holder.q_WB * Vector3d(Vector3d::UnitX());
    out.v = holder.q_WB * Vector3d(Vector3d::UnitZ());
  } else if (const auto* const box = std::get_if<Box>(&holder.shape)) {
    out = face_of(*box, holder.q_WB, holder.p_WB, toward);
  } else {
    return false;
  }
  return out.normal.dot(toward) >= kFacing;
}

/// I. E. Sutherland, G. W. Hodgman, "Reentrant polygon clipping", CACM 17(1), 1974: a convex polygon, one edge of the
/// clipping rectangle after the other.
struct Polygon {
  static constexpr std::size_t kMost = 8;  ///< Each of four edges adds one corner at most.
  std::array<Vector3d, kMost> corner_m{};
  std::size_t count = 0;

  void cut(const Vector3d& outward, double reach_m) noexcept {
    std::array<Vector3d, kMost> kept{};
    std::size_t n = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const Vector3d &from = corner_m[i], &to = corner_m[(i + 1) % count];
      const double before = outward.dot(from) - reach_m, after = outward.dot(to) - reach_m;
      if (before <= 0.0 && n < kMost) kept[n++] = from;
      if ((before < 0.0 && after > 0.0) || (before > 0.0 && after < 0.0)) {
        if (n < kMost) kept[n++] = from + before / (before - after) * (to - from);
      }
    }
    corner_m = kept;
    count = n;
  }
};

}  // namespace

bool face_points(const Box& held, const Quaterniond& q_WB, const Vector3d& p_WB, const PlacedShape& holder,
                 const Vector3d& toward, FacePoints& out) noexcept {
  out.count = 0;
  Face holding;
  if (!holding_face(holder, toward, holding)) return false;
  out.normal = holding.normal;
  const Face face = face_of(held, q_WB, p_WB, -holding.normal);
  Polygon polygon;
  const Vector3d along_u = face.half_u_m * face.u, along_v = face.half_v_m * face.v;
  polygon.corner_m = {face.centre_m + along_u + along_v, face.centre_m + along_u - along_v,
                      face.centre_m - along_u - along_v, face.centre_m - along_u + along_v};
  polygon.count = 4;
  if (std::isfinite(holding.half_u_m)) {
    const double u_m = holding.u.dot(holding.centre_m), v_m = holding.v.dot(holding.centre_m);
    polygon.cut(holding.u, u_m + holding.half_u_m);
    polygon.cut(-holding.u, holding.half_u_m - u_m);
    polygon.cut(holding.v, v_m + holding.half_v_m);
    polygon.cut(-holding.v, holding.half_v_m - v_m);
  }
  const auto add = [&](std::size_t corner) {
    out.point_m[out.count] = polygon.corner_m[corner];
    out.gap_m[out.count++] = holding.normal.dot(polygon.corner_m[corner] - holding.centre_m);
  };
  if (polygon.count <= FacePoints::kMost) {
    for (std::size_t i = 0; i < polygon.count; ++i) add(i);
    return true;
  }
  const Vector3d diagonals[] = {holding.u + holding.v, holding.u - holding.v, -holding.u - holding.v,
                                holding.v - holding.u};
  for (const Vector3d& way : diagonals) {
    std::size_t far = 0;
    for (std::size_t i = 1; i < polygon.count; ++i) {
      if (way.dot(polygon.corner_m[i] - polygon.corner_m[far]) > 0.0) far = i;
    }
    add(far);
  }
  return true;
}

}  // namespace rtbus::shapes
