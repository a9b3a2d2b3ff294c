#include "haptic_node/rendering/corner_supports.hpp"

#include <algorithm>
#include <utility>
#include <variant>

#include "haptic_node/rendering/load_shares.hpp"

namespace haptic {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;
using rtbus::shapes::FacePoints;

/// A corner that is not there does not touch.
constexpr double kFar_m = 1.0;
/// Physics lets bodies that touch each other, and what stands on a rim, tilt by so much, and takes that back in its
/// next steps: there their corners touch. To fall by 5 um within a tick is 5 mm/s, which each answer takes back, and a
/// hand would be dragged down by it. A hull that rolls from facet to facet is not held up so.
constexpr double kTilts_m = 20e-6;
/// Walls that are so near are known before physics tells that they hold the box: at 0.1 m/s for 0.1 s.
constexpr double kBefore_m = 10e-3;
/// A step that is lower is none: bodies sink in, and tilt, by less.
constexpr double kSeam_m = 1e-3;
/// Where the load of a cylinder that stands is so far from its axis, in radii, it would tip that way.
constexpr double kOffMiddle = 0.05;

/// A body that stands on a patch has so many corners there.
constexpr std::size_t kPatchCorners = 3;

/// @returns the least gap; none: there is no corner.
double nearest_m(const FacePoints& corners, double none_m) noexcept {
  const auto end = corners.gap_m.begin() + static_cast<std::ptrdiff_t>(corners.count);
  return corners.count > 0 ? *std::min_element(corners.gap_m.begin(), end) : none_m;
}

/// Places of a face's corners among its rows.
using Places = std::array<std::size_t, CornerSupports::kCorners>;

/// Each corner keeps the row that it had: the one that was nearest. What it bore is there.
/// @param rows Of the face, kCorners.
Places places_of(const FacePoints& corners, const Vector3d& centre_m, std::span<const Support> rows) noexcept {
  Places out{};
  std::array<bool, CornerSupports::kCorners> taken{};
  for (std::size_t k = 0; k < corners.count; ++k) {
    std::size_t best = rows.size();
    double best_m2 = 0.0;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (taken[i]) continue;
      const double away_m2 = (corners.point_m[k] - centre_m - rows[i].from_centre_m).squaredNorm();
      if (best < rows.size() && !(away_m2 < best_m2)) continue;
      best = i;
      best_m2 = away_m2;
    }
    taken[best] = true;
    out[k] = best;
  }
  return out;
}

/// @returns whether all that `corners` says lies in the plane of `face`: where two tables meet, the side of the one
/// that comes is no wall.
bool is_seam(const FacePoints& corners, const FacePoints& face) noexcept {
  const auto end = corners.point_m.begin() + static_cast<std::ptrdiff_t>(corners.count);
  return face.count > 0 && std::all_of(corners.point_m.begin(), end, [&](const Vector3d& point_m) {
           return std::abs(face.normal.dot(point_m - face.point_m[0])) < kSeam_m;
         });
}

}  // namespace

void CornerSupports::be(const rtbus::shapes::KnownShape* shape, const Vector3d& origin_B_m) noexcept {
  box_ = shape != nullptr ? std::get_if<rtbus::shapes::Box>(&shape->shape) : nullptr;
  hull_ = shape != nullptr ? std::get_if<rtbus::shapes::Hull>(&shape->shape) : nullptr;
  cylinder_ = shape != nullptr ? std::get_if<rtbus::shapes::Cylinder>(&shape->shape) : nullptr;
  origin_B_m_ = origin_B_m;
}

std::span<const Support> CornerSupports::leave(const SupportPool& old) noexcept {
  return {old.rows.data() + first_, std::exchange(lies_, false) ? kCorners * face_count_ : 0};
}

