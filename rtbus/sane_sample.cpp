#include "rtbus/sane_sample.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <span>

#include "rtbus/contact_messages.hpp"
#include "rtbus/detail/seqlock.hpp"
#include "rtbus/link_messages.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/order_messages.hpp"
#include "rtbus/shape_messages.hpp"

namespace rtbus {
namespace {

// Largest magnitudes. Positions of a world that is scaled up a thousand times stay far below.
constexpr double kPosition_m = 1e6;
constexpr double kVelocity_m_s = 1e6;
constexpr double kForce_n = 1e9;
constexpr double kScale = 1e6;
constexpr double kUnit = 1.1;       // a component of a unit vector or quaternion
constexpr double kNotUnit = 2e-3;   // of a squared length
constexpr double kRadius_m = 1e-6;  // least
constexpr double kStep_s = 3600.0;  // also of a step's computation
constexpr double kAny = 1e15;       // figures without a narrower limit; nanoseconds made of it fit into 64 bits
constexpr std::uint64_t kLongest_ns = 3600 * kNsPerS;
constexpr std::uint32_t kMostBodies = 1u << 20;
constexpr std::uint32_t kMostPid = 1u << 22;  // Linux, pid_max
constexpr std::uint32_t kMostCores = 1u << 16;
constexpr std::uint32_t kNotPinned = 0xffffffff;

/// False for what is not finite, too.
bool within(double value, double limit) noexcept { return std::abs(value) <= limit; }
bool within(std::span<const double> values, double limit) noexcept {
  return std::all_of(values.begin(), values.end(), [limit](double value) { return within(value, limit); });
}
/// The first `rows` of a table's column.
template <std::size_t N, std::size_t kRows>
bool within(const std::array<std::array<double, N>, kRows>& column, double limit, std::size_t rows = kRows) noexcept {
  return std::all_of(column.begin(), column.begin() + static_cast<std::ptrdiff_t>(rows),
                     [limit](const auto& row) { return within(row, limit); });
}
template <std::size_t kRows>
bool within(const std::array<double, kRows>& column, double limit, std::size_t rows) noexcept {
  return within(std::span(column).first(rows), limit);
}
template <std::size_t kRows>
bool all_below(const std::array<std::uint32_t, kRows>& column, std::uint32_t limit, std::size_t rows) noexcept {
  return std::all_of(column.begin(), column.begin() + static_cast<std::ptrdiff_t>(rows),
                     [limit](std::uint32_t value) { return value < limit; });
}

/// What a unit vector has more or less than a length of 1 is rounding.
template <std::size_t kRows>
bool unit(const std::array<Vec3, kRows>& column, std::size_t rows) noexcept {
  return std::all_of(column.begin(), column.begin() + static_cast<std::ptrdiff_t>(rows), [](const Vec3& row) {
    return within(row[0] * row[0] + row[1] * row[1] + row[2] * row[2] - 1.0, kNotUnit);
  });
}
/// Of a proxy that has a size.
bool radius(double value_m) noexcept { return value_m == 0.0 || (value_m >= kRadius_m && value_m <= kPosition_m); }

/// Gains are divided by it.
bool scale(double value) noexcept { return value >= 1.0 / kScale && value <= kScale; }
bool not_after(std::uint64_t time_ns, std::uint64_t stamp_ns) noexcept {
  return time_ns <= stamp_ns || time_ns - stamp_ns <= kMaxAhead_ns;
}
bool counted(std::uint64_t count) noexcept { return count <= detail::kMaxSequence; }
template <class... Counts>
bool all_counted(Counts... counts) noexcept {
  return (counted(counts) && ...);
}

/// Ended, and free of what a terminal should not be sent.
template <std::size_t N>
bool printable(const Text<N>& text) noexcept {
  for (const char c : text) {
    if (c == '\0') return true;
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) return false;
  }
  return false;
}

template <class T>
bool sane_bytes(const void* sample, std::uint64_t stamp_ns) noexcept {
  T value;
  std::memcpy(&value, sample, sizeof value);
  return SampleTraits<T>::sane(value, stamp_ns);
}

struct Rules {
  std::uint64_t type_hash;
  std::uint32_t bytes;
  SaneBytes sane;
};
template <class... T>
constexpr std::array<Rules, sizeof...(T)> rules_for() noexcept {
  return {Rules{type_hash<T>(), sizeof(T), sane_bytes<T>}...};
}
constexpr auto kRules =
    rules_for<DeviceState, ProxyState, Heartbeat, NodeInfo, LoopStats, Telemetry, StepStats, BodyPoses, SoftNodes,
              PlantCommand, PlantState, ProxyContacts, LinkStats, Orders, BodyOrders, ContactPoints, BodyShapes>();

}  // namespace

