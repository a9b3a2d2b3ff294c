#include "rtbus/shapes/face_points.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numbers>
#include <variant>

namespace rtbus::shapes {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

/// A face of the held box, or two edges, are the contact only where they are farther apart than a face of the holder by
/// this: which of two equal ones it is must not change from step to step.
constexpr double kFarther_m = 1e-5;
/// Edges that are nearer to parallel than this sine have no plane of their own.
constexpr double kParallel = 0.05;
/// Nor have edges whose plane is nearer to the face's than this cosine: the corners of the face say as much, and hold
/// the box at both ends.
constexpr double kSamePlane = 0.95;
/// A cylinder that leans by less (a sine) stands upright.
constexpr double kLeans = 2e-4;
/// Corners of a rim, cut off or not.
constexpr std::size_t kRim = 8;
/// Where a rim is cut off, it has corners at both ends of the cut, however short that is.
constexpr double kAlongCut = 0.3;

/// A box as three axes.
struct Axes {
  Vector3d centre_m;
  std::array<Vector3d, 3> axis;
  Vector3d half_m;

  Axes(const Box& box, const Quaterniond& q_WB, const Vector3d& p_WB) noexcept
      : centre_m(p_WB), half_m(box.half_size_m) {
    const Eigen::Matrix3d R = q_WB.toRotationMatrix();
    axis = {R.col(0), R.col(1), R.col(2)};
  }
  /// From the centre to the farthest point that way.
  [[nodiscard]] double reach_m(const Vector3d& way) const noexcept {
    double out = 0.0;
    for (std::size_t i = 0; i < 3; ++i) out += half_m[static_cast<Eigen::Index>(i)] * std::abs(axis[i].dot(way));
    return out;
  }
  /// That point; of an edge along axis `middle` its middle.
  [[nodiscard]] Vector3d farthest_m(const Vector3d& way, std::size_t middle) const noexcept {
    Vector3d out = centre_m;
    for (std::size_t i = 0; i < 3; ++i) {
      if (i == middle) continue;
      out += (axis[i].dot(way) < 0.0 ? -1.0 : 1.0) * half_m[static_cast<Eigen::Index>(i)] * axis[i];
    }
    return out;
  }
};

/// The face of a box that looks most along `direction`.
Face face_of(const Axes& box, const Vector3d& direction) noexcept {
  std::size_t axis = 0;
  for (std::size_t i = 1; i < 3; ++i) {
    if (std::abs(box.axis[i].dot(direction)) > std::abs(box.axis[axis].dot(direction))) axis = i;
  }
  const std::size_t next = (axis + 1) % 3, last = (axis + 2) % 3;
  Face out;
  out.normal = (box.axis[axis].dot(direction) < 0.0 ? -1.0 : 1.0) * box.axis[axis];
  out.centre_m = box.centre_m + box.half_m[static_cast<Eigen::Index>(axis)] * out.normal;
  out.u = box.axis[next];
  out.v = box.axis[last];
  out.half_u_m = box.half_m[static_cast<Eigen::Index>(next)];
  out.half_v_m = box.half_m[static_cast<Eigen::Index>(last)];
  return out;
}

Face plane_of(const PlacedShape& holder) noexcept {
  const Eigen::Matrix3d R = holder.q_WB.toRotationMatrix();
  Face out;
  out.normal = R.col(1);
  out.centre_m = holder.p_WB;
  out.u = R.col(0);
  out.v = R.col(2);
  return out;
}

/// I. E. Sutherland, G. W. Hodgman, "Reentrant polygon clipping", CACM 17(1), 1974: a convex polygon, one edge of the
/// clipping rectangle after the other.
struct Polygon {
  static constexpr std::size_t kMost = kRim + 4;  ///< Each of four edges adds one corner at most.
  std::array<Vector3d, kMost> corner_m{};
  std::size_t count = 0;

