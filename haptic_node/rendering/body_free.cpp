#include "haptic_node/rendering/body_free.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>
#include <variant>

namespace haptic {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using rtbus::vector_of;

/// So many points of a support make a patch, on which a body stands without tilting.
constexpr std::uint32_t kPatchPoints = 3;
/// Friction of a patch resists spin with its bound at this many radii of gyration: of a square plate its four corners
/// are √3 as far from the middle.
constexpr double kPatchRadius = std::numbers::sqrt3;
/// A corner that has sunk in comes out by this part of its depth in a step, at most at this speed.
constexpr double kOut = 0.2, kOut_m_s = 0.05;
/// A cylinder rolls on its side where its axis is so near to the plane below it (a cosine).
constexpr double kLying = 0.1;
/// Behind a network a support gives way for so long, however old the answer is.
constexpr double kGivesWay_s = 10e-3;
/// So much of what the hand presses more than at an answer's instant may be gone after its age.
constexpr double kRelaxes = 0.05;
/// A light body's mass, in that of the proxy, h(hK + B). Tried: 20, and all (docs/decisions/0008).
constexpr double kLight = 100.0;

Matrix3d matrix_of(const rtbus::Symmetric3& m) noexcept {
  Matrix3d out;
  out << m[0], m[1], m[2], m[1], m[3], m[4], m[2], m[4], m[5];
  return out;
}

}  // namespace

void FreeBody::take(const ToldBody& told, const SinceAnswer& since, double hand_m_s, SupportPool& supports,
                    const SupportPool& old, BodyMotion& motion) noexcept {
  const rtbus::ProxyContacts& answer = told.answer;
  motion = told.motion();
  inverse_mass_per_kg_ = answer.body_inverse_mass_per_kg[told.row];
  inverse_inertia_per_kg_m2_ = matrix_of(answer.body_inverse_inertia_per_kg_m2[told.row]);
  light_ = kLight * since.proxy_kg * inverse_mass_per_kg_ > 1.0;
  force_n_ = vector_of(answer.body_external_force_n[told.row]);
  torque_n_m_ = vector_of(answer.body_external_torque_n_m[told.row]);
  friction_bound_n_ = answer.body_friction_bound_n[told.row];
  ball_ = told.is_ball(told.row);
  supported_ = rocks_ = rolls_ = false;
  const auto corners_before = corners_.leave(old);
  shape_ = told.knows_orientation() ? since.shapes.mover_of(answer.body_index[told.row]) : nullptr;
  corners_.be(shape_, told.origin_B_m());
  // A hand that pushes otherwise than at the answered instant moves it against its supports, and its own spring relaxes
  // by that. What is light would sink and rise with every answer.
  const double relaxes =
      since.tuning.support_softness * since.proxy_kg * inverse_mass_per_kg_ * since.seconds() / since.tick_s;
  const double gives_way =
      since.networked ? kGivesWay_s / std::max(since.seconds(), kGivesWay_s) : kRelaxes / std::max(relaxes, kRelaxes);
  softness_per_kg_ = gives_way * since.tuning.support_softness * inverse_mass_per_kg_;
  take_supports(told, since.tuning, motion, supports, old);
  if (!told.complete) {
    // Nothing would hold what holds it: it goes on as it went. As in a pile, a speed that the hand does not share is
    // over by the time it is told.
    inverse_mass_per_kg_ = 0.0;
    force_n_.setZero();
    torque_n_m_.setZero();
    motion.slow_down(std::max(since.tuning.pile_own_speed_m_s, hand_m_s));
  }
  if (inverse_mass_per_kg_ > 0.0) {
    if (supported_) {
      const bool lies = corners_.lie_down(told, since, motion, corners_before, first_support_, supports);
      support_count_ = supports.count - first_support_;
      if (!lies) stand_on(since.tuning, supports, motion);
    } else if (friction_bound_n_ > 0.0 && supports.spare > 0) {
      // It has slept since it was made: nobody knows yet what it stands on, only how hard that holds it.
      --supports.spare;
      Support& support = supports.rows[supports.count++];
      support = Support{};
      support.friction = 1.0;
      support_count_ = 1;
      inverse_inertia_per_kg_m2_.setZero();
    }
  }
}

