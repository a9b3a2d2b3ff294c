#include "drivers/virtual_usb/endpoints.hpp"

#include <algorithm>

namespace drivers::virtual_usb {

namespace {
constexpr std::uint8_t kConfigurationDescriptor = 2, kInterfaceDescriptor = 4, kEndpointDescriptor = 5;
}

const Endpoint* Configuration::find(std::uint8_t address) const noexcept {
  for (const Endpoint& endpoint : endpoints) {
    if (endpoint.address == address) return &endpoint;
  }
  return nullptr;
}

Configuration parse_configuration(std::span<const std::uint8_t> bytes) {
  Configuration out;
  int interface = 0;
  while (bytes.size() >= 2 && bytes[0] >= 2 && bytes[0] <= bytes.size()) {
    const auto one = bytes.first(bytes[0]);
    bytes = bytes.subspan(bytes[0]);
    if (one[1] == kConfigurationDescriptor && one.size() >= 9) {
      out.value = one[5];
      out.attributes = one[7];
    } else if (one[1] == kInterfaceDescriptor && one.size() >= 9) {
      interface = one[2];
      const bool known = std::find(out.interfaces.begin(), out.interfaces.end(), interface) != out.interfaces.end();
      if (!known) out.interfaces.push_back(interface);
    } else if (one[1] == kEndpointDescriptor && one.size() >= 7) {
      const auto size = static_cast<std::uint16_t>((one[4] | one[5] << 8) & 0x7ff);
      out.endpoints.push_back({one[2], static_cast<EndpointType>(one[3] & 3), size, interface});
    }
  }
  return out;
}

}  // namespace drivers::virtual_usb
