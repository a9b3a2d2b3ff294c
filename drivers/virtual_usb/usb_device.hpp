#pragma once
/// @file usb_device.hpp
/// A USB device at the level of packets, without threads, clocks or locks: time is handed in. A virtual Falcon or
/// PHANToM implements it on top of its mechanics; UrbQueue turns it into something a host controller would see.
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "drivers/usb/channel.hpp"

namespace drivers::virtual_usb {

/// What the device answers to one packet.
enum class Reply : std::uint8_t {
  kAck,    ///< Taken, or `bytes` given.
  kNak,    ///< Not now; `retry_ns` says when it is worth asking again.
  kStall,  ///< Refused: the endpoint halts until CLEAR_FEATURE (endpoint 0: until the next setup).
};

struct PacketReply {
  Reply reply = Reply::kAck;
  std::vector<std::uint8_t> bytes;  ///< IN data; at most one packet.
  std::uint64_t retry_ns = 0;       ///< For kNak; 0: only after another event.
};

/// Standard descriptors, as bytes on the wire.
struct Descriptors {
  std::vector<std::uint8_t> device;         ///< 18 bytes.
  std::vector<std::uint8_t> configuration;  ///< Whole, wTotalLength bytes.
  std::vector<std::u16string> strings;      ///< Index 1…; language 0x0409.
  bool high_speed = false;                  ///< Else full speed.
};

class UsbDevice {
 public:
  virtual ~UsbDevice() = default;
  [[nodiscard]] virtual const Descriptors& descriptors() const noexcept = 0;

  /// Class and vendor requests (chapter 9 ones are answered by UrbQueue). `setup.request_type` carries its direction
  /// bit here; `data` is the OUT payload; for IN at most `length` bytes are returned.
  [[nodiscard]] virtual PacketReply control(const usb::Setup& setup, std::span<const std::uint8_t> data,
                                            std::uint16_t length, std::uint64_t now_ns) = 0;

  /// One OUT packet (at most wMaxPacketSize bytes) for `endpoint` (without direction bit).
  [[nodiscard]] virtual PacketReply out_packet(std::uint8_t endpoint, std::span<const std::uint8_t> bytes,
                                               std::uint64_t now_ns) = 0;

  /// One IN packet from `endpoint` (without direction bit).
  [[nodiscard]] virtual PacketReply in_packet(std::uint8_t endpoint, std::uint64_t now_ns) = 0;

  /// SET_CONFIGURATION, bus reset, attach: forget halts, keep power and state.
  virtual void bus_reset(std::uint64_t now_ns) = 0;
};

/// Faults on demand, common to all virtual devices. Set by tests or by a script; a model reads what concerns it. Shares
/// are 0…1 [1].
struct Faults {
  double lose_reply = 0.0;       ///< Share of replies that never come (0…1), by the device's seeded generator.
  double late_reply = 0.0;       ///< Share of replies that come `late_ms` later.
  double late_ms = 5.0;          ///< [ms]
  double flip_echo_bit = 0.0;    ///< Share of echoed bytes with one bit wrong (firmware upload).
  double flip_reply_bit = 0.0;   ///< Share of the bytes of replies with one bit wrong.
  double fail_handshake = 0.0;   ///< Share of handshakes that get no answer.
  double split_reply = 0.0;      ///< Share of replies split over two packets.
  double merge_reply = 0.0;      ///< Share of replies held back and sent together with the next.
  double stall_in = 0.0;         ///< Share of IN packets answered by a stall.
  bool status_flood = false;     ///< Empty or status-only packets as fast as asked for.
  bool overrun = false;          ///< The line reports overruns.
  bool mute = false;             ///< Never answers.
  double pause_at_s = -1.0;      ///< Silent for `pause_ms` from then on (from power-up) [s]; < 0: never.
  double pause_ms = 20.0;        ///< [ms]
  double unplug_at_s = -1.0;     ///< Gone from then on [s]; the binding ends the connection. < 0: never.
  double replug_after_s = -1.0;  ///< Back after so long [s]; < 0: never.
};

}  // namespace drivers::virtual_usb
