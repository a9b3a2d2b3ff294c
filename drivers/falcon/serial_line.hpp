#pragma once
/// @file serial_line.hpp
/// Bytes over the Falcon's USB serial chip: writes, reads without the chip's status bytes, line errors counted.
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "drivers/falcon/ftdi.hpp"
#include "drivers/usb/channel.hpp"

namespace drivers::falcon {

[[nodiscard]] constexpr std::uint64_t seconds_to_ns(double seconds) noexcept {
  return static_cast<std::uint64_t>(seconds * 1e9 + 0.5);
}

/// One thread. Deadlines are of the channel's clock.
class SerialLine {
 public:
  explicit SerialLine(usb::Channel& channel) noexcept : channel_(channel) {}

  [[nodiscard]] std::uint64_t now_ns() const noexcept { return channel_.now_ns(); }
  [[nodiscard]] usb::UsbStatus sleep(double seconds) noexcept {
    return channel_.sleep_until(channel_.now_ns() + seconds_to_ns(seconds));
  }
  [[nodiscard]] usb::UsbStatus write(std::span<const std::uint8_t> bytes, std::uint64_t deadline_ns) noexcept {
    return channel_.write(bytes, deadline_ns);
  }

  /// One transfer; its payload goes to `sink(std::span<const std::uint8_t>)`, often none. @realtime No allocation.
  template <class Sink>
  [[nodiscard]] usb::UsbStatus read(Sink&& sink, std::uint64_t deadline_ns) noexcept {
    std::size_t got = 0;
    const usb::UsbStatus status = channel_.read(buffer_, got, deadline_ns);
    if (status == usb::UsbStatus::kOk) line_errors_ += ftdi::for_each_payload(std::span(buffer_).first(got), sink);
    return status;
  }

  /// Appends the payload of one transfer.
  [[nodiscard]] usb::UsbStatus read_some(std::vector<std::uint8_t>& out, std::uint64_t deadline_ns) {
    return read([&out](std::span<const std::uint8_t> part) { out.insert(out.end(), part.begin(), part.end()); },
                deadline_ns);
  }

  /// Appends what has arrived already. Bounded, so that a device that floods the line cannot hold it.
  [[nodiscard]] usb::UsbStatus drain(std::vector<std::uint8_t>& out) {
    for (int transfers = 0; transfers < 64; ++transfers) {
      const usb::UsbStatus status = read_some(out, now_ns());
      if (status == usb::UsbStatus::kTimeout) return usb::UsbStatus::kOk;
      if (status != usb::UsbStatus::kOk) return status;
    }
    return usb::UsbStatus::kOk;
  }

  [[nodiscard]] std::uint64_t line_errors() const noexcept { return line_errors_; }  ///< Packets that reported one.

 private:
  usb::Channel& channel_;
  std::array<std::uint8_t, 4096> buffer_{};  // a channel's transfers are far shorter
  std::uint64_t line_errors_ = 0;
};

}  // namespace drivers::falcon