  /// @returns whether something is off.
  bool cut(const Vector3d& outward, double reach_m) noexcept {
    std::array<Vector3d, kMost> kept{};
    std::size_t n = 0;
    bool off = false;
    for (std::size_t i = 0; i < count; ++i) {
      const Vector3d &from = corner_m[i], &to = corner_m[(i + 1) % count];
      const double before = outward.dot(from) - reach_m, after = outward.dot(to) - reach_m;
      if (before <= 0.0 && n < kMost) kept[n++] = from;
      off = off || before > 0.0;
      if ((before < 0.0 && after > 0.0) || (before > 0.0 && after < 0.0)) {
        if (n < kMost) kept[n++] = from + before / (before - after) * (to - from);
      }
    }
    corner_m = kept;
    count = n;
    return off;
  }
  /// At the edges of the face. @returns an edge that something was beyond, as its outward way; zero: nothing.
  Vector3d cut(const Face& face) noexcept {
    Vector3d out = Vector3d::Zero();
    if (!std::isfinite(face.half_u_m)) return out;
    const double u_m = face.u.dot(face.centre_m), v_m = face.v.dot(face.centre_m);
    if (cut(face.u, u_m + face.half_u_m)) out = face.u;
    if (cut(-face.u, face.half_u_m - u_m)) out = -face.u;
    if (cut(face.v, v_m + face.half_v_m)) out = face.v;
    if (cut(-face.v, face.half_v_m - v_m)) out = -face.v;
    return out;
  }
  /// The corner that is farthest that way.
  [[nodiscard]] std::size_t farthest(const Vector3d& way) const noexcept {
    std::size_t far = 0;
    for (std::size_t i = 1; i < count; ++i) {
      if (way.dot(corner_m[i] - corner_m[far]) > 0.0) far = i;
    }
    return far;
  }
};

/// A corner, and how far it is from the plane of `face`. @param of_held `face` is the held box's.
void add_point(const Face& face, const Vector3d& corner_m, bool of_held, FacePoints& out) noexcept {
  const double gap_m = face.normal.dot(corner_m - face.centre_m);
  out.point_m[out.count] = corner_m;
  if (of_held) out.point_m[out.count] -= gap_m * face.normal;
  out.gap_m[out.count++] = gap_m;
}

/// What of `other`, cut off at the edges of `face`, is how far from its plane. @param of_held `face` is the held box's.
void add_points(const Face& face, const Face& other, bool of_held, FacePoints& out) noexcept {
  Polygon polygon;
  const Vector3d along_u = other.half_u_m * other.u, along_v = other.half_v_m * other.v;
  polygon.corner_m = {other.centre_m + along_u + along_v, other.centre_m + along_u - along_v,
                      other.centre_m - along_u - along_v, other.centre_m - along_u + along_v};
  polygon.count = 4;
  (void)polygon.cut(face);
  out.normal = of_held ? Vector3d(-face.normal) : face.normal;
  if (polygon.count <= FacePoints::kMost) {
    for (std::size_t i = 0; i < polygon.count; ++i) add_point(face, polygon.corner_m[i], of_held, out);
    return;
  }
  for (const Vector3d& way :
       {Vector3d(face.u + face.v), Vector3d(face.u - face.v), Vector3d(-face.u - face.v), Vector3d(face.v - face.u)}) {
    add_point(face, polygon.corner_m[polygon.farthest(way)], of_held, out);
  }
}

/// A way between two boxes, from the holder to the held one, and how far apart they are along it.
struct Way {
  Vector3d normal = Vector3d::UnitY();
  double apart_m = -std::numeric_limits<double>::infinity();
};

Way way_along(const Vector3d& axis, const Axes& held, const Axes& holder) noexcept {
  const Vector3d between_m = held.centre_m - holder.centre_m;
  const Vector3d normal = between_m.dot(axis) < 0.0 ? Vector3d(-axis) : axis;
  return {normal, between_m.dot(normal) - held.reach_m(normal) - holder.reach_m(normal)};
}

/// The face from which the cylinder is farthest.
Face nearest_face(const Axes& box, const Cylinder& held, const Vector3d& axis, const Vector3d& p_WB) noexcept {
  Vector3d best = box.axis[0];
  double best_m = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < 3; ++i) {
    const double along = box.axis[i].dot(axis), between_m = box.axis[i].dot(p_WB - box.centre_m);
    const double reach_m =
        0.5 * held.length_m * std::abs(along) + held.radius_m * std::sqrt(std::max(0.0, 1.0 - along * along));
    const double apart_m = std::abs(between_m) - box.half_m[static_cast<Eigen::Index>(i)] - reach_m;
    if (apart_m <= best_m) continue;
    best_m = apart_m;
    best = between_m < 0.0 ? Vector3d(-box.axis[i]) : box.axis[i];
  }
  return face_of(box, best);
}

