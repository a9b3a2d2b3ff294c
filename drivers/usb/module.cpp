// libdrivers_usb.so: the USB drivers behind one C symbol.
#include <algorithm>
#include <vector>

#include "drivers/falcon/falcon_config.hpp"
#include "drivers/phantom/phantom_config.hpp"
#include "drivers/usb/driver_module.hpp"
#include "drivers/usb/libusb_context.hpp"

namespace drivers::usb {
namespace {

// A new USB driver is one row here, one row in drivers/registry.cpp and its library in drivers/usb/CMakeLists.txt:
// {"falcon", 0x0403, 0xcb48, &falcon::parse}.
const std::vector<UsbDriver>& rows() {
  static const std::vector<UsbDriver> all = {
      {"falcon", falcon::kVendorId, falcon::kProductId, &falcon::parse},
      {"phantom", 0x16c0, 0x0483, &phantom::parse},
  };
  return all;
}

FoundDevices list() {
  FoundDevices out;
  const auto context = make_context(true);
  if (!context) {
    out.problem = context.error().message;
    return out;
  }
  for (const UsbListing& each : list_devices(context->get())) {
    FoundDevice found{each.vendor_id,     each.product_id, each.serial, each.product, each.node, {},
                      each.kernel_driver, each.readable,   {}};
    for (const UsbDriver& row : rows()) {
      if (row.vendor_id == each.vendor_id && row.product_id == each.product_id) found.driver = row.name;
    }
    if (!found.driver.empty() && !found.permitted) found.remedy = kUdevRemedy;
    out.devices.push_back(std::move(found));
  }
  return out;
}

std::vector<std::string> kind_names() {
  std::vector<std::string> out;
  for (const virtual_usb::Kind& kind : virtual_usb::kinds()) out.emplace_back(kind.name);
  return out;
}

}  // namespace
}  // namespace drivers::usb

extern "C" const drivers::ModuleHead* rtbus_usb_drivers() {
  using namespace drivers::usb;
  static const UsbModule module{{kUsbAbiVersion}, rows().data(), rows().size(), &list, &drivers::virtual_usb::find_kind,
                                &kind_names};
  return &module.head;
}
