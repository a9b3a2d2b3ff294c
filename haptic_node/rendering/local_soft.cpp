#include "haptic_node/rendering/local_soft.hpp"

#include <algorithm>
#include <cmath>

#include "haptic_node/rendering/local_world.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/eigen.hpp"

namespace haptic {
namespace {

using Eigen::Vector3d;

/// A patch is at least this soft: the solver divides by it.
constexpr double kStiffest_m_per_n = 1e-6;

using rtbus::vector_of;

}  // namespace

std::size_t LocalSoft::rigid_rows(const rtbus::ProxyContacts& answer) noexcept {
  std::size_t rows = std::min<std::size_t>(answer.bodies, rtbus::kContactSlots);
  while (rows > 0 && answer.body_kind[rows - 1] == kSoftKind) --rows;
  return rows;
}

void LocalSoft::reset() noexcept {
  for (Patch& patch : patches_) patch = Patch{};
  used_ = rows_ = 0;
  instant_count_ = 0;
}

LocalSoft::Patch* LocalSoft::patch_of(std::uint32_t index) noexcept {
  Patch* free = nullptr;
  for (Patch& patch : patches_) {
    if (patch.used && patch.index == index) return &patch;
    if (!patch.used && free == nullptr) free = &patch;
  }
  if (free == nullptr) return nullptr;
  *free = Patch{};
  free->used = true;
  free->index = index;
  // What was remembered belongs to the one before.
  const auto slot = static_cast<std::size_t>(free - patches_.data());
  for (Instant& instant : instants_) instant.spring_n[slot].setZero();
  return free;
}

Vector3d LocalSoft::spring_at(std::size_t patch, std::uint64_t time_ns) const noexcept {
  const std::uint64_t oldest = instant_count_ > kInstants ? instant_count_ - kInstants : 0;
  std::uint64_t low = oldest, high = instant_count_;
  while (low < high) {
    const std::uint64_t middle = low + (high - low) / 2;
    if (instants_[middle % kInstants].time_ns <= time_ns)
      low = middle + 1;
    else
      high = middle;
  }
  if (low == oldest) return Vector3d::Zero();
  const Instant& before = instants_[(low - 1) % kInstants];
  if (low == instant_count_) return before.spring_n[patch];
  const Instant& after = instants_[low % kInstants];
  const double share =
      rtbus::seconds_between(before.time_ns, time_ns) / rtbus::seconds_between(before.time_ns, after.time_ns);
  return before.spring_n[patch] + share * (after.spring_n[patch] - before.spring_n[patch]);
}

void LocalSoft::take(const rtbus::ProxyContacts& answer, const Vector3d& proxy_m, double blend_s) noexcept {
  const std::size_t first = rigid_rows(answer);
  const std::size_t bodies = std::min<std::size_t>(answer.bodies, rtbus::kContactSlots);
  if (first == bodies && used_ == 0) return;
  blend_s_ = blend_s;
  instant_apart_ns_ = static_cast<std::uint64_t>(kPastSteps * answer.step_s * 1e9 / kInstants);
  for (Patch& patch : patches_) patch.fades = true;
  for (std::size_t i = 0; i < std::min<std::size_t>(answer.contacts, rtbus::kContactSlots); ++i) {
    const std::size_t row = answer.contact_body[i];
    if (row < first || row >= bodies) continue;
    const bool known = std::any_of(patches_.begin(), patches_.end(), [&](const Patch& patch) {
      return patch.used && patch.index == answer.body_index[row];
    });
    Patch* const found = patch_of(answer.body_index[row]);
    if (found == nullptr) continue;  // as many as there is room for: the nearest come first
    Patch& patch = *found;
    const bool touches = !patch.impulse_n_s.isZero(0.0);
    const double felt_m = known ? gap_of(patch, proxy_m) : 0.0;
    const double compliance = std::max(kSofter * answer.contact_compliance_m_per_n[i], kStiffest_m_per_n);
    patch.fades = false;
    patch.compliance_m_per_n = compliance;
    patch.friction = answer.contact_friction[i];
    patch.told_normal = vector_of(answer.contact_normal[i]);
    const Vector3d then_n = spring_at(static_cast<std::size_t>(found - patches_.data()), answer.device_time_ns);
    patch.place_m =
        vector_of(answer.proxy_position_m) - answer.contact_gap_m[i] * patch.told_normal - compliance * then_n;
    if (!touches) patch.normal = patch.told_normal;
    patch.offset_m = 0.0;
    const double gap_m = gap_of(patch, proxy_m);
    if (touches) {
      patch.offset_m = felt_m - gap_m;
    } else if (gap_m < 0.0) {
      patch.offset_m = -gap_m;
    }
  }
  used_ = 0;
  for (Patch& patch : patches_) {
    if (patch.used && patch.fades && patch.impulse_n_s.isZero(0.0)) patch = Patch{};
    used_ += patch.used ? 1 : 0;
  }
}

std::size_t LocalSoft::gather(const Vector3d& proxy_m, const Vector3d& proxy_m_s, double h, SolverBody* bodies,
                              int first_body, SolverContact* rows) noexcept {
  rows_ = 0;
  const double share = -std::expm1(-h / blend_s_);
  for (std::size_t i = 0; i < kPatches; ++i) {
    Patch& patch = patches_[i];
    if (!patch.used) continue;
    if (patch.fades) {
      patch.offset_m += LocalWorld::kRecovery_m_s * h;
    } else {
      patch.offset_m -= std::min(share * patch.offset_m, LocalWorld::kRecovery_m_s * h);
    }
    patch.normal = (patch.normal + share * (patch.told_normal - patch.normal)).normalized();
    // Spring k and damper c, implicit over the step: (hc + h²k)·v⁺ = −h·φ + impulses.
    SolverBody& body = bodies[first_body + static_cast<int>(i)];
    body = SolverBody{};
    body.inverse_mass_per_kg = patch.compliance_m_per_n / (h * (kRelaxation_s + h));
    body.velocity_m_s = -body.inverse_mass_per_kg * h * patch.spring_n;
    const Vector3d before_n_s = patch.impulse_n_s;
    patch.impulse_n_s.setZero();
    const double gap_m = gap_of(patch, proxy_m);
    if (gap_m > -patch.normal.dot(proxy_m_s - body.velocity_m_s) * h + LocalWorld::kReach_m) continue;
    SolverContact& row = rows[rows_];
    row = SolverContact{};
    row.b = first_body + static_cast<int>(i);
    row.normal = patch.normal;
    row.closing_m_s = std::max(gap_m / h, -LocalWorld::kRecovery_m_s);
    row.friction = patch.friction;
    row.impulse_n_s = before_n_s;  // warm start
    row_patch_[rows_++] = i;
  }
  return rows_;
}

void LocalSoft::integrate(const SolverBody* bodies, int first_body, const SolverContact* rows, double h,
                          std::uint64_t sample_ns) noexcept {
  for (std::size_t i = 0; i < rows_; ++i) patches_[row_patch_[i]].impulse_n_s = rows[i].impulse_n_s;
  for (std::size_t i = 0; i < kPatches; ++i) {
    Patch& patch = patches_[i];
    if (!patch.used) continue;
    const Vector3d speed_m_s = bodies[first_body + static_cast<int>(i)].velocity_m_s;
    patch.spring_n += h / patch.compliance_m_per_n * speed_m_s;
  }
  if (instant_count_ > 0 && sample_ns < instants_[(instant_count_ - 1) % kInstants].time_ns + instant_apart_ns_) return;
  Instant& instant = instants_[instant_count_++ % kInstants];
  instant.time_ns = sample_ns;
  for (std::size_t i = 0; i < kPatches; ++i) instant.spring_n[i] = patches_[i].spring_n;
}

}  // namespace haptic
