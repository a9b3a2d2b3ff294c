#pragma once
/// @file usbip_wire.hpp
/// Bytes of the USB/IP protocol, version 1.1.1 (Linux Documentation/usb/usbip_protocol.rst): integers big-endian, the
/// eight set-up bytes raw. Pure functions.
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "drivers/virtual_usb/usb_device.hpp"

namespace drivers::virtual_usb::usbip {

using Bytes = std::vector<std::uint8_t>;

inline constexpr std::uint16_t kVersion = 0x0111;
inline constexpr std::size_t kOpHeader = 8;     ///< OP_REQ_DEVLIST, and the head of every OP_ message.
inline constexpr std::size_t kImportSize = 40;  ///< OP_REQ_IMPORT.
inline constexpr std::size_t kUrbHeader = 48;   ///< Of every message after the import.
inline constexpr std::string_view kBusId = "1-1";
inline constexpr std::uint32_t kBusNumber = 1, kDeviceNumber = 2;

enum class OpCode : std::uint16_t { kReqDevlist = 0x8005, kReqImport = 0x8003, kRepDevlist = 5, kRepImport = 3 };
enum class Command : std::uint32_t { kSubmit = 1, kUnlink = 2, kRetSubmit = 3, kRetUnlink = 4 };

[[nodiscard]] std::uint16_t get16(std::span<const std::uint8_t> bytes, std::size_t at);
[[nodiscard]] std::uint32_t get32(std::span<const std::uint8_t> bytes, std::size_t at);

/// OP_REP_DEVLIST with this one device, or none.
[[nodiscard]] Bytes devlist_reply(const Descriptors* device);
/// OP_REP_IMPORT; a null device: refused.
[[nodiscard]] Bytes import_reply(const Descriptors* device);

/// Header of CMD_SUBMIT or CMD_UNLINK.
struct UrbHeader {
  Command command = Command::kSubmit;
  std::uint32_t sequence = 0;
  bool in = false;
  std::uint8_t endpoint = 0;  ///< Number, without direction.
  std::uint32_t flags = 0;    ///< URB_SHORT_NOT_OK 1, URB_ZERO_PACKET 0x40. Submit.
  std::uint32_t length = 0;   ///< transfer_buffer_length. Submit.
  usb::Setup setup;           ///< Endpoint 0.
  std::uint16_t setup_length = 0;
  std::uint32_t unlink = 0;  ///< Sequence number to take back. Unlink.
};

/// Longest transfer that is accepted [byte]; a longer one is a broken stream.
inline constexpr std::uint32_t kLongestTransfer = 1u << 20;

/// False when it is no header of ours: unknown command, endpoint above 15, absurd length, isochronous packets.
[[nodiscard]] bool parse_urb_header(std::span<const std::uint8_t> bytes, UrbHeader& out);

/// @param in Whether the transfer was IN: only then data follow.
[[nodiscard]] Bytes submit_reply(std::uint32_t sequence, bool in, int status, std::size_t actual,
                                 std::span<const std::uint8_t> data);
[[nodiscard]] Bytes unlink_reply(std::uint32_t sequence, int status);

}  // namespace drivers::virtual_usb::usbip
