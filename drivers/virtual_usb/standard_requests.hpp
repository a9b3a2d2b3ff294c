#pragma once
/// @file standard_requests.hpp
/// The requests that every USB device answers alike (USB 2.0, 9.4): descriptors, configuration, interfaces, halts.
#include <cstdint>
#include <optional>
#include <set>

#include "drivers/virtual_usb/endpoints.hpp"
#include "drivers/virtual_usb/usb_device.hpp"

namespace drivers::virtual_usb {

/// Chapter-9 state of one device: configuration and halts.
class StandardRequests {
 public:
  explicit StandardRequests(UsbDevice& device);

  /// Answers a standard request; nullopt when it is a class or vendor request, which is the device's own.
  [[nodiscard]] std::optional<PacketReply> answer(const usb::Setup& setup, std::uint16_t length, std::uint64_t now_ns);

  [[nodiscard]] bool halted(std::uint8_t endpoint) const noexcept { return halted_.count(endpoint) != 0; }
  void halt(std::uint8_t endpoint) { halted_.insert(endpoint); }
  void clear_halt(std::uint8_t endpoint) { halted_.erase(endpoint); }
  /// Port reset: address and halts are forgotten, the device told.
  void reset(std::uint64_t now_ns);
  [[nodiscard]] std::uint8_t configured() const noexcept { return configured_; }
  [[nodiscard]] const Configuration& configuration() const noexcept { return configuration_; }

 private:
  [[nodiscard]] PacketReply descriptor(std::uint8_t type, std::uint8_t index) const;

  UsbDevice& device_;
  Configuration configuration_;
  std::set<std::uint8_t> halted_;
  std::uint8_t configured_ = 0;
};

}  // namespace drivers::virtual_usb
