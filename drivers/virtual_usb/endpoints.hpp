#pragma once
/// @file endpoints.hpp
/// Endpoints and interfaces of a configuration descriptor (USB 2.0, chapter 9.6), read from its bytes.
#include <cstdint>
#include <span>
#include <vector>

namespace drivers::virtual_usb {

enum class EndpointType : std::uint8_t { kControl = 0, kIsochronous = 1, kBulk = 2, kInterrupt = 3 };

struct Endpoint {
  std::uint8_t address = 0;  ///< With direction bit 7.
  EndpointType type = EndpointType::kBulk;
  std::uint16_t max_packet = 64;  ///< [byte]
  int interface = 0;
};

struct Configuration {
  std::uint8_t value = 1;       ///< bConfigurationValue.
  std::uint8_t attributes = 0;  ///< bmAttributes.
  std::vector<int> interfaces;
  std::vector<Endpoint> endpoints;

  /// Null when there is none.
  [[nodiscard]] const Endpoint* find(std::uint8_t address) const noexcept;
};

/// Reads what is well-formed; a truncated or broken tail is left out.
[[nodiscard]] Configuration parse_configuration(std::span<const std::uint8_t> bytes);

}  // namespace drivers::virtual_usb