bool CornerSupports::lie_down(const ToldBody& body, const SinceAnswer& since, const BodyMotion& motion,
                              std::span<const Support> before, std::size_t first, SupportPool& supports) noexcept {
  if (box_ == nullptr && hull_ == nullptr && cylinder_ == nullptr) return false;
  if (cylinder_ != nullptr && !stands_upright(motion, first, supports)) return false;
  std::array<Support, kFaces> held;
  std::array<FacePoints, kFaces> found;
  const std::array<Face, kFaces> faces_before = faces_;
  face_count_ = 0;
  for (std::size_t i = first; i < supports.count; ++i) {
    const Support& told = supports.rows[i];
    Face holds;
    FacePoints corners;
    if (!find_holder(body, since, motion, told, holds, corners)) return false;
    holds.normal = corners.normal;
    std::size_t face = 0;
    while (face < face_count_ && !faces_[face].is_of(holds)) ++face;
    if (face < face_count_) {
      const double both_n = held[face].force_n + told.force_n;
      const double share = both_n > 0.0 ? told.force_n / both_n : 0.0;
      held[face].from_centre_m += share * (told.from_centre_m - held[face].from_centre_m);
      held[face].force_n = both_n;
      continue;
    }
    if (face_count_ == kFaces) return false;
    held[face] = told;
    found[face] = corners;
    faces_[face_count_] = holds;
    faces_[face_count_++].rest_gap_m.fill(nearest_m(corners, 0.0));
  }
  const std::size_t told_count = supports.count - first;
  const std::size_t most_faces = (told_count + supports.spare) / kCorners;
  add_walls(since, motion, supports.rows[first].friction, most_faces, held, found);
  add_near_bodies(body, since, motion, most_faces, held, found);
  const std::size_t rows = kCorners * face_count_;
  const std::size_t more = rows - std::min(told_count, rows);
  if (supports.spare < more) return false;
  lies_ = true;
  supports.spare -= more;
  supports.count = first_ = first;
  for (std::size_t i = 0; i < face_count_; ++i) {
    std::span<const Support> bore;
    for (std::size_t j = 0; kCorners * j < before.size(); ++j) {
      if (faces_before[j].is_of(faces_[i])) bore = before.subspan(kCorners * j, kCorners);
    }
    lie_on(i, held[i], found[i], bore, motion.centre_m, since.tick_s, body.together || cylinder_ != nullptr, supports);
  }
  return true;
}

/// A cylinder that lies on its side rolls on supports as told. @returns whether it does not, and finds where one that
/// stands would tip.
bool CornerSupports::stands_upright(const BodyMotion& motion, std::size_t first, const SupportPool& supports) noexcept {
  const Vector3d axis = motion.q_WB * Vector3d(Vector3d::UnitY());
  double most_n = -1.0;
  for (std::size_t i = first; i < supports.count; ++i) {
    const Support& told = supports.rows[i];
    if (told.round_m > 0.0) return false;
    const Vector3d from_axis_m = told.from_centre_m - axis.dot(told.from_centre_m) * axis;
    if (told.force_n <= most_n || from_axis_m.norm() < kOffMiddle * cylinder_->radius_m) continue;
    most_n = told.force_n;
    tips_B_ = motion.q_WB.conjugate() * from_axis_m;
  }
  return true;
}

/// What bears the body where that is told, and its corners there.
bool CornerSupports::find_holder(const ToldBody& body, const SinceAnswer& since, const BodyMotion& motion,
                                 const Support& told, Face& face, FacePoints& corners) const noexcept {
  const auto bears = [&](const rtbus::shapes::PlacedShape& holder) {
    return corners_on(holder, motion.centre_m, motion.q_WB, corners) &&
           corners.normal.dot(told.normal) >= since.tuning.same_plane_cosine;
  };
  if (told.holder == Support::kStands) {
    face.stands = since.shapes.holder_at(motion.centre_m + told.from_centre_m, bears);
    return face.stands != nullptr || find_mesh(since, motion, told, face, corners);
  }
  const auto slots = body.slot_of_row;
  const auto row = static_cast<std::size_t>(
      std::find(slots.begin(), slots.end(), static_cast<std::size_t>(told.holder)) - slots.begin());
  return row < slots.size() && place_holder(body, since, row, face) && bears(face.moves);
}

/// Where a mesh is flat under the body it is as good as a plane, until the next answer. @returns whether it is: the
/// corners that touch are above it, and there are three where physics tells a patch.
bool CornerSupports::find_mesh(const SinceAnswer& since, const BodyMotion& motion, const Support& told, Face& face,
                               FacePoints& corners) const noexcept {
  const Vector3d at_m = motion.centre_m + told.from_centre_m;
  if (!since.shapes.has_mesh_at(at_m, told.normal)) return false;
  face.moves = {rtbus::shapes::Plane{}, Quaterniond::FromTwoVectors(Vector3d::UnitY(), told.normal), at_m};
  if (!corners_on(face.moves, motion.centre_m, motion.q_WB, corners)) return false;
  const double touching_m = nearest_m(corners, 0.0) + kTilts_m;
  std::size_t touch = 0;
  for (std::size_t k = 0; k < corners.count; ++k) {
    if (corners.gap_m[k] > touching_m) continue;
    if (!since.shapes.has_mesh_at(corners.point_m[k], told.normal)) return false;
    ++touch;
  }
  return touch >= (told.torsion_radius_m > 0.0 ? kPatchCorners : 1);
}