SaneBytes rules_of(std::uint64_t type_hash, std::uint32_t sample_bytes) noexcept {
  for (const Rules& rules : kRules) {
    if (rules.type_hash == type_hash && rules.bytes == sample_bytes) return rules.sane;
  }
  return nullptr;
}

bool SampleTraits<DeviceState>::sane(const T& s, std::uint64_t stamp_ns) noexcept {
  return within(s.position_m, kPosition_m) && within(s.velocity_m_s, kVelocity_m_s) &&
         within(s.orientation_wxyz, kUnit) && within(s.target_position_m, kPosition_m) &&
         within(s.target_velocity_m_s, kVelocity_m_s) && within(s.target_orientation_wxyz, kUnit) &&
         scale(s.position_scale) && scale(s.force_scale) && within(s.hand_stiffness_n_per_m, kForce_n) &&
         within(s.hand_damping_n_s_per_m, kForce_n) && within(s.prediction_periods, kScale) &&
         not_after(s.sample_time_ns, stamp_ns) && s.enabled <= 1 && s.wants <= (kWantsContacts | kOwnsProxy) &&
         within(s.hand_impulse_n_s, kForce_n) && within(s.hand_angular_impulse_n_m_s, kForce_n) &&
         within(s.hand_impulse_integral_n_s2, kForce_n) && within(s.gripper_m, kPosition_m) && s.answer_age_s >= 0.0 &&
         within(s.answer_age_s, kStep_s);
}

bool SampleTraits<ProxyState>::sane(const T& s, std::uint64_t stamp_ns) noexcept {
  return within(s.position_m, kPosition_m) && within(s.velocity_m_s, kVelocity_m_s) &&
         within(s.orientation_wxyz, kUnit) && within(s.angular_velocity_rad_s, kForce_n) &&
         within(s.coupling_force_n, kForce_n) && within(s.contact_force_n, kForce_n) &&
         within(s.hand_force_n, kForce_n) && within(s.coupling_work_j, kAny) && within(s.step_s, kStep_s) &&
         within(s.step_compute_s, kStep_s) && not_after(s.device_time_ns, stamp_ns) &&
         all_counted(s.device_sequence, s.step_index);
}

