#include <algorithm>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "drivers/falcon/boot_stream.hpp"
#include "drivers/falcon/falcon_config.hpp"
#include "rtbus/config/vector3.hpp"

namespace drivers::falcon {
namespace {

using rtbus::config::Map;
using rtbus::config::Range;

constexpr std::size_t kSyntheticBytes = 8492;  // as long as the usual firmware

// What the weight of arm and ball grip was found to be, by feel, in units of either gain: the same motor commands.
constexpr double kGripMassKg = 0.136;
constexpr double kGripMassLibnifalconKg = 0.090;

void parse_firmware(Map& file, FalconSettings& settings) {
  settings.force_upload = file.boolean("force_upload", false);
  settings.never_probe = file.boolean("never_probe", false);
  settings.patience.attempts = static_cast<int>(file.integer("upload_attempts", 1, 50, settings.patience.attempts));
  settings.patience.slower_on_retry = file.boolean("slower_upload_on_retry", settings.patience.slower_on_retry);
  if (!file.has("firmware")) {
    if (settings.force_upload) file.fail("force_upload", "needs a firmware to load; set firmware: to its file");
    if (settings.never_probe) file.fail("never_probe", "needs a firmware to load; set firmware: to its file");
    return;
  }
  if (file.text("firmware", "") == "synthetic") {
    // Only a virtual Falcon runs it: a real one would load it and stay silent.
    const bool is_virtual = [&file] {
      auto usb = file.optional_map("usb");
      return usb && usb->has("virtual");
    }();
    if (!is_virtual) {
      file.fail("firmware", "is for virtual devices (usb: {virtual: …}); name your copy of the maker's file");
    }
    FirmwareImage image = make_firmware_image(synthetic_boot_stream(kSyntheticBytes), "synthetic").value();
    image.known_as = "synthetic";
    settings.firmware = std::make_shared<const FirmwareImage>(std::move(image));
    return;
  }
  auto image = load_firmware_image(file.existing_file("firmware"));
  if (!image) file.fail("firmware", image.error());
  settings.firmware = std::make_shared<const FirmwareImage>(std::move(*image));
}

void parse_geometry(Map& file, FalconSettings& settings) {
  std::vector<std::string> names;
  for (const Geometry& geometry : geometries()) names.emplace_back(geometry.name);
  const std::string name = file.choice("geometry", names, names.front());
  for (const Geometry& geometry : geometries()) {
    if (geometry.name == name) settings.geometry = geometry;
  }
  constexpr double kRadPerDegree = std::numbers::pi / 180.0;
  const double zero_deg = settings.geometry.zero_angle_rad / kRadPerDegree;
  settings.geometry.zero_angle_rad = file.number("zero_angle_deg", {20.0, 60.0}, zero_deg) * kRadPerDegree;
  settings.centre_m = rtbus::config::read_vector3(file, "centre_m", {-0.05, 0.2}, {0.0, 0.0, 0.120});
  const Kinematics kinematics(settings.geometry);
  if (!kinematics.inverse_rad(settings.centre_m)) {
    file.fail("centre_m", "is out of the grip's reach; choose z between 0.09 and 0.16");
  }
}

void parse_force(Map& file, FalconSettings& settings) {
  const bool lnf = file.choice("force_gain", {"martin_hillier", "libnifalcon"}, "martin_hillier") == "libnifalcon";
  const double calibration = file.number("force_calibration", {0.2, 5.0}, 1.0);
  settings.command_gain = (lnf ? kGainLibnifalcon : kGainMartinHillier) * calibration;
  // The default was found by feel in motor counts: what the calibration makes of a newton does not change it.
  const double by_feel_kg = (lnf ? kGripMassLibnifalconKg : kGripMassKg) / calibration;
  settings.grip_mass_kg = file.number("grip_mass_kg", {0.0, 0.5}, std::min(by_feel_kg, 0.5));
}

DeviceInfo default_info() {
  DeviceInfo info;
  info.model = "novint_falcon";
  info.max_force_n = 8.0;                           // advertised: more than 8.9 N (2 lbf); common drivers limit to 8 N
  info.continuous_force_n = 4.0;                    // own choice: the maker names none
  info.max_slew_n_per_ms = 3.0;                     // own choice, above 2·K·v at 1000 N/m and 0.6 m/s
  info.max_stiffness_n_per_m = 1000.0;              // own choice within the 800 to 3000 N/m of common drivers
  info.position_quantum_m = 45e-6;                  // geometry: one count of one encoder at the centre
  info.apparent_mass_kg = 0.14;                     // two users' observations agree on 0.13 to 0.19 kg
  info.viscous_damping_n_s_per_m = 0.22;            // own choice: 80 % of what a user's stability limit implies
  info.coulomb_friction_n = 0.1;                    // own choice: users call it small
  info.workspace_min_m = {-0.040, -0.040, -0.035};  // a box that the linkage reaches in all its corners
  info.workspace_max_m = {0.040, 0.040, 0.035};
  info.can_pace_loop = true;
  info.sample_rate_hz = 1000.0;  // the USB chip's shortest latency timer is 1 ms
  return info;
}

void parse_limits(Map& map, DeviceInfo& info) {
  info.max_force_n = map.number("max_force_n", {0.1, 12.0}, info.max_force_n);
  info.continuous_force_n =
      map.number("continuous_force_n", {0.01, 12.0}, std::min(info.continuous_force_n, info.max_force_n));
  info.thermal_time_constant_s = map.number("thermal_time_constant_s", {0.1, 3600.0}, info.thermal_time_constant_s);
  info.max_slew_n_per_ms = map.number("max_slew_n_per_ms", {0.01, 100.0}, info.max_slew_n_per_ms);
  info.max_stiffness_n_per_m = map.number("max_stiffness_n_per_m", {1.0, 3000.0}, info.max_stiffness_n_per_m);
  info.max_speed_m_s = map.number("max_speed_m_s", {0.05, 20.0}, info.max_speed_m_s);
  info.viscous_damping_n_s_per_m = map.number("viscous_n_s_per_m", {0.0, 20.0}, info.viscous_damping_n_s_per_m);
  info.coulomb_friction_n = map.number("coulomb_n", {0.0, 5.0}, info.coulomb_friction_n);
  info.force_timeout_s = map.number("force_timeout_ms", {2.0, 50.0}, info.force_timeout_s * 1e3) * 1e-3;
  if (info.continuous_force_n > info.max_force_n) {
    map.fail("continuous_force_n", "exceeds limits.max_force_n; lower it or raise the peak");
  }
}

}  // namespace

FalconFile read_settings(Map& file) {
  FalconFile out;
  out.info = default_info();
  parse_firmware(file, out.settings);
  parse_geometry(file, out.settings);
  parse_force(file, out.settings);
  out.settings.keep_homing_flag = file.boolean("keep_homing_flag", true);
  out.settings.event_character = file.boolean("event_character", false);
  if (auto limits = file.optional_map("limits")) {
    parse_limits(*limits, out.info);
    limits->finish();
  }
  out.settings.max_force_n = out.info.max_force_n;
  return out;
}

}  // namespace drivers::falcon
