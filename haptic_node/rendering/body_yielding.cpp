#include "haptic_node/rendering/body_yielding.hpp"

#include <algorithm>
#include <cmath>

#include "rtbus/clock.hpp"
#include "rtbus/eigen.hpp"

namespace haptic {
namespace {

using Eigen::Vector3d;
using rtbus::vector_of;

/// A patch is at least this soft: the solver divides by it.
constexpr double kStiffest_m_per_n = 1e-6;

}  // namespace

void SpringHistory::reset() noexcept {
  open_.fill(false);
  count_ = 0;
}

std::size_t SpringHistory::open() noexcept {
  std::size_t place = 0;
  while (place < kPlaces && open_[place]) ++place;
  if (place == kPlaces) return place;
  open_[place] = true;
  now_n_[place].setZero();
  // What was remembered belongs to the one before.
  for (Instant& instant : instants_) instant.spring_n[place].setZero();
  return place;
}

void SpringHistory::record(std::uint64_t time_ns) noexcept {
  if (count_ > 0 && time_ns < instants_[(count_ - 1) % kInstants].time_ns + apart_ns_) return;
  Instant& instant = instants_[count_++ % kInstants];
  instant.time_ns = time_ns;
  instant.spring_n = now_n_;
}

Vector3d SpringHistory::at(std::size_t place, std::uint64_t time_ns) const noexcept {
  const std::uint64_t oldest = count_ > kInstants ? count_ - kInstants : 0;
  std::uint64_t low = oldest, high = count_;
  while (low < high) {
    const std::uint64_t middle = low + (high - low) / 2;
    if (instants_[middle % kInstants].time_ns <= time_ns)
      low = middle + 1;
    else
      high = middle;
  }
  if (low == oldest) return Vector3d::Zero();
  const Instant& before = instants_[(low - 1) % kInstants];
  if (low == count_) return before.spring_n[place];
  const Instant& after = instants_[low % kInstants];
  const double share =
      rtbus::seconds_between(before.time_ns, time_ns) / rtbus::seconds_between(before.time_ns, after.time_ns);
  return before.spring_n[place] + share * (after.spring_n[place] - before.spring_n[place]);
}

std::optional<double> YieldingBody::take(const rtbus::ProxyContacts& answer, std::size_t contact,
                                         const SpringHistory& history, const Vector3d& proxy_m, bool known,
                                         const Tuning& tuning) noexcept {
  const double felt_m = known ? gap_of(proxy_m) : 0.0, before_m = felt_m - offset_m_;
  fades_ = false;
  compliance_m_per_n_ = std::max(tuning.softer * answer.contact_compliance_m_per_n[contact], kStiffest_m_per_n);
  friction_ = answer.contact_friction[contact];
  told_normal_ = vector_of(answer.contact_normal[contact]);
  const Vector3d then_n = history.at(place_, answer.device_time_ns);
  place_m_ =
      vector_of(answer.proxy_position_m) - answer.contact_gap_m[contact] * told_normal_ - compliance_m_per_n_ * then_n;
  if (!touched()) normal_ = told_normal_;
  offset_m_ = 0.0;
  const double gap_m = gap_of(proxy_m);
  if (touched()) {
    offset_m_ = felt_m - gap_m;
    return std::abs(gap_m - before_m);
  }
  offset_m_ = std::max(0.0, -gap_m);
  return std::nullopt;
}

std::size_t YieldingBody::add_rows(const Vector3d& proxy_m, const Vector3d& proxy_m_s, double h, const Blend& blend,
                                   const Tuning& tuning, int self, SolverBody& body, SolverContact* rows,
                                   std::size_t first) noexcept {
  const double share = blend.share(h);
  if (fades_) {
    offset_m_ += tuning.recovery_m_s * h;
  } else {
    offset_m_ -= std::min(share * offset_m_, tuning.recovery_m_s * h);
  }
  normal_ = (normal_ + share * (told_normal_ - normal_)).normalized();
  // Spring k and damper c = hk, implicit over the step: (hc + h²k)·v⁺ = −h·φ + impulses.
  self_ = self;
  body = SolverBody{};
  body.inverse_mass_per_kg = compliance_m_per_n_ / (h * (h + h));
  body.velocity_m_s = -body.inverse_mass_per_kg * h * spring_n_;
  const Vector3d before_n_s = impulse_n_s_;
  impulse_n_s_.setZero();
  const double gap_m = gap_of(proxy_m);
  row_ = kNoRow;
  if (gap_m > -normal_.dot(proxy_m_s - body.velocity_m_s) * h + tuning.reach_m) return 0;
  row_ = first;
  SolverContact& row = rows[first];
  row = SolverContact{};
  row.b = self;
  row.normal = normal_;
  row.closing_m_s = std::max(gap_m / h, -tuning.recovery_m_s);
  row.friction = friction_;
  row.impulse_n_s = before_n_s;  // warm start
  return 1;
}

void YieldingBody::advance(const StepSolution& step, SpringHistory& history) noexcept {
  if (row_ != kNoRow) impulse_n_s_ = step.rows[row_].impulse_n_s;
  spring_n_ += step.h / compliance_m_per_n_ * step.bodies[self_].velocity_m_s;
  history.set(place_, spring_n_);
}

}  // namespace haptic
