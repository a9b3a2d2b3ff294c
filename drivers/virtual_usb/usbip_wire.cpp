#include "drivers/virtual_usb/usbip_wire.hpp"

#include <algorithm>
#include <string>

#include "drivers/virtual_usb/endpoints.hpp"

namespace drivers::virtual_usb::usbip {

namespace {

constexpr std::size_t kPathSize = 256, kBusIdSize = 32;
constexpr std::uint32_t kSpeedFull = 2, kSpeedHigh = 3;
constexpr std::uint32_t kNotIsochronous = 0xffffffff;

void put8(Bytes& out, unsigned value) { out.push_back(static_cast<std::uint8_t>(value)); }
void put16(Bytes& out, unsigned value) {
  put8(out, value >> 8 & 0xff);
  put8(out, value & 0xff);
}
void put32(Bytes& out, std::uint32_t value) {
  put16(out, value >> 16);
  put16(out, value & 0xffff);
}
void put_text(Bytes& out, std::string_view text, std::size_t size) {
  const std::size_t end = out.size() + size;
  out.insert(out.end(), text.begin(), text.end());
  out.resize(end, 0);
}

void put_op(Bytes& out, OpCode code, std::uint32_t status) {
  put16(out, kVersion);
  put16(out, static_cast<std::uint16_t>(code));
  put32(out, status);
}

/// The 312 bytes that describe a device.
void put_device(Bytes& out, const Descriptors& device) {
  const Bytes& d = device.device;
  const auto at = [&](std::size_t i) -> unsigned { return i < d.size() ? d[i] : 0; };
  const Configuration configuration = parse_configuration(device.configuration);
  put_text(out, "/sys/devices/virtual/usb/" + std::string(kBusId), kPathSize);
  put_text(out, kBusId, kBusIdSize);
  put32(out, kBusNumber);
  put32(out, kDeviceNumber);
  put32(out, device.high_speed ? kSpeedHigh : kSpeedFull);
  put16(out, at(8) | at(9) << 8);                                     // idVendor
  put16(out, at(10) | at(11) << 8);                                   // idProduct
  put16(out, at(12) | at(13) << 8);                                   // bcdDevice
  for (const unsigned each : {at(4), at(5), at(6)}) put8(out, each);  // class, subclass, protocol
  put8(out, configuration.value);
  put8(out, at(17));
  put8(out, static_cast<unsigned>(configuration.interfaces.size()));
}

/// Class, subclass and protocol of each interface's first setting.
void put_interfaces(Bytes& out, const Descriptors& device) {
  std::span<const std::uint8_t> bytes = device.configuration;
  std::vector<int> seen;
  while (bytes.size() >= 2 && bytes[0] >= 2 && bytes[0] <= bytes.size()) {
    if (bytes[1] == 4 && bytes[0] >= 9 && std::find(seen.begin(), seen.end(), bytes[2]) == seen.end()) {
      seen.push_back(bytes[2]);
      for (const std::size_t i : {5, 6, 7}) put8(out, bytes[i]);
      put8(out, 0);
    }
    bytes = bytes.subspan(bytes[0]);
  }
}

void put_reply(Bytes& out, Command command, std::uint32_t sequence) {
  put32(out, static_cast<std::uint32_t>(command));
  put32(out, sequence);
  for (int i = 0; i < 3; ++i) put32(out, 0);  // devid, direction, endpoint
}

}  // namespace

std::uint16_t get16(std::span<const std::uint8_t> bytes, std::size_t at) {
  return static_cast<std::uint16_t>(bytes[at] << 8 | bytes[at + 1]);
}
std::uint32_t get32(std::span<const std::uint8_t> bytes, std::size_t at) {
  return static_cast<std::uint32_t>(get16(bytes, at)) << 16 | get16(bytes, at + 2);
}

Bytes devlist_reply(const Descriptors* device) {
  Bytes out;
  put_op(out, OpCode::kRepDevlist, 0);
  put32(out, device != nullptr ? 1 : 0);
  if (device != nullptr) {
    put_device(out, *device);
    put_interfaces(out, *device);
  }
  return out;
}

Bytes import_reply(const Descriptors* device) {
  Bytes out;
  put_op(out, OpCode::kRepImport, device != nullptr ? 0 : 1);
  if (device != nullptr) put_device(out, *device);
  return out;
}

bool parse_urb_header(std::span<const std::uint8_t> bytes, UrbHeader& out) {
  if (bytes.size() < kUrbHeader) return false;
  const std::uint32_t command = get32(bytes, 0);
  out.command = static_cast<Command>(command);
  out.sequence = get32(bytes, 4);
  if (out.command == Command::kUnlink) {
    out.unlink = get32(bytes, 20);
    return true;
  }
  const std::uint32_t direction = get32(bytes, 12), endpoint = get32(bytes, 16), packets = get32(bytes, 32);
  if (out.command != Command::kSubmit || direction > 1 || endpoint > 15) return false;
  if (packets != kNotIsochronous && packets != 0) return false;
  out.endpoint = static_cast<std::uint8_t>(endpoint);
  out.flags = get32(bytes, 20);
  out.length = get32(bytes, 24);
  if (out.length > kLongestTransfer) return false;
  const auto raw = bytes.subspan(40, 8);
  out.setup = {raw[0], raw[1], static_cast<std::uint16_t>(raw[2] | raw[3] << 8),
               static_cast<std::uint16_t>(raw[4] | raw[5] << 8)};
  out.setup_length = static_cast<std::uint16_t>(raw[6] | raw[7] << 8);
  out.in = endpoint == 0 ? (raw[0] & 0x80) != 0 : direction == 1;
  // The payload follows the header's direction; the set-up packet must agree, or the stream is out of step.
  if (endpoint == 0 && out.in != (direction == 1) && out.length != 0) return false;
  return true;
}

Bytes submit_reply(std::uint32_t sequence, bool in, int status, std::size_t actual,
                   std::span<const std::uint8_t> data) {
  Bytes out;
  put_reply(out, Command::kRetSubmit, sequence);
  put32(out, static_cast<std::uint32_t>(status));
  put32(out, static_cast<std::uint32_t>(actual));
  put32(out, 0);  // start_frame
  put32(out, kNotIsochronous);
  put32(out, 0);  // error_count
  out.resize(kUrbHeader, 0);
  if (in) out.insert(out.end(), data.begin(), data.begin() + static_cast<std::ptrdiff_t>(actual));
  return out;
}

Bytes unlink_reply(std::uint32_t sequence, int status) {
  Bytes out;
  put_reply(out, Command::kRetUnlink, sequence);
  put32(out, static_cast<std::uint32_t>(status));
  out.resize(kUrbHeader, 0);
  return out;
}

}  // namespace drivers::virtual_usb::usbip
