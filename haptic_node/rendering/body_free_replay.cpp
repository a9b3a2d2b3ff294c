// How free bodies go on from the instant of an answer to now.
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "haptic_node/rendering/body_free.hpp"

namespace haptic {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

/// What goes slower than this, in either way, stands still.
constexpr double kStill_m_s = 1e-3, kStill_rad_s = 0.05;
/// Corners of a body that has moved and turned by less since they were found are the same ones. But the lowest point of
/// a rim goes round by a tilt to a side over the whole tilt: of a can that stands on it, it is found in each part.
constexpr double kSameCorners_m = 1e-3, kSameCorners_rad = 5e-3;
/// A body on an edge falls over the faster, the farther it leans: what a long part misses has grown to a fall by the
/// next answer. There, and where an answer is older than this, parts are Tuning::longest_part_s; rows times parts are
/// so many at most.
constexpr double kOld_s = 0.1;
constexpr int kShortPartsBudget = 1000;
/// No push turns a body farther from the instant of an answer to now.
constexpr double kBlocked_rad = 0.5;

}  // namespace

/// One re-simulation of bodies that push each other.
class FreeBody::Replay {
 public:
  Replay(std::span<Replayed> together, SupportPool& supports) noexcept;

  /// @returns whether there was anything to do.
  bool run() noexcept;
  /// A hand that turns a body so far would not touch it there any more: something that is not told holds it. It turns
  /// as it did, and goes where the hand brings what does not turn. @returns whether there is such a body, and all are
  /// where they began.
  bool hold_what_is_blocked() noexcept;
  /// Bodies are where run() has brought them.
  void finish() noexcept;

 private:
  /// A body on its way.
  struct Member {
    Replayed* of = nullptr;
    BodyMotion told;
    bool blocked = false;  ///< See hold_what_is_blocked().
    SolverBody solved;
    Quaterniond turned = Quaterniond::Identity();
    Impulse before;             ///< Given by hands until the part that comes.
    std::size_t first_row = 0;  ///< Of its supports.
    Vector3d found_m;           ///< Where it was when corners were found last …
    Quaterniond found_turned;
    Vector3d moved_m, turned_rad;  ///< … and its way since.

    [[nodiscard]] FreeBody& body() const noexcept { return *of->body; }
    [[nodiscard]] BodyMotion& motion() const noexcept { return *of->motion; }
  };
  [[nodiscard]] std::span<Member> members() noexcept { return {members_.data(), count_}; }
  [[nodiscard]] const SinceAnswer& since() const noexcept { return *members_[0].of->since; }
  [[nodiscard]] int index_of(int slot) const noexcept;
  void place_holders(FreeBody& body) const noexcept;
  [[nodiscard]] bool begin() noexcept;
  void begin_rows(Member& member, double h) noexcept;
  void follow_corners(double h, double ahead_s) noexcept;
  void go(std::uint64_t until_ns, bool last, double h) noexcept;

  std::array<Member, kMostTogether> members_;
  std::size_t count_ = 0;
  SupportPool& supports_;
  SolverContact* rows_;
  std::size_t row_count_ = 0;
  int sweeps_ = 0;  ///< Of bodies that push each other, in each part.
  bool any_lies_ = false;
  std::uint64_t from_ns_ = 0;
  double way_s_ = 0.0, tick_s_ = 0.0;
};

FreeBody::Replay::Replay(std::span<Replayed> together, SupportPool& supports) noexcept
    : supports_(supports), rows_(together[0].since->scratch) {
  for (Replayed& each : together) {
    Member& member = members_[count_++];
    member.of = &each;
    member.told = *each.motion;
  }
}

/// @returns the number of the member in that slot; SolverContact::kFixed: there is none.
int FreeBody::Replay::index_of(int slot) const noexcept {
  if (slot == Support::kStands) return SolverContact::kFixed;
  for (std::size_t k = 0; k < count_; ++k) {
    if (members_[k].of->slot == slot) return static_cast<int>(k);
  }
  return SolverContact::kFixed;
}

