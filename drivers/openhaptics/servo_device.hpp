#pragma once
/// @file servo_device.hpp
/// A device behind OpenHaptics. The vendor's library owns the servo thread: about 1000 times a second it calls us, and
/// the measurement and its force leave in the same frame.
///
/// Each callback: begin the frame, read pose and buttons, post them to the loop, wait at most 0.3 ms for the force that
/// answers them, set a force, end the frame. A force that comes later is not waited for: the last one is repeated until
/// it is 20 ms old, then zero. A frame in which no force is set sends zero, so a force is set in each. The callback
/// takes no lock and allocates nothing; what it has to tell goes through atomics, and housekeeping makes texts of it.
#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "drivers/device.hpp"
#include "drivers/io/loop_port.hpp"
#include "drivers/openhaptics/hd.hpp"
#include "drivers/openhaptics/models.hpp"
#include "drivers/vendor/claim.hpp"

namespace drivers::openhaptics {

struct Settings {
  Model model;                       ///< With the limits of the device file.
  std::string library;               ///< Empty: the usual names.
  std::string name;                  ///< Of the vendor's configuration; empty: the default device.
  std::vector<std::string> names;    ///< That the library knows; empty: those that are set up on this machine.
  std::string claim;                 ///< What other sessions claim who mean the same device; empty: nobody does.
  std::string owner;                 ///< Whom they are told.
  double max_force_wait_s = 300e-6;  ///< In the callback, for the force that answers its sample [s].
  int priority = 81;                 ///< SCHED_FIFO of the servo thread, one above the loop's.
  int core = -1;
  /// Called once the library is mapped: a stand-in's unit is plugged in. Returns a sentence when that fails.
  std::function<std::string()> prepare;
};

class ServoDevice final : public Device {
 public:
  explicit ServoDevice(Settings settings);
  ~ServoDevice() override { ServoDevice::stop(); }

  [[nodiscard]] const DeviceInfo& info() const noexcept override { return settings_.model.limits; }
  [[nodiscard]] rtbus::Result<void, DeviceFault> start(std::uint64_t now_ns) override;
  /// The library's initialisation cannot be ended: start() fails when it has returned.
  void cancel_start() noexcept override { cancelled_.store(true); }
  [[nodiscard]] IoStatus wait_sample(std::uint64_t deadline_ns) noexcept override {
    return port_.wait_sample(deadline_ns);
  }
  [[nodiscard]] IoStatus read(std::uint64_t now_ns, DeviceSample& out) noexcept RTBUS_NONBLOCKING override {
    return port_.read(now_ns, out);
  }
  [[nodiscard]] IoStatus write(std::uint64_t now_ns, const ForceCommand& command) noexcept RTBUS_NONBLOCKING override {
    return port_.write(now_ns, command);
  }
  [[nodiscard]] std::uint64_t clamped() const noexcept RTBUS_NONBLOCKING override { return port_.clamped(); }
  [[nodiscard]] std::optional<rtbus::LinkStats> link_stats() const override;
  /// Calibration goes on here, and errors become texts.
  void maintain() noexcept override;
  [[nodiscard]] std::string take_notice() override;
  void stop() noexcept override;

 private:
  using Started = rtbus::Result<void, DeviceFault>;
  [[nodiscard]] Started load();
  [[nodiscard]] Started claim();
  [[nodiscard]] Started initialise();
  [[nodiscard]] Started check_model();
  [[nodiscard]] Started start_servo();
  void release() noexcept;
  void calibrate_further();
  void tell(const std::string& text);
  /// Empties the library's stack of errors. @returns the last one that is not harmless.
  [[nodiscard]] ErrorInfo drain() noexcept;

  /// Ticks whose pose is not believed, and before which calibration is not asked for.
  static constexpr std::uint64_t kSettlingTicks = 100;

  // The servo thread's.
  static std::uint32_t servo_callback(void* self);
  std::uint32_t tick() noexcept;
  void note_error(const ErrorInfo& error, std::uint64_t now_ns) noexcept;
  [[nodiscard]] bool measure(DeviceSample& out) noexcept;

  Settings settings_;
  Hd hd_;
  vendor::Claim claim_;
  io::LoopPort port_;
  bool loaded_ = false;
  Handle handle_ = kInvalidHandle;
  SchedulerHandle scheduled_ = 0;
  bool servo_runs_ = false;
  double origin_mm_[3] = {};
  double own_max_force_n_ = 0.0;  ///< What the device itself says; the smaller limit counts.
  std::uint32_t style_ = 0;

  std::atomic<bool> cancelled_{false};
  std::atomic<bool> calibrated_{false};
  std::atomic<bool> ending_{false};  ///< stop() asks the callback to end.
  std::atomic<bool> ended_{false};   ///< The callback has returned for the last time.
  std::atomic<std::uint64_t> ticks_{0}, lost_poses_{0}, limited_{0}, force_errors_{0}, warm_{0}, losses_{0};
  std::atomic<std::uint64_t> last_error_{0};  ///< Code and internal code of the newest one; 0: none since it was told.

  // The servo thread's alone.
  bool device_lost_ = false;
  std::uint64_t force_error_since_ns_ = 0, force_error_ns_ = 0;
  std::uint64_t last_sample_ns_ = 0;
  int last_ticks_ = 0;

  std::mutex life_;   ///< Housekeeping runs beside stop(); neither the loop nor the servo thread takes it.
  std::mutex mutex_;  ///< Of the text.
  std::string notice_;
  bool told_manual_ = false;
  std::uint64_t seen_ticks_ = 0, ticks_seen_ns_ = 0;
  bool told_stopped_ = false;
  std::uint32_t told_error_ = 0;     ///< Code of the newest one that was told, …
  std::uint64_t told_error_ns_ = 0;  ///< … and when it was last there.
};

}  // namespace drivers::openhaptics
