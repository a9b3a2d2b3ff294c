#include "drivers/simulated/simulated_config.hpp"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "drivers/simulated/model_config.hpp"
#include "drivers/simulated/plant_link.hpp"
#include "drivers/simulated/simulated_device.hpp"
#include "rtbus/config/vector3.hpp"
#include "rtbus/three_digits.hpp"

namespace drivers::simulated {
namespace {

using rtbus::three_digits;
using rtbus::config::Map;
using rtbus::config::read_vector3;

void parse_mechanics(Map& map, MechanicsParameters& m, DeviceInfo& info) {
  m.mass_kg = map.number("mass_kg", {0.005, 5.0}, m.mass_kg);
  m.viscous_n_s_per_m = map.number("viscous_n_s_per_m", {0.0, 50.0}, m.viscous_n_s_per_m);
  m.coulomb_n = map.number("coulomb_n", {0.0, 5.0}, m.coulomb_n);
  m.gravity_m_s2 = read_vector3(map, "gravity_m_s2", {-30.0, 30.0}, m.gravity_m_s2);
  m.max_force_n = map.number("max_force_n", {0.1, 100.0}, m.max_force_n);
  m.force_step_n = map.number("force_step_n", {0.0, 1.0}, m.force_step_n);
  m.position_quantum_m = map.number("position_quantum_m", {0.0, 0.005}, m.position_quantum_m);
  m.sample_jitter_ns = static_cast<std::uint64_t>(map.number("sample_jitter_us", {0.0, 1000.0}, 0.0) * 1e3 + 0.5);
  m.jitter_seed = static_cast<std::uint64_t>(map.integer("jitter_seed", 0, 1'000'000'000, 1));
  m.step_ns = static_cast<std::uint64_t>(map.integer("integration_step_us", 10, 500, 100)) * 1000;
  m.end_stops = map.boolean("end_stops", true);
  info.force_timeout_s = map.number("force_timeout_ms", {1.0, 1000.0}, 20.0) * 1e-3;
  if (m.force_step_n > m.max_force_n) map.fail("force_step_n", "exceeds mechanics.max_force_n; lower it");
}

/// A hand that wants to go where the faces of the workspace stop the tip: the farthest point is named.
void warn_of_way_out(const Map& map, SimulatedSettings& settings) {
  constexpr double kNoticed_m = 1e-6;
  const MechanicsParameters& m = settings.mechanics;
  const auto outside_m = [&m](const Waypoint& point) {
    return std::max((m.workspace_min_m - point.position_m).maxCoeff(),
                    (point.position_m - m.workspace_max_m).maxCoeff());
  };
  const std::vector<Waypoint> points = settings.hand.turning_points();
  const auto worst = std::max_element(
      points.begin(), points.end(), [&](const Waypoint& a, const Waypoint& b) { return outside_m(a) < outside_m(b); });
  if (worst == points.end() || outside_m(*worst) <= kNoticed_m) return;
  const Eigen::Vector3d& p = worst->position_m;
  settings.warnings.push_back(
      map.sentence(map.has("file") ? "file" : "", "leads the hand " + three_digits(1e3 * outside_m(*worst)) +
                                                      " mm out of the workspace, to [" + three_digits(p.x()) + ", " +
                                                      three_digits(p.y()) + ", " + three_digits(p.z()) + "] m after " +
                                                      three_digits(worst->time_s) +
                                                      " s: end stops hold the tip back; stay within "
                                                      "limits.workspace_min_m…max_m, or widen them"));
}

}  // namespace

std::unique_ptr<DeviceConfig> parse(Map& file) {
  const Model& model = parse_model(file);
  SimulatedSettings settings;
  settings.mechanics = model.mechanics;
  settings.info = model.limits;
  settings.info.model = std::string(model.name);
  settings.own_process = file.choice("process", {"node", "own"}, "node") == "own";
  settings.sample_rate_hz = file.number("sample_rate_hz", {100.0, 10000.0}, settings.sample_rate_hz);
  settings.plant_rate_hz = file.number("plant_rate_hz", {500.0, 10000.0}, settings.plant_rate_hz);

  MechanicsParameters& m = settings.mechanics;
  if (auto mechanics = file.optional_map("mechanics")) {
    parse_mechanics(*mechanics, m, settings.info);
    mechanics->finish();
  }
  // A peak lowered below the model's continuous force takes that along, unless the file gives both.
  settings.info.continuous_force_n = std::min(settings.info.continuous_force_n, m.max_force_n);
  if (auto limits = file.optional_map("limits")) {
    parse_limits(*limits, m, settings.info);
    limits->finish();
  }
  if (auto hand = file.optional_map("hand")) {
    settings.hand = parse_hand(*hand, m.start_position_m);
    hand->finish();
    if (m.end_stops) warn_of_way_out(*hand, settings);
  }
  m.start_position_m = read_vector3(file, "start_position_m", {-2.0, 2.0}, m.start_position_m);
  const bool outside = (m.start_position_m.array() < m.workspace_min_m.array()).any() ||
                       (m.start_position_m.array() > m.workspace_max_m.array()).any();
  if (m.end_stops && outside) {
    file.fail(file.has("start_position_m") ? "start_position_m" : "hand",
              "lets the tip start outside the workspace (limits.workspace_min_m…max_m); move it inside, or set "
              "mechanics.end_stops: false");
  }
  complete_info(m, settings.info);
  settings.info.sample_rate_hz = settings.sample_rate_hz;
  return std::make_unique<SimulatedConfig>(std::move(settings));
}

rtbus::Result<std::unique_ptr<Device>, DeviceFault> SimulatedConfig::open(const OpenContext& context) const {
  std::unique_ptr<Device> device;
  if (settings_.own_process) {
    device = std::make_unique<PlantLink>(settings_, context);
  } else {
    device = std::make_unique<SimulatedDevice>(settings_);
  }
  return device;
}

}  // namespace drivers::simulated