/// Faces on which corners of that body lie go with what holds them, as far as that has come.
void FreeBody::Replay::place_holders(FreeBody& body) const noexcept {
  BodyMotion there;
  body.corners_.place_holders([&](int slot) -> const BodyMotion* {
    const int holder = index_of(slot);
    if (holder < 0) return nullptr;
    there = members_[static_cast<std::size_t>(holder)].motion();
    there.q_WB = members_[static_cast<std::size_t>(holder)].turned * there.q_WB;
    return &there;
  });
}

/// Finds when it begins. @returns whether that is before now.
bool FreeBody::Replay::begin() noexcept {
  // Behind a network what stands still stands until it is pushed. In a part in which that begins, friction would brake
  // it from before.
  const auto waits = [](const Member& each) {
    const SinceAnswer& since = *each.of->since;
    return since.networked && since.others.none() && each.body().support_count_ > 0 &&
           each.motion().velocity_m_s.norm() < kStill_m_s && each.motion().angular_velocity_rad_s.norm() < kStill_rad_s;
  };
  from_ns_ = since().from_ns;
  if (std::all_of(members_.begin(), members_.begin() + static_cast<std::ptrdiff_t>(count_), waits)) {
    from_ns_ = since().now_ns;
    for (const Member& each : members()) {
      from_ns_ = std::min(from_ns_, each.of->since->history.first_after(since().from_ns, since().now_ns));
    }
  }
  way_s_ = from_ns_ > since().from_ns ? rtbus::seconds_between(from_ns_, since().now_ns) : since().seconds();
  return from_ns_ < since().now_ns;
}

void FreeBody::Replay::begin_rows(Member& member, double h) noexcept {
  FreeBody& body = member.body();
  member.first_row = row_count_;
  if (body.inverse_mass_per_kg_ <= 0.0) return;
  for (std::size_t i = body.first_support_; i < body.first_support_ + body.support_count_; ++i) {
    const Support& support = supports_.rows[i];
    SolverContact& row = rows_[row_count_++];
    row = body.row_of(support, h);
    row.a = static_cast<int>(&member - members_.data());
    row.b = index_of(support.holder);
    row.from_b_m = support.from_holder_m;
    row.softness_per_kg *= tick_s_ / h;  // gives way as fast as it does tick by tick
    // A body that is jammed between hand and edge has a second solution, in which it flies off (P. Painlevé, 1895).
    // With the friction of the tick before it stays in the one that it is in.
    row.impulse_n_s = h / since().tick_s * support.impulse_n_s;
    if (!body.corners_.lies()) {
      row.impulse_n_s += (support.force_n * h - support.normal.dot(row.impulse_n_s)) * support.normal;
    }
    row.torsion_n_m_s = 0.0;
  }
}

/// The rows of corners in a part of `h`. They turn with the bodies: a box on its edge falls over the faster, the
/// farther its centre is beside the edge. Where they are after `ahead_s` is where they push: in the middle of a part,
/// or eight parts would be too few.
void FreeBody::Replay::follow_corners(double h, double ahead_s) noexcept {
  bool far = false;
  for (Member& each : members()) {
    each.moved_m = each.motion().centre_m - each.found_m;
    each.turned_rad = 2.0 * (each.turned * each.found_turned.conjugate()).vec();  // of a small angle
    far = far || each.moved_m.norm() > kSameCorners_m || each.turned_rad.norm() > kSameCorners_rad ||
          each.body().corners_.rim_tilt(each.turned * each.motion().q_WB) > kSameCorners_rad;
  }
  if (far) {
    for (Member& each : members()) {
      FreeBody& body = each.body();
      if (body.corners_.lies()) {
        place_holders(body);
        body.corners_.find(each.motion().centre_m, each.turned * each.motion().q_WB, supports_);
      }
      each.found_m = each.motion().centre_m;
      each.found_turned = each.turned;
      each.moved_m.setZero();
      each.turned_rad.setZero();
    }
  }
  for (Member& each : members()) {
    const FreeBody& body = each.body();
    if (!body.corners_.lies()) continue;
    const Vector3d then_rad = each.turned_rad + ahead_s * each.solved.angular_velocity_rad_s;
    for (std::size_t i = 0; i < body.support_count_; ++i) {
      const Support& support = supports_.rows[body.first_support_ + i];
      const Vector3d& from_m = support.from_centre_m;
      SolverContact& row = rows_[each.first_row + i];
      row.normal = support.normal;
      row.from_a_m = from_m + then_rad.cross(from_m);
      double gap_m = support.gap_m + support.normal.dot(each.moved_m + each.turned_rad.cross(from_m));
      if (row.b >= 0) {
        const Member& holder = members_[static_cast<std::size_t>(row.b)];
        const Vector3d& from_b_m = support.from_holder_m;
        const Vector3d b_then_rad = holder.turned_rad + ahead_s * holder.solved.angular_velocity_rad_s;
        row.from_b_m = from_b_m + b_then_rad.cross(from_b_m);
        gap_m -= support.normal.dot(holder.moved_m + holder.turned_rad.cross(from_b_m));
      }
      row.closing_m_s = closing_m_s(gap_m, h);
    }
  }
  std::array<SolverBody, kMostTogether> bodies;
  for (std::size_t k = 0; k < count_; ++k) {
    Member& each = members_[k];
    if (far) {
      const Matrix3d R = each.turned.toRotationMatrix();
      each.solved.inverse_inertia_per_kg_m2 =
          R * (each.blocked ? Matrix3d(Matrix3d::Zero()) : each.body().inverse_inertia_per_kg_m2_) * R.transpose();
    }
    bodies[k] = each.solved;
  }
  if (far) {
    prepare_contacts(bodies.data(), rows_, row_count_);
  } else {
    move_points(bodies.data(), rows_, row_count_);
  }
}

