#pragma once
/// @file messages.hpp
/// The samples that the nodes exchange. Frames: D device base (x right, y up, z towards the user), W world
/// (right-handed, y up), T tool tip, P proxy. Quaternions are (w, x, y, z). SI units. Stamps are CLOCK_MONOTONIC.
///
/// A change here changes the type hash: both ends must be rebuilt, and docs/shared-memory-layout.md and CHANGELOG
/// follow.
#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "rtbus/realtime.hpp"
#include "rtbus/sample.hpp"

namespace rtbus {

using Vec3 = std::array<double, 3>;
using Quat = std::array<double, 4>;  ///< (w, x, y, z)
template <std::size_t N>
using Text = std::array<char, N>;

/// Up to the first NUL, or all of it. What is not printable ASCII becomes '?': a segment may hold anything.
template <std::size_t N>
[[nodiscard]] std::string text_of(const Text<N>& text) {
  std::string out(text.begin(), std::find(text.begin(), text.end(), '\0'));
  std::replace_if(
      out.begin(), out.end(), [](char c) { return c < 0x20 || c > 0x7e; }, '?');
  return out;
}

/// The rest is NUL; what is longer than N − 1 is cut.
template <std::size_t N>
void set_text(Text<N>& out, std::string_view text) noexcept {
  out = {};
  std::copy_n(text.begin(), std::min(text.size(), N - 1), out.begin());
}

/// Bodies that a hand may push in one physics step, with a method that simulates the proxy itself.
inline constexpr std::size_t kHandImpulseRows = 4;

/// In DeviceState::hand_impulse_body: all that yields to the tool, soft bodies and very light ones together.
inline constexpr std::uint32_t kYieldingBodies = 0xffffffff;

/// `<haptic>.device_state`, every tick: where the hand is, and where that is in the world.
struct DeviceState {
  Vec3 position_m{};                         ///< p_DT.
  Vec3 velocity_m_s{};                       ///< v_DT, estimated.
  Quat orientation_wxyz{1, 0, 0, 0};         ///< q_DT.
  Vec3 target_position_m{};                  ///< p_WT after the mapping D→W: what the proxy is pulled to.
  Vec3 target_velocity_m_s{};                ///< v_WT.
  Quat target_orientation_wxyz{1, 0, 0, 0};  ///< q_WT.
  double position_scale = 1.0;               ///< Metres of world per metre of device.
  double force_scale = 1.0;                  ///< Newtons in the world per newton at the device.
  double hand_stiffness_n_per_m =
      0.0;  ///< Stiffness K for ProxyState::hand_force_n, at the device; 0: physics computes no force.
  double hand_damping_n_s_per_m = 0.0;  ///< Damping B for it.
  double prediction_periods = 0.0;      ///< Prediction horizon for it in steps (eq. 4); 0: eq. (3).
  std::uint64_t sample_time_ns = 0;     ///< When the device measured the pose.
  std::uint32_t buttons = 0;            ///< Bit i: button i.
  std::uint32_t mapping_epoch = 0;      ///< Grows when the mapping is re-based and each time forces are enabled.
  std::uint32_t enabled = 0;            ///< 1 while forces may act.
  std::uint32_t wants = 0;              ///< What the method needs besides ProxyState: bits of DeviceWants.

  // With kOwnsProxy, in W: impulses of the hand on bodies, up to and including this sample. They are sums, so a sample
  // that is not read loses nothing. The difference of two samples of the same row and generation is the impulse between
  // them.
  std::array<std::uint32_t, kHandImpulseRows> hand_impulse_body{};  ///< In the scene's order, or kYieldingBodies.
  std::array<std::uint32_t, kHandImpulseRows>
      hand_impulse_generation{};  ///< Changes when another body takes the row; its sums start at zero. 0: unused row.
  std::array<Vec3, kHandImpulseRows> hand_impulse_n_s{};            ///< On the body.
  std::array<Vec3, kHandImpulseRows> hand_angular_impulse_n_m_s{};  ///< About its centre of mass.
  std::array<Vec3, kHandImpulseRows>
      hand_impulse_integral_n_s2{};  ///< ∫ impulse dt: gives the mean time of the impulse.

