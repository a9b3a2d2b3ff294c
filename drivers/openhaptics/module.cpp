// libdrivers_openhaptics.so: the device file, and what the module exports.
#include <dlfcn.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "drivers/beside_program.hpp"
#include "drivers/driver_module.hpp"
#include "drivers/openhaptics/servo_device.hpp"
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
  if (function == nullptr || !function(unit, sizeof unit)) {
    return std::string(stand_in::kLibrary) + " belongs to another build of this program; build both again";
  }
  return {};
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
    if (unit_) {
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
  const std::string name = file.choice("model", names);
  Settings settings;
  settings.model = *std::find_if(models().begin(), models().end(), [&](const Model& m) { return m.name == name; });
  settings.model.limits.model = name;
  settings.model.limits.measures_velocity = true;
  vendor::read_limits(file, settings.model.limits);
  settings.library = file.text("library", "");
  settings.name = file.text("name", "");
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

namespace fs = std::filesystem;

/// Folders in which the setup tool writes one file per device.
std::vector<fs::path> config_folders() {
  std::vector<fs::path> out;
  if (const char* const home = std::getenv("GTDD_HOME"); home != nullptr && *home != '\0') {
    out.push_back(fs::path(home) / "config");
    return out;
  }
  if (const char* const home = std::getenv("HOME")) out.push_back(fs::path(home) / ".3dsystems/config");
  out.emplace_back("/usr/share/3DSystems/config");
  return out;
}

/// The value of `key` in a file of lines "key=value"; empty: not there.
std::string value_in(const fs::path& file, const std::string& key) {
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    if (!line.starts_with(key)) continue;
    const std::size_t equals = line.find('=');
    if (equals == line.npos) continue;
    std::string out = line.substr(equals + 1);
    std::erase_if(out, [](char c) { return c == ' ' || c == '\r' || c == '\t'; });
    return out;
  }
  return {};
}

std::vector<Finding> look_at_configuration() {
  std::vector<Finding> out;
  std::error_code failed;
  fs::path found_in;
  for (const fs::path& folder : config_folders()) {
    for (const auto& entry : fs::directory_iterator(folder, failed)) {
      if (entry.path().extension() != ".config") continue;
      found_in = folder;
      const bool never_set_up = value_in(entry.path(), "Channel") == "300";
      out.push_back({"OpenHaptics device \"" + entry.path().stem().string() + "\"", !never_set_up,
                     entry.path().string() + (never_set_up ? ": Channel 300, never set up" : ""),
                     never_set_up ? "run Touch_HeadlessSetup or Touch_Setup, then TouchCheckup" : ""});
    }
  }
  if (out.empty()) {
    out.push_back({"OpenHaptics devices", false, "none is set up for this user",
                   "run Touch_Setup or Touch_HeadlessSetup as the user that runs rtbus (not by sudo), and export "
                   "GTDD_HOME where it wrote its files (~/.3dsystems or /usr/share/3DSystems)"});
  } else if (const char* const home = std::getenv("GTDD_HOME"); home == nullptr || *home == '\0') {
    out.push_back({"GTDD_HOME", false, "not set, though a device is set up",
                   "export GTDD_HOME=" + found_in.parent_path().string() + " for the user or service that runs rtbus"});
  }
  return out;
}

/// No device is initialised: that takes seconds, and would take it from its user.
std::vector<Finding> look(bool load) {
  std::vector<Finding> out;
  if (!load) return out;
  const auto hd = load_hd("");
  if (!hd) return {{"OpenHaptics", false, "not usable", hd.error()}};
  out.push_back({"OpenHaptics", true, hd->file, ""});
  for (Finding& each : look_at_configuration()) out.push_back(std::move(each));
  return out;
}

}  // namespace
}  // namespace drivers::openhaptics

RTBUS_DRIVER_MODULE_LOOK("openhaptics", "3D Systems Touch, Touch X; SensAble Omni, Desktop, Premium; by OpenHaptics",
                         &drivers::openhaptics::parse, &drivers::openhaptics::look)