/// One part.
void FreeBody::Replay::go(std::uint64_t until_ns, bool last, double h) noexcept {
  std::array<SolverBody, kMostTogether> next;
  for (std::size_t k = 0; k < count_; ++k) {
    Member& each = members_[k];
    const FreeBody& body = each.body();
    const SinceAnswer& since = *each.of->since;
    Impulse after = since.given_at(until_ns);
    after += last ? since.others.until_now() : since.others.until(until_ns);
    next[k] = each.solved;
    next[k].velocity_m_s +=
        next[k].inverse_mass_per_kg * (h * body.force_n_ + after.linear_n_s - each.before.linear_n_s);
    next[k].angular_velocity_rad_s +=
        next[k].inverse_inertia_per_kg_m2 * (h * body.torque_n_m_ + after.angular_n_m_s - each.before.angular_n_m_s);
    each.before = after;
  }
  // Every part goes on from what the one before it found, the first from the tick before.
  if (row_count_ > 0) {
    const double tolerance_m_s = kTolerance_m_s * h / tick_s_;
    if (count_ > 1) {
      relax_together(next.data(), rows_, row_count_, sweeps_, tolerance_m_s);
    } else {
      (members_[0].body().light() ? relax_alone : relax_contacts)(next.data(), rows_, row_count_,
                                                                  since().tuning.together_sweeps(), tolerance_m_s);
    }
  }
  for (std::size_t k = 0; k < count_; ++k) {
    Member& each = members_[k];
    SolverBody& solved = each.solved;
    // Impulses came evenly over the part, each at the beginning of its tick.
    const Vector3d faster_m_s = next[k].velocity_m_s - solved.velocity_m_s;
    each.motion().centre_m += h * (solved.velocity_m_s + 0.5 * faster_m_s) + 0.5 * tick_s_ * faster_m_s;
    each.turned = turn_of(0.5 * (solved.angular_velocity_rad_s + next[k].angular_velocity_rad_s), h) * each.turned;
    solved.velocity_m_s = next[k].velocity_m_s;
    solved.angular_velocity_rad_s = next[k].angular_velocity_rad_s;
  }
}

