#pragma once
/// @file hd_unit.hpp
/// The unit behind the stand-in for libHD, and the library's stack of errors. Locked by the library.
#include <cstdint>
#include <deque>

#include <Eigen/Core>

#include "drivers/virtual_vendor/openhaptics/plug.hpp"

namespace drivers::virtual_vendor::openhaptics {

/// HDErrorInfo, returned by value.
struct ErrorInfo {  // plain C: hdGetError returns it
  std::uint32_t code;
  int internal_code;
  std::uint32_t device;
};

/// Newest first; it grows until somebody empties it.
class ErrorStack {
 public:
  void push(std::uint32_t code, int internal_code, std::uint32_t device) {
    errors_.push_back({code, internal_code, device});
  }
  [[nodiscard]] ErrorInfo pop() {
    if (errors_.empty()) return {};
    const ErrorInfo out = errors_.back();
    errors_.pop_back();
    return out;
  }
  void clear() { errors_.clear(); }

 private:
  std::deque<ErrorInfo> errors_;
};

class HdUnit {
 public:
  HdUnit(const Settings& settings, ErrorStack& errors)
      : settings_(settings), unit_(settings.unit), errors_(errors), calibration_(settings.calibration) {}

  /// A servo tick begins: time passes, and faults come.
  void begin_tick(std::uint64_t now_ns);
  void scheduler_started(std::uint64_t now_ns);

  void begin_frame();
  /// What was set in the frame goes to the motors; nothing set: zero.
  void end_frame(std::uint64_t now_ns);
  void set_force(const Eigen::Vector3d& force_n);

  [[nodiscard]] Eigen::Vector3d position_mm(std::uint64_t now_ns);
  [[nodiscard]] bool docked(std::uint64_t now_ns) const noexcept;
  /// As hdCheckCalibration() gives it.
  [[nodiscard]] std::uint32_t check_calibration(std::uint64_t now_ns) noexcept;
  void update_calibration() noexcept;
  [[nodiscard]] bool ticks_stop(std::uint64_t now_ns) const noexcept;

  [[nodiscard]] const Settings& settings() const noexcept { return settings_; }
  [[nodiscard]] Unit& unit() noexcept { return unit_; }
  /// Middle of the usable workspace in the library's coordinates [mm]: not its origin.
  [[nodiscard]] static Eigen::Vector3d centre_mm() noexcept { return {5.0, 60.0, -25.0}; }

  std::uint32_t handle = 0xFFFFFFFF;
  bool initialised = false;
  bool force_output = false;

 private:
  Settings settings_;
  Unit unit_;
  ErrorStack& errors_;
  Calibration calibration_;
  int frame_depth_ = 0;
  int frames_in_tick_ = 0;
  bool force_set_ = false;
  Eigen::Vector3d frame_force_n_ = Eigen::Vector3d::Zero();
  std::uint64_t ramp_from_ns_ = 0;
  std::uint64_t no_force_until_ns_ = 0;
  int ticks_ = 0;
  bool warm_ = false;
  bool uncalibrated_ = false;
  Eigen::Vector3d frozen_m_ = Eigen::Vector3d::Zero();
};

}  // namespace drivers::virtual_vendor::openhaptics