Way farthest_face(const Axes& box, const Axes& held, const Axes& holder) noexcept {
  Way out;
  for (const Vector3d& axis : box.axis) {
    const Way way = way_along(axis, held, holder);
    if (way.apart_m > out.apart_m) out = way;
  }
  return out;
}

/// Where an edge of each crosses the other, if they are farthest apart there. @returns whether they are.
bool add_crossing(const Axes& held, const Axes& holder, const Way& face, FacePoints& out) noexcept {
  Way best{face.normal, face.apart_m + kFarther_m};
  std::size_t of_held = 0, of_holder = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Vector3d cross = held.axis[i].cross(holder.axis[k]);
      const double sine = cross.norm();
      if (sine < kParallel) continue;
      const Way way = way_along(cross / sine, held, holder);
      if (way.apart_m <= best.apart_m) continue;
      best = way;
      of_held = i;
      of_holder = k;
    }
  }
  if (best.normal.dot(face.normal) > kSamePlane) return false;
  const Vector3d on_held_m = held.farthest_m(-best.normal, of_held);
  const Vector3d on_holder_m = holder.farthest_m(best.normal, of_holder);
  // The point of the held edge that is nearest to the line of the other one.
  const Vector3d& along = held.axis[of_held];
  const Vector3d across = best.normal.cross(holder.axis[of_holder]);
  const double far_m = across.dot(on_holder_m - on_held_m) / across.dot(along);
  const double half_m = held.half_m[static_cast<Eigen::Index>(of_held)];
  out.normal = best.normal;
  out.point_m[0] = on_held_m + std::clamp(far_m, -half_m, half_m) * along;
  out.gap_m[0] = best.apart_m;
  out.count = 1;
  return true;
}

}  // namespace

std::optional<Face> face_along(const PlacedShape& holder, const Vector3d& direction) noexcept {
  if (std::holds_alternative<Plane>(holder.shape)) return plane_of(holder);
  const auto* const box = std::get_if<Box>(&holder.shape);
  if (box == nullptr) return std::nullopt;
  return face_of(Axes(*box, holder.q_WB, holder.p_WB), direction);
}

std::optional<Face> face_towards(const PlacedShape& holder, const Vector3d& point_m) noexcept {
  const auto* const box = std::get_if<Box>(&holder.shape);
  if (box == nullptr) return face_along(holder, Vector3d::UnitY());
  const Axes axes(*box, holder.q_WB, holder.p_WB);
  const Vector3d from_m = point_m - holder.p_WB;
  Vector3d best = axes.axis[0];
  double best_m = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < 3; ++i) {
    const double along_m = axes.axis[i].dot(from_m);
    const double beyond_m = std::abs(along_m) - axes.half_m[static_cast<Eigen::Index>(i)];
    if (beyond_m <= best_m) continue;
    best_m = beyond_m;
    best = along_m < 0.0 ? Vector3d(-axes.axis[i]) : axes.axis[i];
  }
  return face_of(axes, best);
}