  double gripper_m = 0.0;     ///< Opening between the fingers of a gripper; 0: closed, or the device has none.
  double answer_age_s = 0.0;  ///< How long before this sample that one was measured which the answer in use belongs to:
                              ///< round trip, waiting and step; 0: no answer yet.
};

/// What a gain at the device (a stiffness, a damping) or a mass there is multiplied with to be that of the world: with
/// x_W = s·x_D and F_W = f·F_D, K_W = (f/s)·K_D. @realtime Yes.
[[nodiscard]] constexpr double gain_to_world(double position_scale, double force_scale) noexcept {
  return force_scale / position_scale;
}

/// Bits of DeviceState::wants.
enum DeviceWants : std::uint32_t {
  kWantsContacts = 1u << 0,  ///< ProxyContacts, contact_messages.hpp.
  kOwnsProxy =
      1u << 1,  ///< The method simulates the proxy: the target is that proxy, and bodies receive hand_impulse_… only.
};

/// `physics.proxy_state.<haptic>`, every physics step: the simulated tool, held back by contacts.
struct ProxyState {
  Vec3 position_m{};                  ///< p_WP.
  Vec3 velocity_m_s{};                ///< v_WP.
  Quat orientation_wxyz{1, 0, 0, 0};  ///< q_WP.
  Vec3 angular_velocity_rad_s{};      ///< ω_WP.
  Vec3 coupling_force_n{};            ///< On the proxy by its spring to the device, in W, mean over the step.
  Vec3 contact_force_n{};             ///< On the proxy by the world, in W, mean over the step.
  Vec3 hand_force_n{};                ///< On the hand, computed by physics (eq. 3, 4), in W; zero when
                                      ///< DeviceState::hand_stiffness_n_per_m is 0.
  double coupling_work_j = 0.0;       ///< Work of the world on the coupling at the proxy since mapping_epoch began,
                                      ///< in W: −Σ F·dx. A lost answer loses none of it.
  double step_s = 0.0;                ///< Simulated time this step advanced.
  double step_compute_s = 0.0;        ///< Time the engine took for it.
  std::uint64_t device_sequence = 0;  ///< The DeviceState this step answers; 0: none yet.
  std::uint64_t device_time_ns = 0;   ///< Its sample_time_ns: the time that this proxy belongs to.
  std::uint64_t step_index = 0;       ///< Steps since the world was made, from 1.
  std::uint32_t contacts = 0;         ///< Contacts of the proxy in this step.
  std::uint32_t mapping_epoch = 0;    ///< Of the DeviceState it answers.
};

/// What a node is doing, in Heartbeat::state.
enum class NodeState : std::uint32_t { kStarting = 0, kRunning = 1, kStopping = 2 };

/// Slots of a heartbeat's topic [samples]: 2.5 s at one per 20 ms. Something, say its disk, may hold a recorder for so
/// long.
inline constexpr std::uint32_t kHeartbeatSlots = 128;

/// `<node>.heartbeat`, every 20 ms from a thread of its own: the process is alive and not stopped.
struct Heartbeat {
  std::uint64_t beats = 0;
  std::uint64_t last_work_ns = 0;     ///< When the last step or tick was finished.
  std::uint64_t work_period_ns = 0;   ///< Declared period of the steps or ticks.
  std::uint64_t work_compute_ns = 0;  ///< Compute time of the last step or tick.
  std::uint32_t pid = 0;
  std::uint32_t state = 0;  ///< NodeState.
};

/// `<node>.node_info`, once a second: identity and settings of the node, for tools and reports.
struct NodeInfo {
  Text<16> role{};        ///< "haptic" or "physics".
  Text<32> kind{};        ///< Device model of a haptic node, engine of a physics node.
  Text<32> method{};      ///< Rendering method; empty for physics.
  Text<16> clock{};       ///< "timer" or "device"; "fixed", "throttled" or "free" for physics.
  Text<16> scheduling{};  ///< "SCHED_FIFO" or "SCHED_OTHER", as granted.
  Text<128> realtime{};   ///< RealtimeGrant::summary().
  Text<256> left_out{};   ///< Comma-separated: parts that this session does not load.
  double rate_hz = 0.0;   ///< Declared rate.
  double force_limit_n = 0.0;
  double stiffness_requested_n_per_m = 0.0;
  double stiffness_rendered_n_per_m = 0.0;  ///< After the device's and rate's limit.
  double damping_requested_n_s_per_m = 0.0;
  double damping_rendered_n_s_per_m = 0.0;  ///< After the limits of device and rate, and the method's lower limit.
  std::uint32_t core = 0;                   ///< CPU number, or 0xffffffff when not pinned.
  std::uint32_t bodies = 0;
};

/// `<haptic>.loop_stats`, 5 Hz: counters since start and percentiles over everything since start.
struct LoopStats {
  double rate_hz = 0.0;      ///< Declared.
  double achieved_hz = 0.0;  ///< Ticks served over the last second.
  double wakeup_p50_us = 0.0, wakeup_p99_us = 0.0, wakeup_p999_us = 0.0, wakeup_max_us = 0.0;
  double compute_p50_us = 0.0, compute_p99_us = 0.0, compute_max_us = 0.0;  ///< Without the device's read and write.
  double device_p50_us = 0.0, device_p99_us = 0.0, device_max_us = 0.0;     ///< Device::read plus Device::write.
  double proxy_age_p50_ms = 0.0, proxy_age_p99_ms = 0.0, proxy_age_max_ms = 0.0;
  double force_rms_n = 0.0, force_peak_n = 0.0;  ///< Of the force sent to the device.
  double energy_absorbed_j = 0.0;  ///< Work of the hand on the device's force since start; negative: the device
                                   ///< returned more than it received.
  double energy_removed_j = 0.0;   ///< Removed by the passivity damper.
  /// By how much an answer of physics moved what the hand touched, against what `local_contact` had made of it; at the
  /// device, mean and largest of the answers since start.
  double correction_mean_mm = 0.0, correction_max_mm = 0.0;
  std::uint64_t corrections = 0;  ///< So many answers came while something was touched.
  std::uint64_t ticks_due = 0;    ///< Periods that passed since the loop started.
  std::uint64_t ticks = 0;        ///< Cycles served.
  std::uint64_t overruns = 0;     ///< Periods skipped because a cycle began or ended late.
  std::uint64_t clamped = 0, slew_limited = 0, stale_ticks = 0, nonfinite = 0, overspeed = 0, thermal_limited = 0,
                passivity_ticks = 0, device_lost = 0;  ///< Ticks in which that stage acted.
  std::uint64_t losses = 0;                            ///< Times physics was declared lost.
  std::uint64_t last_loss_ns = 0;                      ///< When; 0: never.
  std::uint64_t pauses = 0;  ///< Times the loop stood for longer than the device holds a force, and began it anew.
};

/// `<haptic>.telemetry`, every tick while an observer is attached: inputs and outputs of the cycle.
struct Telemetry {
  std::uint64_t tick = 0;
  std::uint64_t due_ns = 0;          ///< Deadline this cycle was due at.
  std::uint64_t device_time_ns = 0;  ///< When the device measured the pose.
  Vec3 position_m{};                 ///< p_DT.
  Vec3 velocity_m_s{};               ///< v_DT, estimated.
  Vec3 proxy_position_m{};           ///< p_DP used by this cycle (mapped W→D).
  Vec3 proxy_velocity_m_s{};         ///< v_DP.
  Vec3 rendered_force_n{};           ///< From the method, before safety, in D.
  Vec3 force_n{};                    ///< Force sent to the device, in D.
  double energy_absorbed_j = 0.0;    ///< As in LoopStats.
  double energy_observed_j = 0.0;    ///< E of the passivity observer.
  double gate = 0.0;                 ///< Product of start ramp and stale fade, 0…1.
  double wakeup_us = 0.0;            ///< Start of the cycle after its deadline.
  double compute_us = 0.0;
  double device_us = 0.0;
  std::uint64_t proxy_sequence = 0;  ///< Of the ProxyState used; 0: none.
  std::uint64_t proxy_age_ns = 0;    ///< now − its device_time_ns.
  std::uint32_t safety = 0;          ///< Bits of haptic::SafetyBit that acted.
  std::uint32_t buttons = 0;
};

/// `physics.step_stats`, 5 Hz.
struct StepStats {
  double rate_hz = 0.0;                                            ///< Declared; pace free: the lowest that is exact.
  double achieved_hz = 0.0;                                        ///< Steps over the last second.
  double step_p50_ms = 0.0, step_p99_ms = 0.0, step_max_ms = 0.0;  ///< Engine time per step.
  double simulated_s = 0.0;                                        ///< Sum of the steps.
  double wall_s = 0.0;      ///< Time in which they were due: simulated_s over this is the real-time factor.
  std::uint64_t steps = 0;  ///< Served.
  std::uint64_t due = 0;    ///< Periods that have passed; pace free: steps.
  std::uint64_t late = 0;   ///< Steps that took longer than their period; pace free: steps that were cut to 1/rate_hz.
  std::uint64_t bodies = 0;
};

/// `physics.body_poses`, at most 30 times a second and only while an observer is attached: poses of the scene's bodies.
/// A frame of more than kBodies bodies consists of several samples in order.
struct BodyPoses {
  static constexpr std::uint32_t kBodies = 64;  ///< Bodies in one sample.
  std::uint64_t frame = 0;                      ///< Complete sets since the node started, from 1.
  std::uint64_t step_index = 0;                 ///< The step after which the bodies are here.
  double simulated_s = 0.0;                     ///< Simulated time since the world was made.
  std::uint32_t first_body = 0;                 ///< Scene index (grids unrolled) of the first body in this sample.
  std::uint32_t count = 0;                      ///< Bodies in this sample; the rest of the arrays is zero.
  std::uint32_t bodies = 0;                     ///< Bodies in the frame.
  std::uint32_t reserved = 0;
  std::array<Vec3, kBodies> position_m{};        ///< p_WB.
  std::array<Quat, kBodies> orientation_wxyz{};  ///< q_WB.
};

/// `physics.soft_nodes`, at most 30 times a second, only while an observer is attached, only in scenes with soft
/// bodies: positions of their nodes, body after body. A frame consists of several samples. Whole micrometres take half
/// the memory of metres in double precision.
struct SoftNodes {
  static constexpr std::uint32_t kNodes = 256;  ///< In one sample.
  std::uint64_t frame = 0;                      ///< Complete sets since the node started, from 1.
  std::uint64_t step_index = 0;                 ///< The step after which the nodes are here.
  double simulated_s = 0.0;                     ///< Simulated time since the world was made.
  std::uint32_t first_node = 0;                 ///< Of this sample, counted through all bodies.
  std::uint32_t count = 0;                      ///< Nodes in this sample; the rest of the array is zero.
  std::uint32_t nodes = 0;                      ///< In the frame.
  std::uint32_t reserved = 0;
  std::array<std::array<std::int32_t, 3>, kNodes> position_um{};  ///< p_WN; ±2147 m.
};

/// `<haptic>.plant_command`, every tick with `process: own`: the force for the separate plant process.
struct PlantCommand {
  Vec3 force_n{};  ///< In D.
};

/// `<haptic>.plant_state`, every plant tick with `process: own`: what the device measures and what the hand feels.
struct PlantState {
  Vec3 position_m{};       ///< p_DT, quantised as the encoders do.
  Vec3 true_position_m{};  ///< p_DT of the mechanics.
  Vec3 true_velocity_m_s{};
  Vec3 applied_force_n{};  ///< Actuator force acting on the tip now, in D.
  Vec3 hand_force_n{};     ///< Hand on the tip, in D.
  std::uint64_t sample_time_ns = 0;
  std::uint64_t command_time_ns = 0;  ///< Stamp of the newest command that the plant has taken; 0: none yet.
  std::uint32_t buttons = 0;
  std::uint32_t timed_out = 0;  ///< 1 while the plant applies zero force because no commands arrive.
};

template <>
struct SampleTraits<DeviceState> {
  static constexpr std::string_view kName = "rtbus/DeviceState";
  using T = DeviceState;
  static bool sane(const T& sample, std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING;  // sane_sample.cpp
  static constexpr std::array kFields{RTBUS_FIELD(T, position_m, "m"),
                                      RTBUS_FIELD(T, velocity_m_s, "m/s"),
                                      RTBUS_FIELD(T, orientation_wxyz, "1"),
                                      RTBUS_FIELD(T, target_position_m, "m"),
                                      RTBUS_FIELD(T, target_velocity_m_s, "m/s"),
                                      RTBUS_FIELD(T, target_orientation_wxyz, "1"),
                                      RTBUS_FIELD(T, position_scale, "m/m"),
                                      RTBUS_FIELD(T, force_scale, "N/N"),
                                      RTBUS_FIELD(T, hand_stiffness_n_per_m, "N/m"),
                                      RTBUS_FIELD(T, hand_damping_n_s_per_m, "N.s/m"),
                                      RTBUS_FIELD(T, prediction_periods, "1"),
                                      RTBUS_FIELD(T, sample_time_ns, "ns"),
                                      RTBUS_FIELD(T, buttons, "bits"),
                                      RTBUS_FIELD(T, mapping_epoch, "1"),
                                      RTBUS_FIELD(T, enabled, "bool"),
                                      RTBUS_FIELD(T, wants, "bits"),
                                      RTBUS_FIELD(T, hand_impulse_body, "1"),
                                      RTBUS_FIELD(T, hand_impulse_generation, "1"),
                                      RTBUS_FIELD(T, hand_impulse_n_s, "N.s"),
                                      RTBUS_FIELD(T, hand_angular_impulse_n_m_s, "N.m.s"),
                                      RTBUS_FIELD(T, hand_impulse_integral_n_s2, "N.s2"),
                                      RTBUS_FIELD(T, gripper_m, "m"),
                                      RTBUS_FIELD(T, answer_age_s, "s")};
};
template <>
struct SampleTraits<ProxyState> {
  static constexpr std::string_view kName = "rtbus/ProxyState";
  using T = ProxyState;
  static bool sane(const T& sample, std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING;  // sane_sample.cpp
  static constexpr std::array kFields{
      RTBUS_FIELD(T, position_m, "m"),       RTBUS_FIELD(T, velocity_m_s, "m/s"),
      RTBUS_FIELD(T, orientation_wxyz, "1"), RTBUS_FIELD(T, angular_velocity_rad_s, "rad/s"),
      RTBUS_FIELD(T, coupling_force_n, "N"), RTBUS_FIELD(T, contact_force_n, "N"),
      RTBUS_FIELD(T, hand_force_n, "N"),     RTBUS_FIELD(T, coupling_work_j, "J"),
      RTBUS_FIELD(T, step_s, "s"),           RTBUS_FIELD(T, step_compute_s, "s"),
      RTBUS_FIELD(T, device_sequence, "1"),  RTBUS_FIELD(T, device_time_ns, "ns"),
      RTBUS_FIELD(T, step_index, "1"),       RTBUS_FIELD(T, contacts, "1"),
      RTBUS_FIELD(T, mapping_epoch, "1")};
};
template <>
struct SampleTraits<Heartbeat> {
  static constexpr std::string_view kName = "rtbus/Heartbeat";
  using T = Heartbeat;
  static bool sane(const T& sample, std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING;  // sane_sample.cpp
  static constexpr std::array kFields{RTBUS_FIELD(T, beats, "1"),
                                      RTBUS_FIELD(T, last_work_ns, "ns"),
                                      RTBUS_FIELD(T, work_period_ns, "ns"),
                                      RTBUS_FIELD(T, work_compute_ns, "ns"),
                                      RTBUS_FIELD(T, pid, "1"),
                                      RTBUS_FIELD(T, state, "1")};
};
template <>
struct SampleTraits<NodeInfo> {
  static constexpr std::string_view kName = "rtbus/NodeInfo";
  using T = NodeInfo;
  static bool sane(const T& sample, std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING;  // sane_sample.cpp
  static constexpr std::array kFields{RTBUS_FIELD(T, role, ""),
                                      RTBUS_FIELD(T, kind, ""),
                                      RTBUS_FIELD(T, method, ""),
                                      RTBUS_FIELD(T, clock, ""),
                                      RTBUS_FIELD(T, scheduling, ""),
                                      RTBUS_FIELD(T, realtime, ""),
                                      RTBUS_FIELD(T, left_out, ""),
                                      RTBUS_FIELD(T, rate_hz, "Hz"),
                                      RTBUS_FIELD(T, force_limit_n, "N"),
                                      RTBUS_FIELD(T, stiffness_requested_n_per_m, "N/m"),
                                      RTBUS_FIELD(T, stiffness_rendered_n_per_m, "N/m"),
                                      RTBUS_FIELD(T, damping_requested_n_s_per_m, "N.s/m"),
                                      RTBUS_FIELD(T, damping_rendered_n_s_per_m, "N.s/m"),
                                      RTBUS_FIELD(T, core, "1"),
                                      RTBUS_FIELD(T, bodies, "1")};
};
template <>
struct SampleTraits<LoopStats> {
  static constexpr std::string_view kName = "rtbus/LoopStats";
  using T = LoopStats;
  static bool sane(const T& sample, std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING;  // sane_sample.cpp
  static constexpr std::array kFields{RTBUS_FIELD(T, rate_hz, "Hz"),           RTBUS_FIELD(T, achieved_hz, "Hz"),
                                      RTBUS_FIELD(T, wakeup_p50_us, "us"),     RTBUS_FIELD(T, wakeup_p99_us, "us"),
                                      RTBUS_FIELD(T, wakeup_p999_us, "us"),    RTBUS_FIELD(T, wakeup_max_us, "us"),
                                      RTBUS_FIELD(T, compute_p50_us, "us"),    RTBUS_FIELD(T, compute_p99_us, "us"),
                                      RTBUS_FIELD(T, compute_max_us, "us"),    RTBUS_FIELD(T, device_p50_us, "us"),
                                      RTBUS_FIELD(T, device_p99_us, "us"),     RTBUS_FIELD(T, device_max_us, "us"),
                                      RTBUS_FIELD(T, proxy_age_p50_ms, "ms"),  RTBUS_FIELD(T, proxy_age_p99_ms, "ms"),
                                      RTBUS_FIELD(T, proxy_age_max_ms, "ms"),  RTBUS_FIELD(T, force_rms_n, "N"),
                                      RTBUS_FIELD(T, force_peak_n, "N"),       RTBUS_FIELD(T, energy_absorbed_j, "J"),
                                      RTBUS_FIELD(T, energy_removed_j, "J"),   RTBUS_FIELD(T, correction_mean_mm, "mm"),
                                      RTBUS_FIELD(T, correction_max_mm, "mm"), RTBUS_FIELD(T, corrections, "1"),
                                      RTBUS_FIELD(T, ticks_due, "1"),          RTBUS_FIELD(T, ticks, "1"),
                                      RTBUS_FIELD(T, overruns, "1"),           RTBUS_FIELD(T, clamped, "1"),
                                      RTBUS_FIELD(T, slew_limited, "1"),       RTBUS_FIELD(T, stale_ticks, "1"),
                                      RTBUS_FIELD(T, nonfinite, "1"),          RTBUS_FIELD(T, overspeed, "1"),
                                      RTBUS_FIELD(T, thermal_limited, "1"),    RTBUS_FIELD(T, passivity_ticks, "1"),
                                      RTBUS_FIELD(T, device_lost, "1"),        RTBUS_FIELD(T, losses, "1"),
                                      RTBUS_FIELD(T, last_loss_ns, "ns"),      RTBUS_FIELD(T, pauses, "1")};
};
template <>
struct SampleTraits<Telemetry> {
  static constexpr std::string_view kName = "rtbus/Telemetry";
  using T = Telemetry;
  static bool sane(const T& sample, std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING;  // sane_sample.cpp
  static constexpr std::array kFields{RTBUS_FIELD(T, tick, "1"),
                                      RTBUS_FIELD(T, due_ns, "ns"),
                                      RTBUS_FIELD(T, device_time_ns, "ns"),
                                      RTBUS_FIELD(T, position_m, "m"),
                                      RTBUS_FIELD(T, velocity_m_s, "m/s"),
                                      RTBUS_FIELD(T, proxy_position_m, "m"),
                                      RTBUS_FIELD(T, proxy_velocity_m_s, "m/s"),
                                      RTBUS_FIELD(T, rendered_force_n, "N"),
                                      RTBUS_FIELD(T, force_n, "N"),
                                      RTBUS_FIELD(T, energy_absorbed_j, "J"),
                                      RTBUS_FIELD(T, energy_observed_j, "J"),
                                      RTBUS_FIELD(T, gate, "1"),
                                      RTBUS_FIELD(T, wakeup_us, "us"),
                                      RTBUS_FIELD(T, compute_us, "us"),
                                      RTBUS_FIELD(T, device_us, "us"),
                                      RTBUS_FIELD(T, proxy_sequence, "1"),
                                      RTBUS_FIELD(T, proxy_age_ns, "ns"),
                                      RTBUS_FIELD(T, safety, "bits"),
                                      RTBUS_FIELD(T, buttons, "bits")};
};
template <>
struct SampleTraits<StepStats> {
  static constexpr std::string_view kName = "rtbus/StepStats";
  using T = StepStats;
  static bool sane(const T& sample, std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING;  // sane_sample.cpp
  static constexpr std::array kFields{
      RTBUS_FIELD(T, rate_hz, "Hz"),     RTBUS_FIELD(T, achieved_hz, "Hz"), RTBUS_FIELD(T, step_p50_ms, "ms"),
      RTBUS_FIELD(T, step_p99_ms, "ms"), RTBUS_FIELD(T, step_max_ms, "ms"), RTBUS_FIELD(T, simulated_s, "s"),
      RTBUS_FIELD(T, wall_s, "s"),       RTBUS_FIELD(T, steps, "1"),        RTBUS_FIELD(T, due, "1"),
      RTBUS_FIELD(T, late, "1"),         RTBUS_FIELD(T, bodies, "1")};
};
template <>
struct SampleTraits<BodyPoses> {
  static constexpr std::string_view kName = "rtbus/BodyPoses";
  using T = BodyPoses;
  static bool sane(const T& sample, std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING;  // sane_sample.cpp
  static constexpr std::array kFields{
      RTBUS_FIELD(T, frame, "1"),      RTBUS_FIELD(T, step_index, "1"), RTBUS_FIELD(T, simulated_s, "s"),
      RTBUS_FIELD(T, first_body, "1"), RTBUS_FIELD(T, count, "1"),      RTBUS_FIELD(T, bodies, "1"),
      RTBUS_FIELD(T, reserved, "1"),   RTBUS_FIELD(T, position_m, "m"), RTBUS_FIELD(T, orientation_wxyz, "1")};
};
template <>
struct SampleTraits<SoftNodes> {
  static constexpr std::string_view kName = "rtbus/SoftNodes";
  using T = SoftNodes;
  static bool sane(const T& sample, std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING;  // sane_sample.cpp
  static constexpr std::array kFields{RTBUS_FIELD(T, frame, "1"),       RTBUS_FIELD(T, step_index, "1"),
                                      RTBUS_FIELD(T, simulated_s, "s"), RTBUS_FIELD(T, first_node, "1"),
                                      RTBUS_FIELD(T, count, "1"),       RTBUS_FIELD(T, nodes, "1"),
                                      RTBUS_FIELD(T, reserved, "1"),    RTBUS_FIELD(T, position_um, "um")};
};
template <>
struct SampleTraits<PlantCommand> {
  static constexpr std::string_view kName = "rtbus/PlantCommand";
  using T = PlantCommand;
  static bool sane(const T& sample, std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING;  // sane_sample.cpp
  static constexpr std::array kFields{RTBUS_FIELD(T, force_n, "N")};
};
template <>
struct SampleTraits<PlantState> {
  static constexpr std::string_view kName = "rtbus/PlantState";
  using T = PlantState;
  static bool sane(const T& sample, std::uint64_t stamp_ns) noexcept RTBUS_NONBLOCKING;  // sane_sample.cpp
  static constexpr std::array kFields{RTBUS_FIELD(T, position_m, "m"),          RTBUS_FIELD(T, true_position_m, "m"),
                                      RTBUS_FIELD(T, true_velocity_m_s, "m/s"), RTBUS_FIELD(T, applied_force_n, "N"),
                                      RTBUS_FIELD(T, hand_force_n, "N"),        RTBUS_FIELD(T, sample_time_ns, "ns"),
                                      RTBUS_FIELD(T, command_time_ns, "ns"),    RTBUS_FIELD(T, buttons, "bits"),
                                      RTBUS_FIELD(T, timed_out, "bool")};
};

static_assert(sizeof(DeviceState) == 560 && Sample<DeviceState>);
static_assert(sizeof(ProxyState) == 232 && Sample<ProxyState>);
static_assert(sizeof(Heartbeat) == 40 && Sample<Heartbeat>);
static_assert(sizeof(NodeInfo) == 552 && Sample<NodeInfo>);
static_assert(sizeof(LoopStats) == 288 && Sample<LoopStats>);
static_assert(sizeof(Telemetry) == 240 && Sample<Telemetry>);
static_assert(sizeof(StepStats) == 88 && Sample<StepStats>);
static_assert(sizeof(BodyPoses) == 3624 && Sample<BodyPoses>);
static_assert(sizeof(SoftNodes) == 3112 && Sample<SoftNodes>);
static_assert(sizeof(PlantCommand) == 24 && Sample<PlantCommand>);
static_assert(sizeof(PlantState) == 144 && Sample<PlantState>);

}  // namespace rtbus
