#include "drivers/vendor/device_keys.hpp"

#include <algorithm>

#include "rtbus/config/vector3.hpp"
#include "rtbus/eigen.hpp"

namespace drivers::vendor {

std::string owner_name(const OpenContext& context) {
  return "session " + context.session.name + (context.node_name.empty() ? "" : ", node " + context.node_name);
}

const std::vector<DriverModels>& models_of_vendors() {
  static const std::vector<DriverModels> all{
      {"force_dimension", {"omega3", "omega6", "omega7", "delta3", "delta6", "sigma7", "lambda3", "lambda7", "falcon"}},
      {"openhaptics", {"touch", "touch_x", "omni", "desktop", "premium_1_5", "premium_3_0"}},
      {"haply", {"inverse3", "minverse"}}};
  return all;
}

std::string read_model(rtbus::config::Map& file, const std::vector<std::string>& names) {
  const std::string asked = file.has("model") ? file.text("model") : "";
  if (std::find(names.begin(), names.end(), asked) == names.end()) {
    for (const DriverModels& other : models_of_vendors()) {
      if (std::find(other.models.begin(), other.models.end(), asked) == other.models.end()) continue;
      std::string own;
      for (const std::string& name : names) own += (own.empty() ? "" : ", ") + name;
      file.fail("model", "is a device of driver: " + std::string(other.driver) + "; set that driver, or choose " + own);
    }
  }
  return file.choice("model", names);
}

void read_limits(rtbus::config::Map& file, DeviceInfo& info) {
  auto map = file.optional_map("limits");
  if (!map) return;
  const auto three = [&](std::string_view key, const Vec3& fallback) {
    return rtbus::array_of(rtbus::config::read_vector3(*map, key, {-2.0, 2.0}, rtbus::vector_of(fallback)));
  };
  info.max_force_n = map->number("max_force_n", {0.1, info.max_force_n}, info.max_force_n);
  info.continuous_force_n =
      map->number("continuous_force_n", {0.01, info.max_force_n}, std::min(info.continuous_force_n, info.max_force_n));
  info.thermal_time_constant_s = map->number("thermal_time_constant_s", {0.1, 3600.0}, info.thermal_time_constant_s);
  info.max_slew_n_per_ms = map->number("max_slew_n_per_ms", {0.01, 100.0}, info.max_slew_n_per_ms);
  info.max_stiffness_n_per_m = map->number("max_stiffness_n_per_m", {1.0, 20000.0}, info.max_stiffness_n_per_m);
  info.max_speed_m_s = map->number("max_speed_m_s", {0.05, 20.0}, info.max_speed_m_s);
  info.apparent_mass_kg = map->number("apparent_mass_kg", {0.005, 5.0}, info.apparent_mass_kg);
  info.viscous_damping_n_s_per_m = map->number("viscous_n_s_per_m", {0.0, 50.0}, info.viscous_damping_n_s_per_m);
  info.coulomb_friction_n = map->number("coulomb_n", {0.0, 5.0}, info.coulomb_friction_n);
  info.workspace_min_m = three("workspace_min_m", info.workspace_min_m);
  info.workspace_max_m = three("workspace_max_m", info.workspace_max_m);
  for (std::size_t i = 0; i < 3; ++i) {
    if (info.workspace_min_m[i] >= info.workspace_max_m[i]) {
      map->fail("workspace_max_m", "is not above limits.workspace_min_m on every axis; raise it");
    }
  }
  map->finish();
}

}  // namespace drivers::vendor
