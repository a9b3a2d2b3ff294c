#pragma once
/// @file virtual_phantom.hpp
/// A PHANToM-class arm on the USB: arm and hand (virtual_arm.hpp), the controller's program (phantom_firmware.hpp) and
/// the Teensy's serial interface, packet by packet. Descriptors as PJRC's "USB Serial" type has them (Teensy 4.0).
///
/// The serial interface: a command is worked on 20 µs after it came, at most every 50 µs; what was written leaves 75 µs
/// after the last write; what the host does not read for 120 ms is dropped from then on. A line coding of 134 baud
/// sends the board into its boot loader: it answers nothing any more and its amplifiers are off.
#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "drivers/phantom/phantom_models.hpp"
#include "drivers/virtual_devices/bench/bench.hpp"
#include "drivers/virtual_devices/phantom/phantom_firmware.hpp"
#include "drivers/virtual_devices/phantom/virtual_arm.hpp"
#include "drivers/virtual_usb/kind.hpp"
#include "drivers/virtual_usb/usb_device.hpp"

namespace drivers::virtual_usb {

struct VirtualPhantomSettings {
  phantom::Model model;
  simulated::MechanicsParameters mechanics;
  simulated::Hand hand;
  std::string serial = "1234560";
  bool high_speed = true;
  bool zeroed_at_home = true;           ///< False: the counters are zero where the arm is at power-up.
  bool calibration_needed = false;      ///< The firmware variant that waits for its button.
  bool forgets_when_unplugged = false;  ///< The board has no power of its own: counters zero where the arm is then.
  double button_at_s = -1.0;  ///< Press the calibration button for 50 ms, from the first command [s]; < 0: never.
  std::array<double, 3> gimbal_rad{};  ///< What the gimbal shows, in its sensors' zero and sign.
  std::uint64_t seed = 1;              ///< Of the faults' dice.
  Faults faults;                       ///< From power-up.
  BenchSettings bench;
};

/// Made by the reader's defaults: mechanics from the model's published figures, tip at rest in the workspace's centre.
[[nodiscard]] simulated::MechanicsParameters mechanics_of(const phantom::Model& model);

class VirtualPhantom final : public UsbDevice {
 public:
  static constexpr std::uint8_t kNotifyEndpoint = 2, kOutEndpoint = 3, kInEndpoint = 4;

  explicit VirtualPhantom(VirtualPhantomSettings settings);

  [[nodiscard]] const Descriptors& descriptors() const noexcept override { return descriptors_; }
  [[nodiscard]] PacketReply control(const usb::Setup& setup, std::span<const std::uint8_t> data, std::uint16_t length,
                                    std::uint64_t now_ns) override;
  [[nodiscard]] PacketReply out_packet(std::uint8_t endpoint, std::span<const std::uint8_t> bytes,
                                       std::uint64_t now_ns) override;
  [[nodiscard]] PacketReply in_packet(std::uint8_t endpoint, std::uint64_t now_ns) override;
  void bus_reset(std::uint64_t now_ns) override;

  /// Lets time pass without the bus; for tests and for a binding with nothing to do.
  void advance_to(std::uint64_t now_ns);

  [[nodiscard]] VirtualArm& arm() noexcept { return arm_; }
  [[nodiscard]] PhantomFirmware& firmware() noexcept { return firmware_; }
  [[nodiscard]] Faults& faults() noexcept { return settings_.faults; }
  /// As advance_to().
  const simulated::Mechanics& at(std::uint64_t now_ns) {
    advance_to(now_ns);
    return arm_.mechanics();
  }
  /// Holds or releases the calibration button.
  void hold_button(bool pressed) noexcept { button_held_ = pressed; }
  void set_gimbal(const std::array<double, 3>& rad) noexcept { settings_.gimbal_rad = rad; }
  /// Power off and on: the counters are zero where the arm is.
  void power_cycle(std::uint64_t now_ns);
  [[nodiscard]] bool in_boot_loader() const noexcept { return in_boot_loader_; }
  [[nodiscard]] std::uint64_t dropped_unread() const noexcept { return dropped_unread_; }

 private:
  struct Chunk {
    std::string bytes;
    std::uint64_t ready_ns = 0;
    bool alone = false;  ///< Shares no packet with its neighbours.
  };

  void begin(std::uint64_t now_ns);
  void move_arm(std::uint64_t now_ns);
  void work_until(std::uint64_t now_ns);
  void write(std::string reply, std::uint64_t now_ns);
  void damage(std::string& bytes);
  [[nodiscard]] std::array<std::int32_t, 3> gimbal_counts() const;
  [[nodiscard]] bool paused(std::uint64_t now_ns) const noexcept;
  [[nodiscard]] double since_power_up_s(std::uint64_t now_ns) const noexcept;
  [[nodiscard]] bool strikes(double share) noexcept;

  VirtualPhantomSettings settings_;
  Descriptors descriptors_;
  VirtualArm arm_;
  PhantomFirmware firmware_;
  std::size_t packet_bytes_;

  bool begun_ = false;
  bool script_begun_ = false;
  std::uint64_t power_up_ns_ = 0;
  std::uint64_t script_ns_ = 0;
  std::uint64_t next_loop_ns_ = 0;
  std::uint64_t moved_to_ns_ = 0;
  std::deque<Chunk> transmit_;
  std::string held_back_;
  std::uint64_t unread_since_ns_ = 0;
  bool in_boot_loader_ = false;
  bool forgot_ = false;
  bool button_held_ = false;
  std::array<std::uint8_t, 7> line_coding_{0x80, 0x25, 0, 0, 0, 0, 8};
  std::uint64_t dice_;
  std::uint64_t commands_seen_ = 0;
  std::uint64_t dropped_unread_ = 0;
};

/// The row of the registry.
[[nodiscard]] DeviceMaker parse_virtual_phantom(rtbus::config::Map& settings);

}  // namespace drivers::virtual_usb