/// @returns whether that row is a box whose place is known.
bool CornerSupports::place_holder(const ToldBody& body, const SinceAnswer& since, std::size_t row,
                                  Face& face) const noexcept {
  const ToldBody holder{body.answer, row};
  const auto* const shape = holder.knows_orientation() ? since.shapes.mover_of(body.answer.body_index[row]) : nullptr;
  const auto* const box = shape != nullptr ? std::get_if<rtbus::shapes::Box>(&shape->shape) : nullptr;
  if (box == nullptr) return false;
  face.holder = static_cast<int>(body.slot_of_row[row]);
  face.moves = {*box, holder.q_WB(), holder.centre_m()};
  return true;
}

/// Boxes that move, and that the body does not touch yet.
void CornerSupports::add_near_bodies(const ToldBody& body, const SinceAnswer& since, const BodyMotion& motion,
                                     std::size_t most_faces, std::span<Support, kFaces> held,
                                     std::span<FacePoints, kFaces> found) noexcept {
  if (box_ == nullptr) return;
  const rtbus::ProxyContacts& answer = body.answer;
  for (std::size_t i = 0; i < std::min<std::size_t>(answer.supports, rtbus::kSupportSlots); ++i) {
    const ToldPair pair = body.pair(i);
    if (answer.support_points[i] > 0 || pair.holder == ToldPair::kNone || pair.held != body.row) continue;
    if (face_count_ >= std::min(kFaces, most_faces)) return;
    Face face;
    FacePoints corners;
    if (!place_holder(body, since, pair.holder, face)) continue;
    if (!corners_on(face.moves, motion.centre_m, motion.q_WB, corners)) continue;
    const double gap_m = nearest_m(corners, kFar_m);
    if (std::abs(gap_m) > kBefore_m) continue;
    held[face_count_] = Support{};
    held[face_count_].normal = corners.normal;
    held[face_count_].friction = answer.support_friction[i];
    held[face_count_].holder = face.holder;
    found[face_count_] = corners;
    face.rest_gap_m.fill(std::min(0.0, gap_m));
    faces_[face_count_++] = face;
  }
}

/// What stands before the body, and would hold it before the next answer comes: a wall that it is pushed against.
/// @param friction Of what holds the body, for want of the pair's own. @param most_faces For which there is room.
void CornerSupports::add_walls(const SinceAnswer& since, const BodyMotion& motion, double friction,
                               std::size_t most_faces, std::span<Support, kFaces> held,
                               std::span<FacePoints, kFaces> found) noexcept {
  if (box_ == nullptr) return;
  const double near_m = box_->half_size_m.norm() + kBefore_m;
  const std::size_t told = face_count_;
  for (const rtbus::shapes::PlacedShape& holder : since.shapes.holders()) {
    if (face_count_ >= std::min(kFaces, most_faces)) return;
    if (rtbus::shapes::nearest_surface(holder, motion.centre_m).distance_m > near_m) continue;
    const auto is_it = [&](const Face& face) { return face.stands == &holder; };
    if (std::any_of(faces_.begin(), faces_.begin() + static_cast<std::ptrdiff_t>(told), is_it)) continue;
    FacePoints corners;
    if (!corners_on(holder, motion.centre_m, motion.q_WB, corners)) continue;
    const double gap_m = nearest_m(corners, kFar_m);
    if (std::abs(gap_m) > kBefore_m) continue;
    const auto meets = [&](const FacePoints& face) { return is_seam(corners, face); };
    if (std::any_of(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(told), meets)) continue;
    held[face_count_] = Support{};
    held[face_count_].normal = corners.normal;
    held[face_count_].friction = friction;
    found[face_count_] = corners;
    faces_[face_count_] = Face{&holder};
    faces_[face_count_++].rest_gap_m.fill(std::min(0.0, gap_m));
  }
}