bool SampleTraits<ProxyContacts>::sane(const T& s, std::uint64_t stamp_ns) noexcept {
  if (s.contacts > kContactSlots || s.bodies > kContactSlots || s.supports > kSupportSlots || s.hands > kHandSlots ||
      s.yields > kYieldSlots) {
    return false;
  }
  for (std::size_t i = 0; i < s.hands; ++i) {
    if (!not_after(s.hand_time_ns[i], stamp_ns)) return false;
  }
  const bool head = not_after(s.device_time_ns, stamp_ns) && all_counted(s.device_sequence, s.step_index) &&
                    within(s.step_s, kStep_s) && within(s.radius_m, kPosition_m) &&
                    within(s.proxy_position_m, kPosition_m) && within(s.proxy_velocity_m_s, kVelocity_m_s) &&
                    within(s.proxy_mass_kg, kForce_n) && radius(s.proxy_radius_m);
  const bool contacts =
      all_below(s.contact_body, s.bodies, s.contacts) && within(s.contact_point_m, kPosition_m, s.contacts) &&
      unit(s.contact_normal, s.contacts) && within(s.contact_gap_m, kPosition_m, s.contacts) &&
      within(s.contact_velocity_m_s, kVelocity_m_s, s.contacts) && within(s.contact_friction, kScale, s.contacts) &&
      within(s.contact_curvature_per_m, kAny, s.contacts) && within(s.contact_inverse_mass_per_kg, kAny, s.contacts);
  constexpr std::uint32_t kKinds = 3;  // of body_kind
  const bool bodies =
      all_below(s.body_kind, kKinds, s.bodies) && all_below(s.body_index, kMostBodies, s.bodies) &&
      within(s.body_centre_m, kPosition_m, s.bodies) && within(s.body_orientation_wxyz, kUnit, s.bodies) &&
      within(s.body_origin_from_centre_m, kPosition_m, s.bodies) &&
      within(s.body_velocity_m_s, kVelocity_m_s, s.bodies) &&
      within(s.body_angular_velocity_rad_s, kForce_n, s.bodies) && within(s.body_inverse_mass_per_kg, kAny, s.bodies) &&
      within(s.body_inverse_inertia_per_kg_m2, kAny, s.bodies) && within(s.body_external_force_n, kForce_n, s.bodies) &&
      within(s.body_external_torque_n_m, kForce_n, s.bodies) && within(s.body_friction_force_n, kForce_n, s.bodies) &&
      within(s.body_friction_torque_n_m, kForce_n, s.bodies) && within(s.body_friction_bound_n, kForce_n, s.bodies) &&
      within(s.body_proxy_force_n, kForce_n, s.bodies);
  const bool supports =
      all_below(s.support_body, s.bodies, s.supports) && all_below(s.support_holder, s.bodies + 1, s.supports) &&
      within(s.support_point_m, kPosition_m, s.supports) && unit(s.support_normal, s.supports) &&
      within(s.support_force_n, kForce_n, s.supports) && within(s.support_friction, kScale, s.supports) &&
      within(s.support_velocity_m_s, kVelocity_m_s, s.supports) &&
      within(s.support_inverse_mass_per_kg, kAny, s.supports);
  const bool yields = s.yield_stiffness_n_per_m >= 0.0 && within(s.yield_stiffness_n_per_m, kForce_n) &&
                      s.yield_stiffness_across_n_per_m >= 0.0 && within(s.yield_stiffness_across_n_per_m, kForce_n) &&
                      s.yield_friction >= 0.0 && within(s.yield_friction, kScale) && s.yield_rest >= 0.0 &&
                      s.yield_rest <= 1.0 && within(s.yield_after_s, kStep_s, s.yields) &&
                      within(s.yield_tool_m, kPosition_m, s.yields) && within(s.yield_reaction_n, kForce_n, s.yields) &&
                      within(s.yield_normal, kUnit, s.yields) && within(s.yield_gap_m, kPosition_m, s.yields);
  return head && contacts && bodies && supports && yields;
}

bool SampleTraits<ContactPoints>::sane(const T& s, std::uint64_t) noexcept {
  return s.count <= kContactSlots && counted(s.step_index) && within(s.simulated_s, kAny) &&
         within(s.point_m, kPosition_m, s.count) && within(s.normal, kUnit, s.count) &&
         within(s.gap_m, kPosition_m, s.count) && all_below(s.body_index, kMostBodies, s.count);
}

bool SampleTraits<Heartbeat>::sane(const T& s, std::uint64_t stamp_ns) noexcept {
  return counted(s.beats) && not_after(s.last_work_ns, stamp_ns) && s.work_period_ns <= kLongest_ns &&
         s.work_compute_ns <= kLongest_ns && s.pid <= kMostPid &&
         s.state <= static_cast<std::uint32_t>(NodeState::kStopping);
}