/// Supports push back only as far as they are pushed against: their forces of then are taken out of the body's force.
void FreeBody::take_supports(const ToldBody& told, const Tuning& tuning, const BodyMotion& motion,
                             SupportPool& supports, const SupportPool& old) noexcept {
  const rtbus::ProxyContacts& answer = told.answer;
  const std::size_t old_first = first_support_, old_end = first_support_ + support_count_;
  first_support_ = supports.count;
  for (std::size_t i = 0; i < std::min<std::size_t>(answer.supports, rtbus::kSupportSlots); ++i) {
    const ToldPair pair = told.pair(i);
    if (answer.support_points[i] == 0 && answer.support_holder[i] > 0) continue;  // it does not touch that
    if (pair.holder == told.row) {  // the row is the held one's, and so is the force that is not told on
      supported_ = true;
      const Vector3d push_n = pair.sign * answer.support_force_n[i] * vector_of(answer.support_normal[i]);
      const Vector3d from_m = vector_of(answer.support_point_m[i]) - motion.centre_m;
      force_n_ += push_n;
      torque_n_m_ += from_m.cross(push_n);
    }
    if (pair.held != told.row) continue;
    Support& support = supports.rows[supports.count++];
    support = Support{};
    support.from_centre_m = vector_of(answer.support_point_m[i]) - vector_of(answer.body_centre_m[told.row]);
    support.normal = pair.sign * vector_of(answer.support_normal[i]);
    // What touches moves as one along the normal; a solver leaves a remainder.
    const Vector3d own_m_s = motion.velocity_at(support.from_centre_m);
    if (pair.holder == ToldPair::kNone) {
      support.velocity_m_s = vector_of(answer.support_velocity_m_s[i]);
      support.velocity_m_s += support.normal * support.normal.dot(own_m_s - support.velocity_m_s);
    } else {
      const BodyMotion holder = ToldBody{answer, pair.holder}.motion();
      support.holder = static_cast<int>(told.slot_of_row[pair.holder]);
      support.from_holder_m = vector_of(answer.support_point_m[i]) - holder.centre_m;
      support.velocity_m_s = support.normal * support.normal.dot(own_m_s - holder.velocity_at(support.from_holder_m));
    }
    support.force_n = answer.support_force_n[i];
    support.friction = answer.support_friction[i];
    if (answer.support_points[i] >= kPatchPoints) support.torsion_radius_m = 1.0;  // its size: stand_on()
    force_n_ -= support.force_n * support.normal;
    torque_n_m_ -= support.from_centre_m.cross(support.force_n * support.normal);
    make_round(motion, support);
    supported_ = true;
    double nearest_m = std::numeric_limits<double>::infinity();
    for (std::size_t j = old_first; j < old_end; ++j) {
      if (old.rows[j].normal.dot(support.normal) < tuning.same_plane_cosine) continue;
      const double away_m = (old.rows[j].from_centre_m - support.from_centre_m).norm();
      if (away_m >= nearest_m) continue;
      nearest_m = away_m;
      support.impulse_n_s = old.rows[j].impulse_n_s;
      support.torsion_n_m_s = old.rows[j].torsion_n_m_s;
    }
  }
  support_count_ = supports.count - first_support_;
}

/// A ball is held below its centre, a capsule or a lying cylinder below its axis. Told is where it was held at the
/// beginning of physics' last step: behind what rolls.
void FreeBody::make_round(const BodyMotion& motion, Support& support) noexcept {
  const double up_m = support.normal.dot(support.from_centre_m);
  if (ball_) {
    support.from_centre_m = support.normal * up_m;
    support.round_m = -up_m;
    rolls_ = true;
    return;
  }
  const auto* const capsule = shape_ != nullptr ? std::get_if<rtbus::shapes::Capsule>(&shape_->shape) : nullptr;
  const auto* const cylinder = shape_ != nullptr ? std::get_if<rtbus::shapes::Cylinder>(&shape_->shape) : nullptr;
  const Vector3d axis = motion.q_WB * Vector3d(Vector3d::UnitY());
  if (capsule != nullptr) support.round_m = capsule->radius_m;
  if (cylinder != nullptr && std::abs(axis.dot(support.normal)) < kLying) support.round_m = cylinder->radius_m;
  if (support.round_m <= 0.0) return;
  rolls_ = true;
  const double along_m = axis.dot(support.from_centre_m + support.round_m * support.normal);
  support.from_centre_m = along_m * axis - support.round_m * support.normal;
}

/// A body that stands on a patch does not tilt: the patch pushes where it must.
/// It may still spin about the normal.
void FreeBody::stand_on(const Tuning& tuning, SupportPool& supports, BodyMotion& motion) noexcept {
  bool patch = false, more = false;
  Vector3d normal = Vector3d::UnitY();
  for (std::size_t i = first_support_; i < first_support_ + support_count_; ++i) {
    const Support& support = supports.rows[i];
    if (support.torsion_radius_m <= 0.0) continue;
    if (patch && std::abs(normal.dot(support.normal)) < tuning.same_plane_cosine) more = true;
    normal = support.normal;
    patch = true;
  }
  rocks_ = !patch;
  if (!patch) return;
  double about_normal = 0.0;
  if (!more) {
    const Matrix3d inertia = inverse_inertia_per_kg_m2_.inverse();
    if (inertia.allFinite()) about_normal = normal.dot(inertia * normal);
  }
  double radius_m = 0.0;
  inverse_inertia_per_kg_m2_.setZero();
  // What it was taken to tilt by is over, or it would roll on, and no friction would stop it.
  motion.angular_velocity_rad_s =
      more ? Vector3d(Vector3d::Zero()) : Vector3d(normal * normal.dot(motion.angular_velocity_rad_s));
  if (about_normal > 0.0) {
    inverse_inertia_per_kg_m2_ = normal * normal.transpose() / about_normal;
    radius_m = kPatchRadius * std::sqrt(about_normal * inverse_mass_per_kg_);
  }
  for (std::size_t i = first_support_; i < first_support_ + support_count_; ++i) {
    if (supports.rows[i].torsion_radius_m > 0.0) supports.rows[i].torsion_radius_m = radius_m;
  }
}

