#include "drivers/falcon/ftdi.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace drivers::falcon::ftdi {
namespace {

constexpr double kBaseHz = 3e6;
constexpr std::uint64_t kControlTimeoutNs = 1'000'000'000;

// Fraction of the divisor in eighths → its code in bits 14…16.
constexpr std::array<std::uint32_t, 8> kCodeOfEighths{0, 3, 2, 4, 1, 5, 6, 7};

}  // namespace

Baud baud(double wanted_hz) noexcept {
  const double ratio = kBaseHz / std::max(wanted_hz, 1.0);
  auto eighths = static_cast<std::uint32_t>(std::lround(std::clamp(ratio, 1.0, 16383.875) * 8.0));
  // Below 2 only 1 and 1.5 exist.
  if (eighths < 10) {
    eighths = 8;
  } else if (eighths < 14) {
    eighths = 12;
  } else {
    eighths = std::max(eighths, 16U);
  }
  const double actual_hz = kBaseHz * 8.0 / eighths;
  if (eighths == 8) return {0, 0, actual_hz};
  if (eighths == 12) return {1, 0, actual_hz};
  const std::uint32_t code = kCodeOfEighths[eighths % 8];
  return {static_cast<std::uint16_t>((eighths / 8) | ((code & 3U) << 14)), static_cast<std::uint16_t>(code >> 2),
          actual_hz};
}

Baud baud_of(std::uint16_t value, std::uint16_t index) noexcept {
  const auto third_bit = static_cast<std::uint16_t>(index & 1U);
  if (value == 0 && third_bit == 0) return {0, 0, kBaseHz};
  if (value == 1 && third_bit == 0) return {1, 0, kBaseHz / 1.5};
  const std::uint32_t code = (value >> 14) | (static_cast<std::uint32_t>(third_bit) << 2);
  const auto fraction = static_cast<std::uint32_t>(std::find(kCodeOfEighths.begin(), kCodeOfEighths.end(), code) -
                                                   kCodeOfEighths.begin());
  const std::uint32_t eighths = (value & 0x3FFFU) * 8 + fraction;
  return {value, third_bit, eighths < 16 ? 0.0 : kBaseHz * 8.0 / eighths};
}

usb::UsbStatus Port::request(Request request, std::uint16_t value, std::uint16_t index) noexcept {
  const usb::Setup setup{0x40, static_cast<std::uint8_t>(request), value, index};
  return channel_.control_out(setup, {}, channel_.now_ns() + kControlTimeoutNs);
}

usb::UsbStatus Port::purge() noexcept {
  const usb::UsbStatus first = request(kReset, 1);
  return first != usb::UsbStatus::kOk ? first : request(kReset, 2);
}

usb::UsbStatus Port::set_baud(const Baud& rate) noexcept { return request(kBaudRate, rate.value, rate.index); }
usb::UsbStatus Port::set_format_8n1() noexcept { return request(kDataFormat, 8); }
usb::UsbStatus Port::set_no_flow_control() noexcept { return request(kFlowControl, 0); }
usb::UsbStatus Port::set_latency_ms(std::uint8_t latency_ms) noexcept { return request(kSetLatency, latency_ms); }
usb::UsbStatus Port::set_dtr(bool high) noexcept { return request(kModemControl, high ? 0x0101 : 0x0100); }
usb::UsbStatus Port::set_rts(bool high) noexcept { return request(kModemControl, high ? 0x0202 : 0x0200); }
usb::UsbStatus Port::set_event_character(std::uint8_t character, bool enabled) noexcept {
  return request(kEventCharacter, static_cast<std::uint16_t>((enabled ? 0x0100U : 0U) | character));
}

}  // namespace drivers::falcon::ftdi
