#include "drivers/virtual_devices/kinds.hpp"

#include <vector>

#include "drivers/virtual_devices/falcon/virtual_falcon.hpp"
#include "drivers/virtual_devices/phantom/virtual_phantom.hpp"

namespace drivers::virtual_usb {
namespace {

// A new virtual device is one row here: {"falcon", "Novint Falcon", &falcon::parse_virtual}.
const std::vector<Kind>& rows() {
  static const std::vector<Kind> all = {
      {"falcon", "Novint Falcon, homes itself", &parse_virtual_falcon},
      {"phantom", "PHANToM-class arm with Teensy electronics", &parse_virtual_phantom},
  };
  return all;
}

}  // namespace

std::span<const Kind> kinds() noexcept { return rows(); }

const Kind* find_kind(std::string_view name) noexcept {
  for (const Kind& kind : rows()) {
    if (kind.name == name) return &kind;
  }
  return nullptr;
}

}  // namespace drivers::virtual_usb