double FreeBody::closing_m_s(double gap_m, double h) noexcept {
  return gap_m >= 0.0 ? gap_m / h : std::max(kOut * gap_m / h, -kOut_m_s);
}

SolverContact FreeBody::row_of(const Support& support, double h) const noexcept {
  SolverContact row;
  row.normal = support.normal;
  row.from_a_m = support.from_centre_m;
  row.surface_velocity_m_s = support.velocity_m_s;
  row.friction = support.friction;
  row.torsion_radius_m = support.torsion_radius_m;
  row.closing_m_s = closing_m_s(support.gap_m, h);
  row.softness_per_kg = softness_per_kg_;
  row.expected_n_s = support.force_n * h;
  row.impulse_n_s = support.impulse_n_s;
  row.torsion_n_m_s = support.torsion_n_m_s;
  if (!supported_) row.held_n_s = friction_bound_n_ * h;
  return row;
}

bool FreeBody::goes_on(const BodyMotion& motion, const Impulse& given) const noexcept {
  const bool moving = !motion.velocity_m_s.isZero(1e-9) || !motion.angular_velocity_rad_s.isZero(1e-7);
  const bool falls = !supported_ && !force_n_.isZero(0.0);
  return moving || falls || !given.is_zero();
}

bool FreeBody::join(const BodyMotion& motion, const Impulse& given, int self, double h, SolverBody& out) noexcept {
  self_ = SolverContact::kFixed;
  if (inverse_mass_per_kg_ <= 0.0) return false;
  self_ = self;
  out = solver_body(motion);
  out.velocity_m_s += inverse_mass_per_kg_ * (h * force_n_ + given.linear_n_s);
  out.angular_velocity_rad_s += inverse_inertia_per_kg_m2_ * (h * torque_n_m_ + given.angular_n_m_s);
  return true;
}

void FreeBody::fill_row(const Vector3d& late_m_s, SolverContact& row) const noexcept {
  row.b = self_;
  if (self_ >= 0) row.surface_velocity_m_s = late_m_s;
}

std::size_t FreeBody::add_own_rows(const BodyMotion& motion, SupportPool& supports, double h, SolverContact* rows,
                                   std::size_t first) noexcept {
  first_row_ = first;
  if (corners_.lies() && self_ >= 0) corners_.find(motion.centre_m, motion.q_WB, supports);
  for (std::size_t i = 0; i < support_count_; ++i) {
    Support& support = supports.rows[first_support_ + i];
    if (self_ < 0) {
      support.impulse_n_s.setZero();
      support.torsion_n_m_s = 0.0;
      continue;
    }
    rows[first + i] = row_of(support, h);
    rows[first + i].a = self_;
  }
  return self_ < 0 ? 0 : support_count_;
}

void FreeBody::advance(const StepSolution& step, SupportPool& supports, BodyMotion& motion) noexcept {
  if (self_ >= 0) {
    motion.velocity_m_s = step.bodies[self_].velocity_m_s;
    motion.angular_velocity_rad_s = step.bodies[self_].angular_velocity_rad_s;
    for (std::size_t i = 0; i < support_count_; ++i) {
      supports.rows[first_support_ + i].impulse_n_s = step.rows[first_row_ + i].impulse_n_s;
      supports.rows[first_support_ + i].torsion_n_m_s = step.rows[first_row_ + i].torsion_n_m_s;
    }
  }
  motion.centre_m += step.h * motion.velocity_m_s;
  if (shape_ == nullptr || motion.angular_velocity_rad_s.isZero(0.0)) return;
  const Quaterniond turn = turn_of(motion.angular_velocity_rad_s, step.h);
  const Matrix3d R = turn.toRotationMatrix();
  motion.q_WB = (turn * motion.q_WB).normalized();
  inverse_inertia_per_kg_m2_ = R * inverse_inertia_per_kg_m2_ * R.transpose();
}

void FreeBody::brake() noexcept {
  if (supported_) return;  // what stands on something is held there by its weight
  force_n_.setZero();
  torque_n_m_.setZero();
}

}  // namespace haptic
