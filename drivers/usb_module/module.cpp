// libdrivers_usb.so: the USB drivers behind one C symbol.
#include <algorithm>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "drivers/falcon/falcon_config.hpp"
#include "drivers/phantom/phantom_config.hpp"
#include "drivers/usb_host/libusb_channel.hpp"
#include "drivers/usb_host/libusb_context.hpp"
#include "drivers/usb_host/open_options.hpp"
#include "drivers/usb_module/usb_module.hpp"
#include "drivers/virtual_devices/kinds.hpp"

namespace drivers::usb {
namespace {

using rtbus::config::Map;

struct Row {
  UsbDriver driver;
  std::vector<int> interfaces;
  Inspection (*inspect)(Channel& channel);
  bool ask_unnamed;  ///< Its ids are its own: asking one that the user has not named disturbs no other kind of device.
};

// A new USB driver: a row here, one in drivers/registry/registry.cpp, its library in drivers/usb_module/CMakeLists.txt.
// Without a virtual device its kind is nullptr; without a way to ask the device `inspect` is.
const std::vector<Row>& rows() {
  static const std::vector<Row> all = {
      {{"falcon", falcon::kVendorId, falcon::kProductId,
        [](Map& file) { return falcon::parse(file, virtual_usb::find_kind("falcon")); }},
       {0},
       &falcon::inspect,
       true},
      {{"phantom", phantom::kVendorId, phantom::kProductId,
        [](Map& file) { return phantom::parse(file, virtual_usb::find_kind("phantom")); }},
       {0, 1},
       &phantom::inspect,
       false},
  };
  return all;
}

const std::vector<UsbDriver>& driver_table() {
  static const std::vector<UsbDriver> all = [] {
    std::vector<UsbDriver> out;
    for (const Row& row : rows()) out.push_back(row.driver);
    return out;
  }();
  return all;
}

// A Haply Inverse3 has the ids of a Teensy. One that tells its name is no arm of ours: nothing is sent to it.
const Row* row_of(std::uint16_t vendor_id, std::uint16_t product_id, std::string_view product) {
  if (product.starts_with("Haply")) return nullptr;
  for (const Row& row : rows()) {
    if (row.driver.vendor_id == vendor_id && row.driver.product_id == product_id) return &row;
  }
  return nullptr;
}

class OpenProbe final : public Probe {
 public:
  OpenProbe(ChannelOpener opener, Inspector inspect) : opener_(std::move(opener)), inspect_(std::move(inspect)) {}
  [[nodiscard]] rtbus::Result<void, DeviceFault> open() {
    auto channel = opener_(stop_);
    if (!channel) return rtbus::Failure{channel.error()};
    channel_ = std::move(*channel);
    return {};
  }
  Inspection ask() override { return inspect_(*channel_); }