bool SampleTraits<NodeInfo>::sane(const T& s, std::uint64_t) noexcept {
  return printable(s.role) && printable(s.kind) && printable(s.method) && printable(s.clock) &&
         printable(s.scheduling) && printable(s.realtime) && printable(s.left_out) && within(s.rate_hz, kForce_n) &&
         within(s.force_limit_n, kForce_n) && within(s.stiffness_requested_n_per_m, kForce_n) &&
         within(s.stiffness_rendered_n_per_m, kForce_n) && within(s.damping_requested_n_s_per_m, kForce_n) &&
         within(s.damping_rendered_n_s_per_m, kForce_n) && (s.core < kMostCores || s.core == kNotPinned) &&
         s.bodies <= kMostBodies;
}

bool SampleTraits<LoopStats>::sane(const T& s, std::uint64_t stamp_ns) noexcept {
  const double figures[] = {s.rate_hz,          s.achieved_hz,       s.wakeup_p50_us,    s.wakeup_p99_us,
                            s.wakeup_p999_us,   s.wakeup_max_us,     s.compute_p50_us,   s.compute_p99_us,
                            s.compute_max_us,   s.device_p50_us,     s.device_p99_us,    s.device_max_us,
                            s.proxy_age_p50_ms, s.proxy_age_p99_ms,  s.proxy_age_max_ms, s.force_rms_n,
                            s.force_peak_n,     s.energy_absorbed_j, s.energy_removed_j, s.correction_mean_mm,
                            s.correction_max_mm};
  return within(figures, kAny) &&
         all_counted(s.ticks_due, s.ticks, s.overruns, s.clamped, s.slew_limited, s.stale_ticks, s.nonfinite,
                     s.overspeed, s.thermal_limited, s.passivity_ticks, s.device_lost, s.losses, s.pauses,
                     s.corrections) &&
         not_after(s.last_loss_ns, stamp_ns);
}

bool SampleTraits<Telemetry>::sane(const T& s, std::uint64_t stamp_ns) noexcept {
  constexpr std::uint32_t kSafetyBits = 16;
  return all_counted(s.tick, s.proxy_sequence) && not_after(s.due_ns, stamp_ns) &&
         not_after(s.device_time_ns, stamp_ns) && within(s.position_m, kPosition_m) &&
         within(s.velocity_m_s, kVelocity_m_s) && within(s.proxy_position_m, kPosition_m) &&
         within(s.proxy_velocity_m_s, kVelocity_m_s) && within(s.rendered_force_n, kForce_n) &&
         within(s.force_n, kForce_n) && within(s.energy_absorbed_j, kAny) && within(s.energy_observed_j, kAny) &&
         s.gate >= 0.0 && s.gate <= 1.0 && within(s.wakeup_us, kAny) && within(s.compute_us, kAny) &&
         within(s.device_us, kAny) && not_after(s.proxy_age_ns, stamp_ns) && s.safety >> kSafetyBits == 0;
}

bool SampleTraits<StepStats>::sane(const T& s, std::uint64_t) noexcept {
  const double figures[] = {s.rate_hz,     s.achieved_hz, s.step_p50_ms, s.step_p99_ms,
                            s.step_max_ms, s.simulated_s, s.wall_s};
  return within(figures, kAny) && all_counted(s.steps, s.due, s.late) && s.bodies <= kMostBodies;
}

bool SampleTraits<BodyPoses>::sane(const T& s, std::uint64_t) noexcept {
  return s.count <= T::kBodies && s.bodies <= kMostBodies && s.first_body <= s.bodies &&
         s.count <= s.bodies - s.first_body && all_counted(s.frame, s.step_index) && within(s.simulated_s, kAny) &&
         within(s.position_m, kPosition_m, s.count) && within(s.orientation_wxyz, kUnit, s.count);
}

