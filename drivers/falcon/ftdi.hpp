#pragma once
/// @file ftdi.hpp
/// The part of an FTDI FT232R that the Falcon's driver uses: its vendor requests, its baud divisor, and the two status
/// bytes that open every IN packet. Numbers as in Linux' ftdi_sio.h and libftdi; README.md names the sources.
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "drivers/usb/channel.hpp"

namespace drivers::falcon::ftdi {

inline constexpr std::size_t kPacketBytes = 64;   ///< wMaxPacketSize of both bulk endpoints.
inline constexpr std::size_t kStatusBytes = 2;    ///< At the start of every IN packet.
inline constexpr std::size_t kPayloadBytes = 62;  ///< What is left of a packet.

/// bRequest of the vendor requests. bmRequestType is 0x40 (0xC0 when the host reads).
enum Request : std::uint8_t {
  kReset = 0x00,  ///< wValue: 0 everything, 1 and 2 one buffer each.
  kModemControl = 0x01,
  kFlowControl = 0x02,
  kBaudRate = 0x03,
  kDataFormat = 0x04,
  kModemStatus = 0x05,
  kEventCharacter = 0x06,
  kSetLatency = 0x09,
  kGetLatency = 0x0A,
};

/// Second status byte of a packet.
enum LineStatus : std::uint8_t {
  kOverrun = 0x02,
  kParityError = 0x04,
  kFramingError = 0x08,
  kBreak = 0x10,
  kTransmitterEmpty = 0x60,  ///< Both registers: the idle line.
  kFifoError = 0x80,
  kLineErrors = kOverrun | kParityError | kFramingError | kBreak | kFifoError,
};

/// A baud rate as the chip is told it. Base 3 MHz; the divisor has eighths, as a three-bit code.
struct Baud {
  std::uint16_t value = 0;  ///< wValue: integer part, low bits of the code.
  std::uint16_t index = 0;  ///< wIndex: bit 0 is the code's third bit.
  double actual_hz = 0.0;   ///< What the chip really does [baud].

  bool operator==(const Baud& other) const noexcept { return value == other.value && index == other.index; }
};

/// The nearest rate that the chip can do, 183 baud to 3 Mbaud.
[[nodiscard]] Baud baud(double wanted_hz) noexcept;

/// The rate of a divisor as sent by a host. 0 for a divisor that means nothing.
[[nodiscard]] Baud baud_of(std::uint16_t value, std::uint16_t index) noexcept;

/// Walks over the payload of one IN transfer of any length: `sink(std::span<const std::uint8_t>)` gets each packet's
/// bytes without its two status bytes. Returns how many packets reported a line error (LineStatus::kLineErrors).
template <class Sink>
std::size_t for_each_payload(std::span<const std::uint8_t> transfer, Sink&& sink) {
  std::size_t errors = 0;
  while (transfer.size() >= kStatusBytes) {
    const std::size_t length = transfer.size() < kPacketBytes ? transfer.size() : kPacketBytes;
    if ((transfer[1] & kLineErrors) != 0) ++errors;
    if (length > kStatusBytes) sink(transfer.subspan(kStatusBytes, length - kStatusBytes));
    transfer = transfer.subspan(length);
  }
  return errors;
}

/// The chip's requests over a channel. One thread. Each call waits at most one second for the device.
class Port {
 public:
  explicit Port(usb::Channel& channel) noexcept : channel_(channel) {}

  [[nodiscard]] usb::UsbStatus purge() noexcept;  ///< Both buffers, in the customary order.
  [[nodiscard]] usb::UsbStatus set_baud(const Baud& rate) noexcept;
  [[nodiscard]] usb::UsbStatus set_format_8n1() noexcept;
  [[nodiscard]] usb::UsbStatus set_no_flow_control() noexcept;
  [[nodiscard]] usb::UsbStatus set_latency_ms(std::uint8_t latency_ms) noexcept;
  [[nodiscard]] usb::UsbStatus set_dtr(bool high) noexcept;
  [[nodiscard]] usb::UsbStatus set_rts(bool high) noexcept;
  /// The chip then sends a packet as soon as this character has arrived.
  [[nodiscard]] usb::UsbStatus set_event_character(std::uint8_t character, bool enabled) noexcept;

 private:
  [[nodiscard]] usb::UsbStatus request(Request request, std::uint16_t value, std::uint16_t index = 0) noexcept;

  usb::Channel& channel_;
};

}  // namespace drivers::falcon::ftdi