bool face_points(const Box& held, const Quaterniond& q_WB, const Vector3d& p_WB, const PlacedShape& holder,
                 FacePoints& out) noexcept {
  out.count = 0;
  if (std::holds_alternative<Plane>(holder.shape)) {
    face_points(held, q_WB, p_WB, plane_of(holder), out);
    return true;
  }
  const Axes box(held, q_WB, p_WB);
  const auto* const below = std::get_if<Box>(&holder.shape);
  if (below == nullptr) return false;
  const Axes holding(*below, holder.q_WB, holder.p_WB);
  const Way by_holder = farthest_face(holding, box, holding), by_held = farthest_face(box, box, holding);
  const bool of_held = by_held.apart_m > by_holder.apart_m + kFarther_m;
  const Way& way = of_held ? by_held : by_holder;
  if (add_crossing(box, holding, way, out)) return true;
  const Face below_face = face_of(holding, way.normal), box_face = face_of(box, -way.normal);
  if (of_held) {
    add_points(box_face, below_face, true, out);
  } else {
    add_points(below_face, box_face, false, out);
  }
  return true;
}

void face_points(const Box& held, const Quaterniond& q_WB, const Vector3d& p_WB, const Face& face,
                 FacePoints& out) noexcept {
  out.count = 0;
  add_points(face, face_of(Axes(held, q_WB, p_WB), -face.normal), false, out);
}

bool face_points(const Cylinder& held, const Quaterniond& q_WB, const Vector3d& p_WB, const PlacedShape& holder,
                 const Vector3d& way_W, FacePoints& out) noexcept {
  out.count = 0;
  if (std::holds_alternative<Plane>(holder.shape)) {
    face_points(held, q_WB, p_WB, plane_of(holder), way_W, out);
  } else if (const auto* const below = std::get_if<Box>(&holder.shape)) {
    const Vector3d axis = q_WB * Vector3d(Vector3d::UnitY());
    face_points(held, q_WB, p_WB, nearest_face(Axes(*below, holder.q_WB, holder.p_WB), held, axis, p_WB), way_W, out);
  } else {
    return false;
  }
  return true;
}

void face_points(const Cylinder& held, const Quaterniond& q_WB, const Vector3d& p_WB, const Face& face,
                 const Vector3d& way_W, FacePoints& out) noexcept {
  out.count = 0;
  const Vector3d axis = q_WB * Vector3d(Vector3d::UnitY());
  const Vector3d down = axis.dot(face.normal) > 0.0 ? Vector3d(-axis) : axis;
  const auto across = [&](const Vector3d& way) { return Vector3d(way - down.dot(way) * down); };
  Vector3d ahead = across(-face.normal);
  if (ahead.norm() < kLeans) ahead = across(way_W);
  ahead = ahead.norm() > 1e-9 * way_W.norm() ? ahead.normalized() : down.unitOrthogonal();
  const Vector3d cap_m = p_WB + 0.5 * held.length_m * down;
  const Vector3d to_front_m = held.radius_m * ahead, to_side_m = held.radius_m * down.cross(ahead);
  Polygon rim;
  for (std::size_t i = 0; i < kRim; ++i) {
    const double angle = 2.0 * std::numbers::pi * static_cast<double>(i) / kRim;
    rim.corner_m[rim.count++] = cap_m + std::cos(angle) * to_front_m + std::sin(angle) * to_side_m;
  }
  out.normal = face.normal;
  const Vector3d edge = rim.cut(face);
  if (edge.isZero(0.0)) {
    for (std::size_t i = 0; i < kRim; i += kRim / FacePoints::kMost) add_point(face, rim.corner_m[i], false, out);
    return;
  }
  const Vector3d along = face.normal.cross(edge);
  for (const Vector3d& way : {Vector3d(edge + kAlongCut * along), Vector3d(edge - kAlongCut * along),
                              Vector3d(-edge - along), Vector3d(along - edge)}) {
    if (rim.count > 0) add_point(face, rim.corner_m[rim.farthest(way)], false, out);
  }
}

}  // namespace rtbus::shapes
