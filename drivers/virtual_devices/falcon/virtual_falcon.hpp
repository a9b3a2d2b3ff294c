#pragma once
/// @file virtual_falcon.hpp
/// A whole Novint Falcon at the level of USB packets: FT232R (0403:CB48), board, arm. By default it is kinder than the
/// real one to software that trusts it: a 16-byte reply is never split at the latency timer, and an idle line answers
/// with the two status bytes, never with an empty packet.
#include <cstdint>
#include <string>
#include <vector>

#include "drivers/falcon/ftdi.hpp"
#include "drivers/virtual_devices/bench/bench.hpp"
#include "drivers/virtual_devices/falcon/falcon_arm.hpp"
#include "drivers/virtual_devices/falcon/falcon_board.hpp"
#include "drivers/virtual_usb/kind.hpp"
#include "drivers/virtual_usb/usb_device.hpp"

namespace drivers::virtual_usb {

struct VirtualFalconSettings {
  FalconArmSettings arm = default_falcon_arm();
  FalconBoardSettings board;
  std::string serial = "VF000001";
  BenchSettings bench;
};

/// Powered up at the first time it is handed. One thread at a time.
class VirtualFalcon final : public UsbDevice {
 public:
  explicit VirtualFalcon(VirtualFalconSettings settings);

  [[nodiscard]] const Descriptors& descriptors() const noexcept override { return descriptors_; }
  [[nodiscard]] PacketReply control(const usb::Setup& setup, std::span<const std::uint8_t> data, std::uint16_t length,
                                    std::uint64_t now_ns) override;
  [[nodiscard]] PacketReply out_packet(std::uint8_t endpoint, std::span<const std::uint8_t> bytes,
                                       std::uint64_t now_ns) override;
  [[nodiscard]] PacketReply in_packet(std::uint8_t endpoint, std::uint64_t now_ns) override;
  void bus_reset(std::uint64_t now_ns) override;

  /// Wall power away and back: firmware and homing are gone.
  void power_cycle(std::uint64_t now_ns);

  [[nodiscard]] FalconArm& arm() noexcept { return arm_; }
  [[nodiscard]] FalconBoard& board() noexcept { return board_; }
  [[nodiscard]] Faults& faults() noexcept { return board_.faults(); }
  /// Lets time pass without the bus.
  const simulated::Mechanics& at(std::uint64_t now_ns) {
    arm_.advance_to(now_ns);
    return arm_.mechanics();
  }
  [[nodiscard]] std::uint8_t latency_ms() const noexcept { return latency_ms_; }
  [[nodiscard]] const falcon::ftdi::Baud& baud() const noexcept { return baud_; }
  /// Every control request so far, in order (the first 10,000).
  [[nodiscard]] const std::vector<usb::Setup>& requests() const noexcept { return requests_; }

 private:
  void wake(std::uint64_t now_ns);
  void vendor_request(const usb::Setup& setup, std::uint64_t now_ns);
  void discard_received(std::uint64_t now_ns);
  void drop_overrun(std::uint64_t now_ns);
  [[nodiscard]] bool packet_due(std::uint64_t now_ns, std::size_t& bytes, std::uint64_t& retry_ns) const;

  VirtualFalconSettings settings_;
  FalconArm arm_;
  FalconBoard board_;
  Descriptors descriptors_;
  bool powered_ = false;
  falcon::ftdi::Baud baud_ = falcon::ftdi::baud(9600);
  std::uint8_t latency_ms_ = 16;
  bool event_enabled_ = false;
  std::uint8_t event_character_ = 0;
  std::uint64_t sender_free_ns_ = 0;  ///< When the last byte from the host has left the chip.
  std::uint64_t last_in_ns_ = 0;      ///< When the last packet left: the latency timer runs from then.
  std::uint8_t line_errors_ = 0;      ///< To report in the next packet.
  std::mt19937_64 random_;
  std::vector<usb::Setup> requests_;
};

/// Reads the settings of a virtual Falcon; every key is explained in config/devices/virtual_falcon.yaml. Throws
/// rtbus::config::Error.
[[nodiscard]] VirtualFalconSettings read_virtual_falcon(rtbus::config::Map& settings);

/// The row of the table of kinds.
[[nodiscard]] DeviceMaker parse_virtual_falcon(rtbus::config::Map& settings);

}  // namespace drivers::virtual_usb
