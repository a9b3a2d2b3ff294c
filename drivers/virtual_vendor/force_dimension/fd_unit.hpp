#pragma once
/// @file fd_unit.hpp
/// One unit behind the stand-in for libdrd/libdhd: its controller's states. Locked by the library.
///
///     RESET (not calibrated) → IDLE → FORCE ↔ off (button, speed, watchdog, software)
#include <array>
#include <cstdint>

#include <Eigen/Core>

#include "drivers/virtual_vendor/force_dimension/plug.hpp"

namespace drivers::virtual_vendor::force_dimension {

/// Causes of forces being off, as status[14] gives them.
enum class ForceOff : std::uint8_t { kNone = 0, kButton = 1, kVelocity = 2, kWatchdog = 3, kSoftware = 4 };

class FdUnit {
 public:
  explicit FdUnit(const Settings& settings)
      : settings_(settings), unit_(settings.unit), calibrated_(settings.calibrated) {}

  void advance_to(std::uint64_t now_ns);

  [[nodiscard]] const Settings& settings() const noexcept { return settings_; }
  [[nodiscard]] Unit& unit() noexcept { return unit_; }
  [[nodiscard]] bool calibrated() const noexcept { return calibrated_; }
  [[nodiscard]] bool force_on() const noexcept { return force_on_; }
  [[nodiscard]] ForceOff force_off_cause() const noexcept { return cause_; }

  /// Where the tip is, in the maker's frame (x to the user, y right, z up); wrong while it is not calibrated.
  [[nodiscard]] Eigen::Vector3d position(std::uint64_t now_ns);
  /// In the maker's frame.
  [[nodiscard]] Eigen::Vector3d velocity() noexcept;
  /// In the maker's frame. 0: taken; 2: lowered to the limit; −1: refused, since it is not calibrated.
  int set_force(const Eigen::Vector3d& force_n, std::uint64_t now_ns);
  void enable_force(bool on, std::uint64_t now_ns);
  /// The program has been told why forces are off: its user may press the button again from then on.
  void cause_told(std::uint64_t now_ns) noexcept;
  void set_watchdog(std::uint8_t steps) noexcept { watchdog_ns_ = steps * std::uint64_t{125'000}; }
  void auto_init(std::uint64_t now_ns);

  /// How long the call that begins now blocks [us].
  [[nodiscard]] double blocks_us(std::uint64_t now_ns) noexcept;

  bool open = false;
  bool regulating = false;  ///< After drdAutoInit(): the vendor's thread holds the arm, our forces do nothing.
  bool brakes = true;
  bool gravity = true;  ///< Compensation, applied together with forces alone.
  double max_force_n = 1e3;
  double time_guard_us = 0.0;
  std::uint64_t last_state_ns = 0;
  int states = 0;  ///< Positions given since it was opened.
  Eigen::Vector3d last_position = Eigen::Vector3d::Zero();

 private:
  void force_off(ForceOff cause) noexcept;

  Settings settings_;
  Unit unit_;
  bool calibrated_;
  bool force_on_ = false;
  ForceOff cause_ = ForceOff::kNone;
  bool has_blocked_ = false;
  int button_presses_ = 0;           ///< Of the force button.
  std::uint64_t press_told_ns_ = 0;  ///< When the program learned of the first one; 0: not yet.
  std::uint64_t watchdog_ns_ = 0;
  std::uint64_t last_force_ns_ = 0;
};

}  // namespace drivers::virtual_vendor::force_dimension