bool SampleTraits<BodyShapes>::sane(const T& s, std::uint64_t stamp_ns) noexcept {
  constexpr std::uint32_t kShapeKinds = static_cast<std::uint32_t>(ShapeKind::kCylinder) + 1, kBodyKinds = 3;
  return s.count <= T::kShapes && s.shapes <= kMostBodies && s.bodies <= kMostBodies && s.first_shape <= s.shapes &&
         s.count <= s.shapes - s.first_shape && not_after(s.epoch, stamp_ns) &&
         all_below(s.body, kMostBodies, s.count) && all_below(s.body_kind, kBodyKinds, s.count) &&
         all_below(s.shape, kShapeKinds, s.count) && within(s.size_m, kPosition_m, s.count) &&
         within(s.position_m, kPosition_m, s.count) && within(s.orientation_wxyz, kUnit, s.count);
}

bool SampleTraits<SoftNodes>::sane(const T& s, std::uint64_t) noexcept {
  constexpr std::uint32_t kMostNodes = 1u << 24;
  return s.count <= T::kNodes && s.nodes <= kMostNodes && s.first_node <= s.nodes &&
         s.count <= s.nodes - s.first_node && all_counted(s.frame, s.step_index) && within(s.simulated_s, kAny);
}

bool SampleTraits<PlantCommand>::sane(const T& s, std::uint64_t) noexcept { return within(s.force_n, kForce_n); }

bool SampleTraits<PlantState>::sane(const T& s, std::uint64_t stamp_ns) noexcept {
  return within(s.position_m, kPosition_m) && within(s.true_position_m, kPosition_m) &&
         within(s.true_velocity_m_s, kVelocity_m_s) && within(s.applied_force_n, kForce_n) &&
         within(s.hand_force_n, kForce_n) && not_after(s.sample_time_ns, stamp_ns) &&
         not_after(s.command_time_ns, stamp_ns) && s.timed_out <= 1;
}

bool SampleTraits<LinkStats>::sane(const T& s, std::uint64_t) noexcept {
  const double figures[] = {s.sample_to_wire_p50_us, s.sample_to_wire_p99_us, s.period_p50_us, s.period_p99_us};
  return within(figures, kAny) && s.state <= static_cast<std::uint32_t>(LinkState::kLost) &&
         all_counted(s.exchanges, s.lost_frames, s.bad_frames, s.resyncs, s.line_errors, s.limited, s.silences,
                     s.late_forces, s.timed_out, s.withheld, s.losses);
}

bool SampleTraits<Orders>::sane(const T& s, std::uint64_t stamp_ns) noexcept {
  return all_counted(s.estops, s.rearms) && within(s.stiffness_n_per_m, kForce_n) &&
         within(s.damping_n_s_per_m, kForce_n) && s.estop <= 1 && printable(s.reason) &&
         within(s.extra_force_n, kForce_n) && s.extra_force_until_ns <= stamp_ns + T::kLongestHold_ns &&
         s.clutched_until_ns <= stamp_ns + T::kLongestHold_ns;
}

bool SampleTraits<BodyOrders>::sane(const T& s, std::uint64_t stamp_ns) noexcept {
  return counted(s.orders) && s.count <= T::kBodies && all_below(s.body, kMostBodies, s.count) &&
         all_below(s.order, 3, s.count) && within(s.position_m, kPosition_m, s.count) &&
         within(s.orientation_wxyz, kUnit, s.count) && within(s.velocity_m_s, kVelocity_m_s, s.count) &&
         within(s.angular_velocity_rad_s, kVelocity_m_s, s.count) &&
         std::all_of(s.until_ns.begin(), s.until_ns.end(),
                     [&](std::uint64_t until_ns) { return until_ns <= stamp_ns + Orders::kLongestHold_ns; });
}

}  // namespace rtbus
