#pragma once
/// @file device.hpp
/// The interface of every device. docs/writing-a-driver.md explains how to write a driver.
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "rtbus/link_messages.hpp"
#include "rtbus/realtime.hpp"
#include "rtbus/result.hpp"

namespace drivers {

using Vec3 = std::array<double, 3>;
using Quat = std::array<double, 4>;  ///< (w, x, y, z)

/// Identity and limits. Constant after the device was opened. The one source of the force limit.
struct DeviceInfo {
  std::string model;                          ///< "phantom_desktop"
  std::string serial;                         ///< Empty when it has none.
  int dof_sensed = 3;                         ///< 3: position; 6: position and orientation.
  int dof_actuated = 3;                       ///< 3: force.
  double max_force_n = 0.0;                   ///< Peak, norm, at the tip [N].
  double continuous_force_n = 0.0;            ///< Force that the motors bear without time limit [N].
  double thermal_time_constant_s = 12.0;      ///< Of the motor windings [s].
  double max_slew_n_per_ms = 3.0;             ///< Growth of the force norm that is safe to feel [N/ms].
  double max_stiffness_n_per_m = 0.0;         ///< Stiffest wall the maker or a measurement allows [N/m].
  double position_quantum_m = 0.0;            ///< Smallest step of the encoders at the tip [m].
  double apparent_mass_kg = 0.0;              ///< At the tip [kg].
  double viscous_damping_n_s_per_m = 0.0;     ///< Of the mechanics, a safe lower bound [N·s/m].
  double coulomb_friction_n = 0.0;            ///< Of the mechanics, a safe lower bound [N].
  double max_speed_m_s = 2.0;                 ///< Faster is a fault: the overspeed cut acts [m/s].
  Vec3 workspace_min_m{-0.08, -0.06, -0.06};  ///< Frame D [m].
  Vec3 workspace_max_m{0.08, 0.06, 0.06};     ///< Frame D [m].
  double force_timeout_s = 0.020;             ///< With no write for so long the device itself goes to zero [s].
  bool simulated = false;                     ///< Mechanics and hand are simulated: nobody can be hurt.
  bool can_pace_loop = false;                 ///< wait_sample() works: `clock: device` is possible.
  bool measures_velocity = false;             ///< DeviceSample::velocity_m_s is the device's own.
  double sample_rate_hz = 0.0;  ///< At which it then paces the loop [Hz]; the loop's rate_hz must be the same.
};

/// One measurement.
struct DeviceSample {
  Vec3 position_m{};                  ///< p_DT [m].
  Quat orientation_wxyz{1, 0, 0, 0};  ///< q_DT.
  std::uint32_t buttons = 0;          ///< Bit i: button i pressed.
  std::uint64_t time_ns = 0;          ///< When it was measured, CLOCK_MONOTONIC.
  Vec3 velocity_m_s{};                ///< v_DT as the device gives it, with DeviceInfo::measures_velocity [m/s].
  double gripper_m = 0.0;             ///< Opening between the fingers of a gripper [m]; 0: closed, or it has none.
};

/// Force on the hand at T, in D.
struct ForceCommand {
  Vec3 force_n{};
};

enum class IoStatus : std::uint8_t {
  kOk,       ///< Done; `out` is current.
  kStale,    ///< No new measurement since the last read; `out` repeats it.
  kTimeout,  ///< wait_sample(): nothing came until the deadline.
  kLost,     ///< The device is gone. The loop renders zero until reads succeed again.
};

/// Why start() failed; the text for people is in DeviceFault::message.
struct DeviceFault {
  std::string message;  ///< What is wrong and what to do about it.
};

/// One haptic device. Life: registry open → start() → read()/write() once per cycle → stop().
/// Frame D: right-handed, origin at the centre of the workspace, x to the user's right, y up, z towards the user.
///
/// Two clocks (docs/architecture.md): with `clock: timer` the loop sleeps to absolute deadlines and calls read();
/// with `clock: device` it blocks in wait_sample() until the device has measured, then calls read(), and the force it
/// writes leaves in the same exchange. Time is always handed in, so that a stepped clock gives bit-identical runs.
class Device {
 public:
  virtual ~Device() = default;  ///< Implementations stop() first: no force outlives the object.

  [[nodiscard]] virtual const DeviceInfo& info() const noexcept = 0;

  /// Claims the device, homes it, starts its I/O thread if it has one. The mechanics of a simulated device start at
  /// `now_ns`. @realtime No; may take seconds.
  [[nodiscard]] virtual rtbus::Result<void, DeviceFault> start(std::uint64_t now_ns) = 0;

  /// Ends a start() that runs in another thread; it then fails soon. Without a running start() it does nothing; call it
  /// again until start() has returned. @realtime No.
  virtual void cancel_start() noexcept {}

  /// `clock: device` only: blocks until a sample newer than the last read is there, at most until `deadline_ns`. May
  /// return kLost at once; the loop then waits for its next period by itself.
  /// @realtime Yes: the loop's one blocking call.
  [[nodiscard]] virtual IoStatus wait_sample(std::uint64_t deadline_ns) noexcept {
    (void)deadline_ns;
    return IoStatus::kTimeout;
  }

  /// Newest tip pose and buttons. @realtime Yes.
  [[nodiscard]] virtual IoStatus read(std::uint64_t now_ns, DeviceSample& out) noexcept RTBUS_NONBLOCKING = 0;

  /// Force on the hand at T in D [N], clamped to info().max_force_n (each clamp is counted: it should stay at zero,
  /// the loop clamps first). A non-finite force counts as zero. Acts until the next write or for force_timeout_s.
  /// Anything but kOk means that it was not taken: the loop counts the device as lost until a write succeeds.
  /// @realtime Yes.
  [[nodiscard]] virtual IoStatus write(std::uint64_t now_ns,
                                       const ForceCommand& command) noexcept RTBUS_NONBLOCKING = 0;

  /// Statistics of the link to the device; none: it has no link that could fail. Any thread. @realtime No.
  [[nodiscard]] virtual std::optional<rtbus::LinkStats> link_stats() const { return std::nullopt; }

  /// Commands that write() had to clamp or refuse since start [count]. @realtime Yes.
  [[nodiscard]] virtual std::uint64_t clamped() const noexcept RTBUS_NONBLOCKING = 0;

  /// Work of the driver outside the loop (re-attach to a restarted plant process). Called about every 20 ms by the
  /// node's housekeeping thread, concurrently with read() and write(). @realtime No.
  virtual void maintain() noexcept {}

  /// A message for the user about changes since the last call; empty: none. Called by the
  /// node's main thread about every 50 ms, concurrently with everything else. @realtime No.
  [[nodiscard]] virtual std::string take_notice() { return {}; }

  virtual void stop() noexcept = 0;  ///< Zero force, then release. Idempotent. @realtime No.
};

}  // namespace drivers