bool FreeBody::Replay::run() noexcept {
  if (!begin()) return false;
  std::size_t supports = 0;
  any_lies_ = false;
  for (const Member& each : members()) {
    supports += each.body().support_count_;
    any_lies_ = any_lies_ || each.body().corners_.lies();
  }
  // Walls before the body are rows that the budget has not counted.
  const int budget = count_ > 1 ? since().tuning.together_budget() : static_cast<int>(since().tuning.row_budget);
  const int rows = static_cast<int>(count_ + supports);
  int parts = std::clamp(budget / rows, 1, since().parts);
  if (count_ == 1 && (way_s_ > kOld_s || members_[0].body().corners_.leans(supports_))) {
    parts = std::clamp(static_cast<int>(std::ceil(way_s_ / since().tuning.longest_part_s)), parts,
                       std::max(parts, kShortPartsBudget / rows));
  }
  sweeps_ = since().tuning.replay_sweeps(rows * parts);
  const double h = way_s_ / parts;
  tick_s_ = std::min(h, since().tick_s);
  row_count_ = 0;
  std::array<SolverBody, kMostTogether> bodies;
  for (std::size_t k = 0; k < count_; ++k) {
    Member& each = members_[k];
    each.before = each.of->since->given_at(from_ns_);
    begin_rows(each, h);
    each.solved = each.body().solver_body(each.motion());
    if (each.blocked) each.solved.inverse_inertia_per_kg_m2.setZero();
    each.turned = each.found_turned = Quaterniond::Identity();
    each.found_m = each.motion().centre_m;
    bodies[k] = each.solved;
  }
  prepare_contacts(bodies.data(), rows_, row_count_);
  for (int part = 1; part <= parts; ++part) {
    const std::uint64_t until_ns =
        from_ns_ + (since().now_ns - from_ns_) * static_cast<std::uint64_t>(part) / static_cast<std::uint64_t>(parts);
    if (any_lies_) follow_corners(h, 0.5 * (h - tick_s_));
    go(until_ns, part == parts, h);
  }
  return true;
}

bool FreeBody::Replay::hold_what_is_blocked() noexcept {
  bool any = false;
  for (Member& each : members()) {
    const Vector3d given_n_m_s = each.before.angular_n_m_s - each.of->since->given_at(from_ns_).angular_n_m_s;
    const double more_rad = way_s_ * (each.solved.angular_velocity_rad_s - each.motion().angular_velocity_rad_s).norm();
    if (each.blocked || each.body().shape_ == nullptr || given_n_m_s.isZero(0.0) || more_rad <= kBlocked_rad) continue;
    each.blocked = any = true;
  }
  if (!any) return false;
  for (Member& each : members()) {
    each.turned.setIdentity();
    each.motion() = each.told;
    if (each.blocked) each.motion().angular_velocity_rad_s.setZero();
  }
  for (Member& each : members()) {  // their corners have gone with them
    CornerSupports& corners = each.body().corners_;
    if (!corners.lies()) continue;
    place_holders(each.body());
    corners.find(each.motion().centre_m, each.motion().q_WB, supports_);
  }
  return true;
}

void FreeBody::Replay::finish() noexcept {
  for (Member& each : members()) {
    FreeBody& body = each.body();
    BodyMotion& motion = each.motion();
    motion.velocity_m_s = each.solved.velocity_m_s;
    motion.angular_velocity_rad_s = each.solved.angular_velocity_rad_s;
    if (each.blocked) {
      motion.angular_velocity_rad_s = each.told.angular_velocity_rad_s;
      each.turned = turn_of(each.told.angular_velocity_rad_s, way_s_);
    }
    each.turned.normalize();
    each.of->turned = each.turned;
    if (each.turned.vec().isZero(0.0)) continue;
    const Matrix3d R = each.turned.toRotationMatrix();
    body.inverse_inertia_per_kg_m2_ = R * body.inverse_inertia_per_kg_m2_ * R.transpose();
    if (body.shape_ != nullptr) motion.q_WB = (each.turned * motion.q_WB).normalized();
    if (body.corners_.lies() || body.inverse_mass_per_kg_ <= 0.0) continue;
    for (std::size_t i = body.first_support_; i < body.first_support_ + body.support_count_; ++i) {
      Support& support = supports_.rows[i];
      const Vector3d out_m = support.round_m * support.normal;
      support.from_centre_m = each.turned * (support.from_centre_m + out_m) - out_m;
    }
  }
}

void FreeBody::replay(std::span<Replayed> together, SupportPool& supports) noexcept {
  if (together[0].since->from_ns >= together[0].since->now_ns) return;
  Replay replay(together, supports);
  if (!replay.run()) return;
  while (replay.hold_what_is_blocked()) replay.run();
  replay.finish();
}

}  // namespace haptic
