// `usb: {virtual: …}` of a PHANToM-class device file, and `rtbus virtual-device phantom`.
#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "drivers/simulated/simulated_config.hpp"
#include "drivers/virtual_devices/phantom/virtual_phantom.hpp"
#include "rtbus/config/vector3.hpp"
#include "rtbus/eigen.hpp"

namespace drivers::virtual_usb {
namespace {

using rtbus::config::Map;
using rtbus::config::read_vector3;

}  // namespace

DeviceMaker parse_virtual_phantom(Map& map) {
  VirtualPhantomSettings settings;
  std::vector<std::string> names;
  for (const phantom::Model& model : phantom::models()) names.emplace_back(model.key);
  const std::string name = map.choice("model", names, "vintage");
  settings.model = *std::find_if(phantom::models().begin(), phantom::models().end(),
                                 [&](const phantom::Model& model) { return model.key == name; });
  settings.mechanics = mechanics_of(settings.model);
  if (auto m = map.optional_map("mechanics")) {
    settings.mechanics.mass_kg = m->number("mass_kg", {0.005, 5.0}, settings.mechanics.mass_kg);
    settings.mechanics.viscous_n_s_per_m =
        m->number("viscous_n_s_per_m", {0.0, 50.0}, settings.mechanics.viscous_n_s_per_m);
    settings.mechanics.coulomb_n = m->number("coulomb_n", {0.0, 5.0}, settings.mechanics.coulomb_n);
    settings.mechanics.gravity_m_s2 = read_vector3(*m, "gravity_m_s2", {-30.0, 30.0}, settings.mechanics.gravity_m_s2);
    m->finish();
  }
  if (auto hand = map.optional_map("hand")) {
    settings.hand = simulated::parse_hand(*hand, settings.mechanics.start_position_m);
    hand->finish();
  }
  settings.mechanics.start_position_m =
      read_vector3(map, "start_position_m", {-0.5, 0.5}, settings.mechanics.start_position_m);
  if (!VirtualArm::reaches(phantom::Kinematics(settings.model), settings.mechanics.start_position_m)) {
    map.fail(map.has("start_position_m") ? "start_position_m" : "hand",
             "lets the tip start where the linkage does not reach; move it towards the centre of the workspace");
  }
  settings.serial = map.text("serial", settings.serial);
  settings.high_speed = map.choice("speed", {"high", "full"}, "high") == "high";
  settings.zeroed_at_home = map.choice("counters", {"from_home", "from_start"}, "from_home") == "from_home";
  settings.calibration_needed = map.boolean("calibration_needed", false);
  settings.forgets_when_unplugged = map.boolean("forgets_when_unplugged", false);
  settings.button_at_s = map.number("button_at_s", {-1.0, 86400.0}, -1.0);
  settings.gimbal_rad = rtbus::array_of(read_vector3(map, "gimbal_rad", {-3.2, 3.2}, {0.0, 0.0, 0.0}));
  settings.seed = static_cast<std::uint64_t>(map.integer("seed", 0, 1'000'000'000, 1));
  settings.bench = parse_bench(map);
  if (settings.bench.faults.fail_handshake > 0.0) {
    map.fail("faults", "holds fail_handshake: this device has no handshake; use lose_reply or mute");
  }
  if (settings.bench.faults.flip_echo_bit > 0.0) {
    map.fail("faults", "holds flip_echo_bit: this device takes no firmware that it could echo; use flip_reply_bit");
  }
  if (settings.bench.times.trigger.empty()) settings.faults = settings.bench.faults;
  return [settings] { return on_bench(std::make_unique<VirtualPhantom>(settings), settings.bench); };
}

}  // namespace drivers::virtual_usb
