#pragma once
/// @file phantom_firmware.hpp
/// What the Teensy program of a PHANToM-class arm does with the bytes that come over the serial line: a state machine
/// with the quirks of the published firmware, so that a driver that gets along with it gets along with the device.
///
/// One loop() takes at most one command from the receive queue and gives one answer. Skips to `[`; wants two commas
/// before
/// `]` and counts those before `[` too; 127 bytes of line. After `]` what is left in the queue is thrown away up to the
/// first character that is no LF, CR or NUL, which costs error 8 and the command. Hence two commands that arrive
/// together give two errors and move nothing. Currents beyond ±6000 mA count as 0. An error answer repeats the counters
/// of the answer before, leaves the motor currents as they are and does not feed the watchdog.
#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>

#include "drivers/phantom/phantom_message.hpp"

namespace drivers::virtual_usb {

class PhantomFirmware {
 public:
  static constexpr std::uint64_t kWatchdogNs = 100'000'000;
  static constexpr std::uint64_t kDebounceNs = 10'000'000;

  /// @param calibration_needed The compile-time variant that waits for its button.
  PhantomFirmware(int model, bool magnetic_gimbal, bool calibration_needed);

  void receive(std::span<const std::uint8_t> bytes);
  [[nodiscard]] bool has_input() const noexcept { return !queue_.empty(); }

  /// One turn of the main loop. `arm` and `gimbal` are what the encoders and gimbal sensors show now.
  /// @returns the answer, LF included, when a command was complete.
  [[nodiscard]] std::optional<std::string> loop(std::uint64_t now_ns, const std::array<std::int32_t, 3>& arm,
                                                const std::array<std::int32_t, 3>& gimbal);

  /// The watchdog's interrupt, which cuts the amplifiers whatever the main loop does.
  void watchdog(std::uint64_t now_ns) noexcept;

  /// The calibration button, as long as it is held. Zeroes all counters after the debounce time.
  void button(std::uint64_t now_ns, bool pressed, const std::array<std::int32_t, 3>& arm,
              const std::array<std::int32_t, 3>& gimbal) noexcept;

  /// Power-up: counters are zero where the arm is.
  void power_up(const std::array<std::int32_t, 3>& arm, const std::array<std::int32_t, 3>& gimbal) noexcept;

  /// Bits 1, 2, 4: gimbal sensors that do not answer.
  void fail_gimbal(std::uint32_t bits) noexcept { gimbal_errors_ = bits & phantom::kGimbalErrors; }

  /// Currents that the amplifiers drive [mA], in steps of the 13-bit PWM; zero while they are off.
  [[nodiscard]] std::array<double, 3> currents_ma() const noexcept;
  [[nodiscard]] bool amplifiers_on() const noexcept { return amplifiers_on_; }
  [[nodiscard]] std::uint64_t watchdog_trips() const noexcept { return watchdog_trips_; }
  [[nodiscard]] std::uint64_t rejected() const noexcept { return rejected_; }
  [[nodiscard]] std::uint64_t accepted() const noexcept { return accepted_; }

 private:
  [[nodiscard]] std::optional<std::uint32_t> read_line();
  [[nodiscard]] std::uint32_t parse_line();
  [[nodiscard]] std::string answer(std::uint32_t errors);
  void zero(const std::array<std::int32_t, 3>& arm, const std::array<std::int32_t, 3>& gimbal) noexcept;

  int model_;
  bool magnetic_gimbal_;
  bool calibration_needed_;
  std::deque<std::uint8_t> queue_;
  std::string line_;
  phantom::CurrentsMa parsed_{};
  phantom::CurrentsMa commanded_ma_{};
  std::array<std::int32_t, 3> arm_zero_{}, gimbal_zero_{};
  std::array<std::int32_t, 3> shown_arm_{}, shown_gimbal_{}, read_gimbal_{};
  std::size_t next_gimbal_ = 0;
  std::uint32_t gimbal_errors_ = 0;
  bool amplifiers_on_ = false;
  std::uint64_t fed_ns_ = 0;
  std::uint64_t pressed_since_ns_ = 0;
  bool pressed_ = false;
  std::uint64_t answers_ = 0, watchdog_trips_ = 0, rejected_ = 0, accepted_ = 0;
};

}  // namespace drivers::virtual_usb