/// Adds the rows of a face. Each corner is expected to bear what it bore in physics, whose force on the face is told
/// with its centre.
/// @param bore The rows of this face so far, with which its corners begin; empty: it did not lie there. @param tilts
/// See kTilts_m.
void CornerSupports::lie_on(std::size_t face, const Support& told, const FacePoints& corners,
                            std::span<const Support> bore, const Vector3d& centre_m, double tick_s, bool tilts,
                            SupportPool& supports) noexcept {
  const std::span rows(supports.rows.data() + supports.count, kCorners);
  supports.count += kCorners;
  Support corner = told;
  corner.force_n = 0.0;
  corner.impulse_n_s /= kCorners;
  corner.velocity_m_s.setZero();
  corner.torsion_radius_m = corner.torsion_n_m_s = 0.0;
  std::fill(rows.begin(), rows.end(), corner);
  for (std::size_t k = 0; k < bore.size(); ++k) {
    rows[k].from_centre_m = bore[k].from_centre_m;
    rows[k].impulse_n_s = bore[k].impulse_n_s;
  }
  const Places places = places_of(corners, centre_m, rows);
  const auto shares = load_shares(corners, centre_m + told.from_centre_m);
  for (std::size_t k = 0; k < corners.count; ++k) {
    Support& row = rows[places[k]];
    double& rest_gap_m = faces_[face].rest_gap_m[places[k]];
    if (tilts && hull_ == nullptr && told.force_n > 0.0)
      rest_gap_m = std::clamp(corners.gap_m[k], rest_gap_m, rest_gap_m + kTilts_m);
    row.force_n = shares[k] * told.force_n;
    if (bore.empty()) row.impulse_n_s += (row.force_n * tick_s - row.normal.dot(row.impulse_n_s)) * row.normal;
  }
  put(face, corners, centre_m, supports);
}

bool CornerSupports::corners_on(const rtbus::shapes::PlacedShape& holder, const Vector3d& centre_m,
                                const Quaterniond& q_WB, FacePoints& out, const Vector3d* way) const noexcept {
  if (box_ != nullptr) return rtbus::shapes::face_points(*box_, q_WB, centre_m, holder, out);
  if (cylinder_ != nullptr) {
    return rtbus::shapes::face_points(*cylinder_, q_WB, centre_m, holder, q_WB * tips_B_, out);
  }
  out.count = 0;
  const auto face =
      way == nullptr ? rtbus::shapes::face_towards(holder, centre_m) : rtbus::shapes::face_along(holder, *way);
  if (!face) return false;
  rtbus::shapes::hull_points(*hull_, q_WB, centre_m + q_WB * origin_B_m_, *face, out);
  return out.count > 0 && out.are_over(*face);
}

bool CornerSupports::leans(const SupportPool& supports) const noexcept {
  for (std::size_t face = 0; lies_ && face < face_count_; ++face) {
    const std::span rows(supports.rows.data() + first_ + kCorners * face, kCorners);
    const auto touches = [](const Support& row) { return row.gap_m < kTilts_m; };
    if (std::count_if(rows.begin(), rows.end(), touches) >= static_cast<std::ptrdiff_t>(kPatchCorners)) return false;
  }
  return lies_;
}

double CornerSupports::rim_tilt(const Quaterniond& q_WB) const noexcept {
  if (!lies_ || cylinder_ == nullptr) return 0.0;
  return (q_WB * Vector3d(Vector3d::UnitY())).cross(faces_[0].normal).norm();
}

void CornerSupports::find(const Vector3d& centre_m, const Quaterniond& q_WB, SupportPool& supports) const noexcept {
  for (std::size_t i = 0; i < face_count_; ++i) {
    FacePoints corners;
    (void)corners_on(faces_[i].placed(), centre_m, q_WB, corners, &faces_[i].normal);
    put(i, corners, centre_m, supports);
  }
}

void CornerSupports::put(std::size_t face, const FacePoints& corners, const Vector3d& centre_m,
                         SupportPool& supports) const noexcept {
  const std::span rows(supports.rows.data() + first_ + kCorners * face, kCorners);
  const Places places = places_of(corners, centre_m, rows);
  for (Support& row : rows) row.gap_m = kFar_m;
  for (std::size_t k = 0; k < corners.count; ++k) {
    Support& row = rows[places[k]];
    row.from_centre_m = corners.point_m[k] - centre_m;
    row.from_holder_m = corners.point_m[k] - faces_[face].placed().p_WB;
    row.normal = corners.normal;
    row.gap_m = corners.gap_m[k] - faces_[face].rest_gap_m[places[k]];
  }
}

}  // namespace haptic
