#include "haptic_node/rendering/yielding_bodies.hpp"

#include <algorithm>
#include <cmath>

#include "rtbus/clock.hpp"
#include "rtbus/eigen.hpp"

namespace haptic {
namespace {

using Eigen::Vector3d;
using rtbus::vector_of;

/// The solver divides by it.
constexpr double kSoftest_n_per_m = 1e-3;
/// The mean is brought in, and given up, within so long.
constexpr double kCalms_s = 0.1;
/// A hand that has moved by that is not at rest for so long, whatever answers still say: they are late. One that creeps
/// rests, as physics has it: it is held against its mean place over so long.
constexpr double kMoves_m = 1e-3, kMoves_s = 0.5, kCreeps_s = 1.0;
/// What the hand moves by counts by so much more than what is told of the stiffness: with less than the body's the mean
/// would not be passive, and what is told is not sharp.
constexpr double kStiffer = 2.0;
/// Where nothing is near any more, a mean below that is none.
constexpr double kNoForce_n = 1e-3;

/// Along the reaction; where there is none, to what is nearest.
Vector3d direction(const Vector3d& reaction_n, const Vector3d& normal) noexcept {
  const double size_n = reaction_n.norm();
  if (size_n > 0.0) return reaction_n / size_n;
  const double length = normal.norm();
  return length > 0.5 ? Vector3d(normal / length) : Vector3d(Vector3d::UnitY());
}

}  // namespace

std::optional<double> YieldingBodies::take(const rtbus::ProxyContacts& answer, const Vector3d& proxy_m,
                                           std::uint64_t now_ns, const Blend& blend) noexcept {
  blend_ = blend;
  const bool touched = normal_n_s_ > 0.0;
  const auto bears_n = [&] {
    if (count_ == 0) return Vector3d(Vector3d::Zero());
    const Felt here = felt(now_ns);
    return Vector3d(std::max(0.0, here.bears_n - along_n_per_m_ * here.ahead_m(proxy_m)) * here.n);
  };
  const Vector3d before_n = touched ? bears_n() : Vector3d(Vector3d::Zero());
  count_ = std::min<std::size_t>(answer.yields, rtbus::kYieldSlots);
  from_ns_ = answer.device_time_ns;
  along_n_per_m_ = std::max(answer.yield_stiffness_n_per_m, kSoftest_n_per_m);
  across_n_per_m_ = answer.yield_stiffness_across_n_per_m;
  friction_ = answer.yield_friction;
  if (count_ > 0) rest_ = answer.yield_rest;
  for (std::size_t i = 0; i < count_; ++i) {
    instants_[i] = {answer.yield_after_s[i], vector_of(answer.yield_tool_m[i]), vector_of(answer.yield_reaction_n[i]),
                    vector_of(answer.yield_normal[i]), answer.yield_gap_m[i]};
  }
  late_n_.setZero();
  if (!touched || count_ == 0) return std::nullopt;
  late_n_ = before_n - bears_n();
  return late_n_.norm() / along_n_per_m_;
}

YieldingBodies::Instant YieldingBodies::at(std::uint64_t now_ns) const noexcept {
  const double after_s = now_ns > from_ns_ ? rtbus::seconds_between(from_ns_, now_ns) : 0.0;
  std::size_t next = 0;
  while (next < count_ && instants_[next].after_s <= after_s) ++next;
  if (next == 0) return instants_[0];
  if (next == count_) return instants_[count_ - 1];
  const Instant& a = instants_[next - 1];
  const Instant& b = instants_[next];
  const double share = (after_s - a.after_s) / (b.after_s - a.after_s);
  return {after_s, a.tool_m + share * (b.tool_m - a.tool_m), a.reaction_n + share * (b.reaction_n - a.reaction_n),
          a.normal + share * (b.normal - a.normal), a.gap_m + share * (b.gap_m - a.gap_m)};
}

YieldingBodies::Felt YieldingBodies::felt(std::uint64_t now_ns) const noexcept {
  const Instant now = at(now_ns);
  const Vector3d n = direction(now.reaction_n, now.normal);
  return {now, n, now.reaction_n.norm() + n.dot(late_n_)};
}

Vector3d YieldingBodies::bears_n(std::uint64_t now_ns) const noexcept {
  if (count_ == 0) return Vector3d::Zero();
  const Felt here = felt(now_ns);
  return std::max(0.0, here.bears_n) * here.n;
}

std::size_t YieldingBodies::add_row(const Vector3d& proxy_m, std::uint64_t now_ns, double h, SolverBody& proxy,
                                    SolverContact* rows, std::size_t first) noexcept {
  row_ = kNoRow;
  across_n_s_.setZero();
  if (count_ == 0) return 0;
  const Felt here = felt(now_ns);
  const Vector3d& n = here.n;
  const Vector3d then_m = proxy_m + h * proxy.velocity_m_s, aside_m = then_m - here.now.tool_m;
  if (here.bears_n <= along_n_per_m_ * here.ahead_m(then_m)) return 0;
  row_ = first;
  SolverContact& row = rows[first];
  row = SolverContact{};
  row.normal = n;
  row.closing_m_s = here.ahead_m(proxy_m) / h;
  row.softness_per_kg = 1.0 / (h * h * along_n_per_m_);
  row.expected_n_s = h * here.bears_n;
  row.impulse_n_s = normal_n_s_ * n;  // warm start
  // Across: implicit by itself, within what friction holds.
  const double held = h * h * across_n_per_m_;
  across_n_s_ = -held / (h * (1.0 + held * proxy.inverse_mass_per_kg)) * (aside_m - n * n.dot(aside_m));
  const double most_n_s = friction_ * normal_n_s_;
  if (const double size_n_s = across_n_s_.norm(); size_n_s > most_n_s) across_n_s_ *= most_n_s / size_n_s;
  proxy.velocity_m_s += proxy.inverse_mass_per_kg * across_n_s_;
  return 1;
}

Vector3d YieldingBodies::impulse_n_s(const SolverContact* rows) const noexcept {
  return row_ == kNoRow ? Vector3d(Vector3d::Zero()) : Vector3d(rows[row_].impulse_n_s + across_n_s_);
}

Vector3d YieldingBodies::calm_n_s(const SolverContact* rows, const Vector3d& eased_n, const Vector3d& goal_m,
                                  double stiffness_n_per_m, double h) noexcept {
  rests_s_ += h;
  if (!((goal_m - rests_at_m_).norm() <= kMoves_m)) {
    rests_at_m_ = goal_m;
    rests_s_ = 0.0;
  }
  rests_at_m_ += std::min(1.0, h / kCreeps_s) * (goal_m - rests_at_m_);
  const bool begins = mean_weight_ <= 0.0;
  mean_weight_ += std::clamp((rests_s_ < kMoves_s ? 0.0 : rest_) - mean_weight_, -h / kCalms_s, h / kCalms_s);
  const Vector3d moved_m = goal_m - goal_m_;
  goal_m_ = goal_m;
  const Vector3d now_n = impulse_n_s(rows) / h + eased_n;
  if (begins || mean_weight_ <= 0.0 || (count_ == 0 && mean_n_.norm() < kNoForce_n)) {
    mean_n_ = now_n;
    return Vector3d::Zero();
  }
  if (const double size_n = mean_n_.norm(); size_n > 0.0) {
    const Vector3d n = mean_n_ / size_n;
    const double series_n_per_m = stiffness_n_per_m * along_n_per_m_ / (stiffness_n_per_m + along_n_per_m_);
    mean_n_ = std::max(0.0, size_n - std::min(stiffness_n_per_m, kStiffer * series_n_per_m) * n.dot(moved_m)) * n;
  }
  mean_n_ -= std::expm1(-h / mean_s_) * (now_n - mean_n_);
  return h * mean_weight_ * (mean_n_ - now_n);
}

void YieldingBodies::keep(const SolverContact* rows, double h) noexcept {
  late_n_ -= blend_.share(h) * late_n_;
  normal_n_s_ = row_ == kNoRow ? 0.0 : rows[row_].normal_n_s;
}

}  // namespace haptic
