#pragma once
/// @file channel.hpp
/// One open USB device with its interfaces claimed, as a driver's protocol sees it: control requests, one bulk OUT and
/// one bulk IN endpoint, and a clock. libusb implements it for real devices; the tests implement it over a virtual
/// device in simulated time.
///
/// Called by one thread, the driver's I/O thread; none of it is realtime.
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace drivers::usb {

/// What a transfer ended with.
enum class UsbStatus : std::uint8_t {
  kOk,
  kTimeout,   ///< Nothing (more) until the deadline.
  kStall,     ///< The device refused; the halt has been cleared.
  kError,     ///< Corrupted on the wire, overflow, cancelled: worth a retry.
  kLost,      ///< Unplugged. Nothing on this channel works any more.
  kStopping,  ///< The driver is to end: give up waiting and return.
};

/// Setup packet of a control request (USB 2.0, 9.3); wLength follows from the data.
struct Setup {
  std::uint8_t request_type = 0;  ///< bmRequestType, without the direction bit 7: the call sets it.
  std::uint8_t request = 0;       ///< bRequest.
  std::uint16_t value = 0;        ///< wValue.
  std::uint16_t index = 0;        ///< wIndex.
};

class Channel {
 public:
  virtual ~Channel() = default;

  /// Now [ns]; CLOCK_MONOTONIC in a real channel. All deadlines are of this clock.
  [[nodiscard]] virtual std::uint64_t now_ns() const noexcept = 0;

  /// Waits until then, or returns kStopping earlier.
  [[nodiscard]] virtual UsbStatus sleep_until(std::uint64_t deadline_ns) noexcept = 0;

  /// Control request towards the device, with `data` as its payload.
  [[nodiscard]] virtual UsbStatus control_out(const Setup& setup, std::span<const std::uint8_t> data,
                                              std::uint64_t deadline_ns) noexcept = 0;

  /// Control request from the device; `got` bytes of `data` were filled.
  [[nodiscard]] virtual UsbStatus control_in(const Setup& setup, std::span<std::uint8_t> data, std::size_t& got,
                                             std::uint64_t deadline_ns) noexcept = 0;

  /// Sends `bytes` to the bulk OUT endpoint and waits until the device has taken them.
  [[nodiscard]] virtual UsbStatus write(std::span<const std::uint8_t> bytes, std::uint64_t deadline_ns) noexcept = 0;

  /// The next completed bulk IN transfer. The channel keeps IN transfers posted, so that nothing is lost between calls
  /// and the call ends when the device has answered, not when a transfer was set up.
  /// @param out At least read_size() bytes. @param got Bytes filled: 0 when the device sent an empty packet.
  [[nodiscard]] virtual UsbStatus read(std::span<std::uint8_t> out, std::size_t& got,
                                       std::uint64_t deadline_ns) noexcept = 0;

  /// Length of a posted IN transfer [byte], a multiple of the endpoint's packet size.
  [[nodiscard]] virtual std::size_t read_size() const noexcept = 0;
};

/// Which device a driver wants and what of it. Endpoint addresses are read from the descriptors.
struct DeviceMatch {
  std::uint16_t vendor_id = 0;
  std::uint16_t product_id = 0;
  std::string serial;                 ///< Empty: the only one; an error when there are several.
  std::vector<int> interfaces = {0};  ///< To claim; bulk endpoints are taken from the last of them.
};

}  // namespace drivers::usb
