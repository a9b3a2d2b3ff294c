// libdrivers_openhaptics.so: the device file, and what the module exports.
#include <dlfcn.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "drivers/beside_program.hpp"
#include "drivers/driver_module.hpp"
#include "drivers/openhaptics/servo_device.hpp"
#include "drivers/openhaptics/set_up.hpp"
#include "drivers/vendor/device_keys.hpp"
#include "drivers/virtual_vendor/openhaptics/plug.hpp"

namespace drivers::openhaptics {
namespace {

namespace stand_in = virtual_vendor::openhaptics;
using rtbus::config::Map;

std::string plug(const stand_in::Settings& unit) {
  void* const library = dlopen(find_beside_program(stand_in::kLibrary).c_str(), RTLD_NOW | RTLD_NOLOAD);
  const auto function =
      library == nullptr ? nullptr : reinterpret_cast<stand_in::PlugFunction>(dlsym(library, stand_in::kPlugSymbol));
  using virtual_vendor::Plugged;
  return explain(function == nullptr ? Plugged::kOtherBuild : function(unit, sizeof unit), stand_in::kLibrary);
}

class Config final : public DeviceConfig {
 public:
  Config(Settings settings, std::optional<stand_in::Settings> unit)
      : settings_(std::move(settings)), unit_(std::move(unit)) {}
  [[nodiscard]] const DeviceInfo& info() const noexcept override { return settings_.model.limits; }
  [[nodiscard]] bool has_link() const noexcept override { return true; }
  [[nodiscard]] bool is_virtual() const noexcept override { return unit_.has_value(); }
  [[nodiscard]] rtbus::Result<std::unique_ptr<Device>, DeviceFault> open(const OpenContext& context) const override {
    Settings settings = settings_;
    settings.priority = context.loop_priority + 1;
    settings.core = context.loop_core;
    settings.owner = vendor::owner_name(context);
    if (unit_) {
      settings.names = {unit_->name.empty() ? "the default device" : unit_->name};
      settings.claim = unit_->unit.one_session ? "openhaptics virtual " + unit_->unit.serial : "";
      settings.prepare = [unit = virtual_vendor::seen_by(*unit_, context)] { return plug(unit); };
    }
    return std::unique_ptr<Device>(std::make_unique<ServoDevice>(std::move(settings)));
  }

 private:
  Settings settings_;
  std::optional<stand_in::Settings> unit_;
};

std::unique_ptr<DeviceConfig> parse(Map& file) {
  std::vector<std::string> names;
  for (const Model& model : models()) names.emplace_back(model.name);
  const std::string name = vendor::read_model(file, names);
  Settings settings;
  settings.model = *std::find_if(models().begin(), models().end(), [&](const Model& m) { return m.name == name; });
  settings.model.limits.model = name;
  settings.model.limits.measures_velocity = true;
  vendor::read_limits(file, settings.model.limits);
  settings.library = file.text("library", "");
  settings.name = file.text("name", "");
  settings.claim = "openhaptics " +
                   (settings.name.empty() || settings.name == "Default Device" ? "the default device" : settings.name);
  settings.max_force_wait_s = 1e-6 * file.number("max_force_wait_us", {0.0, 500.0}, 300.0);
  auto map = file.optional_map("virtual");
  if (map && !settings.library.empty()) file.fail("library", "makes no sense with `virtual:`; leave one of them out");
  std::optional<stand_in::Settings> unit;
  if (map) {
    unit = stand_in::read(*map, settings.model.limits,
                          settings.model.model_type.empty() ? "Touch X" : settings.model.model_type);
    map->finish();
    settings.library = find_beside_program(stand_in::kLibrary);
    if (settings.library.empty()) {
      file.fail("virtual", std::string("needs ") + stand_in::kLibrary + "; build the target stand_in_openhaptics");
    }
  }
  return std::make_unique<Config>(std::move(settings), std::move(unit));
}

// --- rtbus devices, rtbus doctor ------------------------------------------------------------------------------------

/// No device is initialised: that takes seconds, and would take it from its user.
std::vector<Finding> look(bool load) {
  std::vector<Finding> out;
  if (!load) return out;
  if (const auto hd = load_hd(""); hd) {
    out.push_back({"OpenHaptics", true, hd->file, ""});
  } else {
    out.push_back({"OpenHaptics", false, "not usable", hd.error()});
    for (Finding& each : look_at_ncurses()) out.push_back(std::move(each));
  }
  for (Finding& each : look_at_configuration()) out.push_back(std::move(each));
  return out;
}

}  // namespace
}  // namespace drivers::openhaptics

RTBUS_DRIVER_MODULE_LOOK("openhaptics", "3D Systems Touch, Touch X; SensAble Omni, Desktop, Premium; by OpenHaptics",
                         &drivers::openhaptics::parse, &drivers::openhaptics::look)
