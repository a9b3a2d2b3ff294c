// libdrivers_force_dimension.so: the device file, and what the module exports.
#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <dlfcn.h>

#include "drivers/beside_program.hpp"
#include "drivers/driver_module.hpp"
#include "drivers/force_dimension/line.hpp"
#include "drivers/io/io_device.hpp"
#include "drivers/vendor/device_keys.hpp"
#include "drivers/virtual_vendor/force_dimension/plug.hpp"
#include "rtbus/config/vector3.hpp"
#include "rtbus/eigen.hpp"

namespace drivers::force_dimension {
namespace {

namespace stand_in = virtual_vendor::force_dimension;
using rtbus::config::Map;

/// Hands the unit to the stand-in's library, which the driver has mapped as it maps the maker's.
std::string plug(const stand_in::Settings& unit) {
  const std::string file = find_beside_program(stand_in::kLibrary);
  void* const library = dlopen(file.c_str(), RTLD_NOW | RTLD_NOLOAD);
  const auto function =
      library == nullptr ? nullptr : reinterpret_cast<stand_in::PlugFunction>(dlsym(library, stand_in::kPlugSymbol));
  using virtual_vendor::Plugged;
  return explain(function == nullptr ? Plugged::kOtherBuild : function(unit, sizeof unit), stand_in::kLibrary);
}

class Config final : public DeviceConfig {
 public:
  Config(Settings settings, DeviceInfo info, std::optional<stand_in::Settings> unit)
      : settings_(std::move(settings)), info_(std::move(info)), unit_(std::move(unit)) {}
  [[nodiscard]] const DeviceInfo& info() const noexcept override { return info_; }
  [[nodiscard]] bool has_link() const noexcept override { return true; }
  [[nodiscard]] bool is_virtual() const noexcept override { return unit_.has_value(); }
  [[nodiscard]] rtbus::Result<std::unique_ptr<Device>, DeviceFault> open(const OpenContext& context) const override {
    io::IoSettings io;
    io.info = info_;
    io.order = io::ExchangeOrder::kReceiveThenSend;
    io.thread_name = "fd_io";
    io.link_name = "Force Dimension";
    const io::IoThread place{.priority = context.loop_priority + 1, .core = context.loop_core};
    Settings settings = settings_;
    settings.owner = vendor::owner_name(context);
    if (unit_) {
      settings.claim = unit_->unit.one_session ? "force_dimension virtual " + unit_->unit.serial : "";
      settings.prepare = [unit = virtual_vendor::seen_by(*unit_, context)] { return plug(unit); };
    }
    return std::unique_ptr<Device>(std::make_unique<io::IoDevice>(
        io, place, [settings] { return std::unique_ptr<io::Line>(std::make_unique<FdLine>(settings)); }));
  }

 private:
  Settings settings_;
  DeviceInfo info_;
  std::optional<stand_in::Settings> unit_;
};

stand_in::Settings read_virtual(Map& map, const Model& model, Settings& settings) {
  stand_in::Settings unit = stand_in::read(map, model.limits, model.types[0], model.product);
  map.finish();
  settings.library = find_beside_program(stand_in::kLibrary);
  if (settings.library.empty())
    map.fail("", std::string("needs ") + stand_in::kLibrary + "; build the target stand_in_force_dimension");
  return unit;
}

const Model& read_model(Map& file) {
  std::vector<std::string> names;
  for (const Model& model : models()) names.emplace_back(model.name);
  const std::string name = vendor::read_model(file, names);
  return *std::find_if(models().begin(), models().end(), [&](const Model& model) { return model.name == name; });
}

std::unique_ptr<DeviceConfig> parse(Map& file) {
  Settings settings;
  settings.model = read_model(file);
  DeviceInfo& info = settings.model.limits;
  info.model = std::string(settings.model.name);
  info.dof_sensed = settings.model.wrist ? 6 : 3;
  info.force_timeout_s = 0.020;
  vendor::read_limits(file, info);
  info.sample_rate_hz = file.number("sample_rate_hz", {100.0, 4000.0}, 1000.0);
  settings.library = file.has("library") ? file.text("library") : "";
  settings.serial = static_cast<int>(file.integer("serial", 1, 65534, 0));
  if (settings.serial != 0 && settings.model.types[0] == 60) {
    file.fail("serial", "is not possible: a Falcon has none in this SDK; leave it out");
  }
  settings.claim = "force_dimension " + (settings.serial == 0 ? "any" : std::to_string(settings.serial));
  info.serial = settings.serial == 0 ? "" : std::to_string(settings.serial);
  settings.auto_init = file.boolean("auto_init", false);
  if (settings.auto_init && !settings.model.calibrates_itself) {
    file.fail("auto_init", std::string("is not possible: a ") + settings.model.product +
                               " is calibrated by moving it by hand; leave it out");
  }
  settings.gravity_compensation = file.boolean("gravity_compensation", true);
  settings.read_velocity = info.measures_velocity = file.boolean("read_velocity", false);
  settings.watchdog_s = 1e-3 * file.number("watchdog_ms", {5.0, 31.0}, 20.0);
  settings.origin_m = rtbus::array_of(rtbus::config::read_vector3(file, "origin_m", {-0.5, 0.5}, {0, 0, 0}));
  auto map = file.optional_map("virtual");
  if (map && !settings.library.empty()) file.fail("library", "makes no sense with `virtual:`; leave one of them out");
  std::optional<stand_in::Settings> unit;
  if (map) unit = read_virtual(*map, settings.model, settings);
  return std::make_unique<Config>(settings, settings.model.limits, std::move(unit));
}

/// What this machine has of the SDK, and which devices it sees. Devices that nobody uses are opened for their serial
/// number, and closed again; nothing is commanded.
std::vector<Finding> look(bool load) {
  std::vector<Finding> out;
  if (!load) return out;
  const auto sdk = load_sdk("");
  if (!sdk) return {{"Force Dimension SDK", false, "not usable", sdk.error()}};
  out.push_back({"Force Dimension SDK", true, sdk->version() + ", " + sdk->file, ""});
  if (!sdk->has_drd()) {
    out.push_back({"libdrd", false, "only libdhd is there", "devices cannot calibrate themselves; install libdrd too"});
  }
  const int count = std::max(0, sdk->dhdGetDeviceCount());
  for (int i = 0; i < count; ++i) {
    const std::string what = "Force Dimension device " + std::to_string(i);
    const int id = sdk->dhdOpenID(static_cast<char>(i));
    if (id < 0) {
      out.push_back({what, false, sdk->last_error(), "close the program that has it"});
      continue;
    }
    unsigned short serial = 0;
    (void)sdk->dhdGetSerialNumber(&serial, static_cast<char>(id));
    const bool ready = sdk->drdIsInitialized == nullptr || sdk->drdIsInitialized(static_cast<char>(id));
    out.push_back({what, ready,
                   product_of(sdk->dhdGetSystemType(static_cast<char>(id))) + ", serial " + std::to_string(serial) +
                       (ready ? ", calibrated" : ", not calibrated"),
                   ready ? "" : "rtbus calibrate calibrates it: it moves by itself"});
    (void)sdk->dhdClose(static_cast<char>(id));
  }
  return out;
}

}  // namespace
}  // namespace drivers::force_dimension

RTBUS_DRIVER_MODULE_LOOK("force_dimension", "Force Dimension omega, delta, sigma, lambda; Falcon; by the maker's SDK",
                         &drivers::force_dimension::parse, &drivers::force_dimension::look)