 private:
  StopFlag stop_;
  ChannelOpener opener_;  ///< Holds a virtual device.
  Inspector inspect_;
  std::unique_ptr<Channel> channel_;
};

rtbus::Result<std::unique_ptr<Probe>, DeviceFault> make_probe(ChannelOpener opener, Inspector inspect) {
  auto probe = std::make_unique<OpenProbe>(std::move(opener), std::move(inspect));
  if (auto opened = probe->open(); !opened) return rtbus::Failure{opened.error()};
  return std::unique_ptr<Probe>(std::move(probe));
}

const UsbDeviceConfig& usb_config(const DeviceConfig& config) { return static_cast<const UsbDeviceConfig&>(config); }

rtbus::Result<std::unique_ptr<Probe>, DeviceFault> probe(const DeviceConfig& config) {
  const UsbDeviceConfig& usb = usb_config(config);
  if (!usb.tooling().inspect) return rtbus::Failure{DeviceFault{"this driver has no way to ask its device"}};
  auto opener = usb.opener();
  if (!opener) return rtbus::Failure{opener.error()};
  return make_probe(std::move(*opener), usb.tooling().inspect);
}

std::optional<Vec3> joint_counts(const DeviceConfig& config, const Vec3& position_m) {
  const UsbDeviceConfig& usb = usb_config(config);
  return usb.tooling().joint_counts ? usb.tooling().joint_counts(position_m) : std::nullopt;
}

void take(FoundDevice& found, rtbus::Result<std::unique_ptr<Probe>, DeviceFault> probe) {
  if (!probe) {
    found.not_asked = probe.error().message;
    return;
  }
  found.says = (*probe)->ask();
  found.asked = true;
  found.remedy = found.says.remedy;
}

/// Asks a device on the bus how it is, unless that could disturb somebody.
void ask(FoundDevice& found, const Row& row, const ListRequest& request) {
  const bool named = !request.named.empty() && found.is(request.named);
  if (!found.permitted) {
    found.not_asked = "not permitted";
  } else if (!found.in_use_by.empty()) {
    found.not_asked = "in use by " + found.in_use_by;
  } else if (row.inspect == nullptr) {
    found.not_asked = "its driver has no way to ask it";
  } else if (!row.ask_unnamed && !named) {
    found.not_asked = "many kinds of device have these USB ids";
    found.remedy = "if it is an arm, `rtbus devices " + found.usb_id() +
                   (found.serial.empty() ? "" : ":" + found.serial) +
                   "` asks it; an older Haply Inverse3 looks the same, and belongs to its service";
  } else if (!found.kernel_driver.empty() && !named) {
    found.not_asked = "the kernel's driver " + found.kernel_driver + " has it";
  } else if (request.ask) {
    const DeviceMatch match{found.vendor_id, found.product_id, found.serial, row.interfaces};
    take(found,
         make_probe([match](StopFlag& stop) { return LibusbChannel::open(match, stop); }, Inspector(row.inspect)));
  }
}

/// A virtual device as the bus would show it.
FoundDevice describe_virtual(const DeviceConfig& config, const ListRequest& request) {
  const UsbDeviceConfig& usb = usb_config(config);
  FoundDevice found;
  found.vendor_id = usb.match().vendor_id;
  found.product_id = usb.match().product_id;
  found.node = "virtual";
  found.permitted = true;
  if (const Row* const row = row_of(found.vendor_id, found.product_id, "")) found.driver = row->driver.name;
  const virtual_usb::VirtualDevice device = usb.make_virtual();
  const auto& strings = device.device->descriptors().strings;  // manufacturer, product, serial; ASCII
  if (strings.size() > 1) found.product.assign(strings[1].begin(), strings[1].end());
  if (strings.size() > 2) found.serial.assign(strings[2].begin(), strings[2].end());
  if (request.ask) take(found, probe(config));
  return found;
}

FoundDevices list(const ListRequest& request) {
  FoundDevices out;
  if (request.virtual_devices.empty()) {
    const auto context = make_context(true);
    if (!context) {
      out.problem = context.error().message;
      return out;
    }
    for (const UsbListing& each : list_devices(context->get())) {
      FoundDevice found;
      found.vendor_id = each.vendor_id;
      found.product_id = each.product_id;
      found.serial = each.serial;
      found.product = each.product;
      found.node = each.node;
      found.kernel_driver = each.kernel_driver;
      found.permitted = each.readable;
      if (const Row* const row = row_of(each.vendor_id, each.product_id, each.product)) {
        found.driver = row->driver.name;
        for (const std::string& user : users_of(each.files)) {
          found.in_use_by += (found.in_use_by.empty() ? "" : ", ") + user;
        }
        ask(found, *row, request);
        if (!found.permitted) found.remedy = kUdevRemedy;
      }
      out.devices.push_back(std::move(found));
    }
  }
  // A process with virtual devices does not look at the bus as well: libusb keeps that choice for the whole process.
  for (const DeviceConfig* const config : request.virtual_devices) {
    out.devices.push_back(describe_virtual(*config, request));
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
  static const UsbModule module{{kUsbAbiVersion},
                                driver_table().data(),
                                driver_table().size(),
                                &list,
                                &probe,
                                &joint_counts,
                                &drivers::virtual_usb::find_kind,
                                &kind_names};
  return &module.head;
}
