#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "drivers/simulated/simulated_config.hpp"
#include "drivers/virtual_devices/falcon/virtual_falcon.hpp"
#include "rtbus/config/vector3.hpp"

namespace drivers::virtual_usb {
namespace {

using rtbus::config::Map;
using rtbus::config::read_vector3;

void parse_mechanics(Map& map, FalconArmSettings& arm) {
  simulated::MechanicsParameters& m = arm.mechanics;
  m.mass_kg = map.number("mass_kg", {0.05, 5.0}, m.mass_kg);
  m.viscous_n_s_per_m = map.number("viscous_n_s_per_m", {0.0, 50.0}, m.viscous_n_s_per_m);
  m.coulomb_n = map.number("coulomb_n", {0.0, 5.0}, m.coulomb_n);
  m.gravity_m_s2 = read_vector3(map, "gravity_m_s2", {-30.0, 30.0}, m.gravity_m_s2);
  arm.torque_timeout_ns = static_cast<std::uint64_t>(map.number("torque_timeout_ms", {2.0, 1000.0}, 50.0) * 1e6);
}

void parse_linkage(Map& settings, FalconArmSettings& arm) {
  std::vector<std::string> names;
  for (const falcon::Geometry& geometry : falcon::geometries()) names.emplace_back(geometry.name);
  const std::string name = settings.choice("geometry", names, names.front());
  for (const falcon::Geometry& geometry : falcon::geometries()) {
    if (geometry.name == name) arm.geometry = geometry;
  }
  constexpr double kDegree = std::numbers::pi / 180.0;
  const double zero_deg = arm.geometry.zero_angle_rad / kDegree;
  arm.geometry.zero_angle_rad = settings.number("zero_angle_deg", {20.0, 60.0}, zero_deg) * kDegree;
  const bool lnf = settings.choice("force_gain", {"martin_hillier", "libnifalcon"}, "martin_hillier") == "libnifalcon";
  arm.command_gain = lnf ? falcon::kGainLibnifalcon : falcon::kGainMartinHillier;
}

FalconHoming parse_homing(Map& settings) {
  const std::string homing = settings.choice("homing", {"by_hand", "done", "never"}, "by_hand");
  return homing == "done" ? FalconHoming::kDone : homing == "never" ? FalconHoming::kNever : FalconHoming::kByHand;
}

}  // namespace

VirtualFalconSettings read_virtual_falcon(Map& settings) {
  VirtualFalconSettings out;
  out.serial = settings.text("serial", out.serial);
  if (out.serial.empty() || out.serial.size() > 32) settings.fail("serial", "must have 1 to 32 characters");
  out.arm.homing = parse_homing(settings);
  parse_linkage(settings, out.arm);
  if (auto mechanics = settings.optional_map("mechanics")) {
    parse_mechanics(*mechanics, out.arm);
    mechanics->finish();
  }
  simulated::MechanicsParameters& m = out.arm.mechanics;
  if (settings.has("hand")) {
    Map hand = settings.file_or_map("hand");
    out.arm.hand = simulated::parse_hand(hand, m.start_position_m);
    hand.finish();
  }
  m.start_position_m = read_vector3(settings, "start_position_m", {-0.05, 0.05}, m.start_position_m);
  if ((m.start_position_m.array() < m.workspace_min_m.array()).any() ||
      (m.start_position_m.array() > m.workspace_max_m.array()).any()) {
    settings.fail(settings.has("start_position_m") ? "start_position_m" : "hand",
                  "lets the grip start beyond ±40, ±40, ±35 mm; move it inside");
  }
  out.board.seed = static_cast<std::uint64_t>(settings.integer("seed", 0, 1'000'000'000, 1));
  out.bench = parse_bench(settings);
  if (out.bench.times.trigger.empty()) out.board.faults = out.bench.faults;
  return out;
}

DeviceMaker parse_virtual_falcon(Map& settings) {
  VirtualFalconSettings read = read_virtual_falcon(settings);
  return [read = std::move(read)] { return on_bench(std::make_unique<VirtualFalcon>(read), read.bench); };
}

}  // namespace drivers::virtual_usb
