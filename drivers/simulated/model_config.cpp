#include "drivers/simulated/model_config.hpp"

#include <algorithm>
#include <sstream>
#include <string>
#include <vector>

#include "rtbus/config/vector3.hpp"
#include "rtbus/eigen.hpp"

namespace drivers::simulated {
namespace {

using rtbus::config::Map;
using rtbus::config::read_vector3;

// Of the plant's friction, what DeviceInfo promises. Stability limits are computed from the promise, so it has to hold
// for a mechanism whose friction varies with pose and wear, as a real one's does.
constexpr double kPromisedFriction = 0.8;

}  // namespace

const Model& parse_model(Map& file) {
  std::vector<std::string> names;
  for (const Model& model : models()) names.emplace_back(model.name);
  const std::string name = file.choice("model", names, names.front());
  return *std::find_if(models().begin(), models().end(), [&](const Model& model) { return model.name == name; });
}

void parse_limits(Map& map, MechanicsParameters& m, DeviceInfo& info) {
  info.continuous_force_n = map.number("continuous_force_n", {0.01, 100.0}, info.continuous_force_n);
  info.thermal_time_constant_s = map.number("thermal_time_constant_s", {0.1, 3600.0}, info.thermal_time_constant_s);
  info.max_slew_n_per_ms = map.number("max_slew_n_per_ms", {0.01, 100.0}, info.max_slew_n_per_ms);
  info.max_stiffness_n_per_m = map.number("max_stiffness_n_per_m", {1.0, 20000.0}, info.max_stiffness_n_per_m);
  info.max_speed_m_s = map.number("max_speed_m_s", {0.05, 20.0}, info.max_speed_m_s);
  m.workspace_min_m = read_vector3(map, "workspace_min_m", {-2.0, 2.0}, m.workspace_min_m);
  m.workspace_max_m = read_vector3(map, "workspace_max_m", {-2.0, 2.0}, m.workspace_max_m);
  if ((m.workspace_min_m.array() >= m.workspace_max_m.array()).any()) {
    map.fail("workspace_max_m", "is not above limits.workspace_min_m on every axis; raise it");
  }
  if (info.continuous_force_n > m.max_force_n) {
    std::ostringstream peak;
    peak << m.max_force_n;
    map.fail("continuous_force_n",
             "exceeds the peak mechanics.max_force_n = " + peak.str() + " N; lower it or raise the peak");
  }
}

void complete_info(const MechanicsParameters& m, DeviceInfo& info) {
  info.max_force_n = m.max_force_n;
  info.position_quantum_m = m.position_quantum_m;
  info.apparent_mass_kg = m.mass_kg;
  info.viscous_damping_n_s_per_m = kPromisedFriction * m.viscous_n_s_per_m;
  info.coulomb_friction_n = kPromisedFriction * m.coulomb_n;
  info.workspace_min_m = rtbus::array_of(m.workspace_min_m);
  info.workspace_max_m = rtbus::array_of(m.workspace_max_m);
  info.can_pace_loop = true;
  info.simulated = true;
}

DeviceInfo parse_model_info(Map& file) {
  const Model& model = parse_model(file);
  MechanicsParameters mechanics = model.mechanics;
  DeviceInfo info = model.limits;
  info.model = std::string(model.name);
  info.continuous_force_n = std::min(info.continuous_force_n, mechanics.max_force_n);
  if (auto limits = file.optional_map("limits")) {
    parse_limits(*limits, mechanics, info);
    limits->finish();
  }
  complete_info(mechanics, info);
  info.can_pace_loop = false;
  return info;
}

}  // namespace drivers::simulated
