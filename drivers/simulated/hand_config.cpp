#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "drivers/simulated/simulated_config.hpp"
#include "rtbus/config/vector3.hpp"

namespace drivers::simulated {
namespace {

using rtbus::config::Map;
using rtbus::config::Range;

constexpr Range kPoint{-0.5, 0.5};  // metres around the centre of the workspace

// Our own choice, spanned by published measurements: an arm posed freely has 135 N/m and 6.5 N·s/m; pens held with 1 to
// 3 N get stiffer and damp more with the grip. The largest forces are what such a grip can transmit before it slips.
constexpr HandImpedance kLight{100.0, 1.0, 0.03, 5.0};
constexpr HandImpedance kNormal{300.0, 3.0, 0.08, 10.0};
constexpr HandImpedance kFirm{700.0, 6.0, 0.15, 20.0};

Eigen::Vector3d point(Map& map, std::string_view key, Range range = kPoint) {
  return rtbus::config::read_vector3(map, key, range);
}

HandImpedance parse_impedance(Map& map) {
  const std::string preset = map.choice("impedance", {"light", "normal", "firm"}, "normal");
  HandImpedance z = preset == "light" ? kLight : preset == "firm" ? kFirm : kNormal;
  z.stiffness_n_per_m = map.number("stiffness_n_per_m", {0.0, 20000.0}, z.stiffness_n_per_m);
  z.damping_n_s_per_m = map.number("damping_n_s_per_m", {0.0, 200.0}, z.damping_n_s_per_m);
  z.mass_kg = map.number("mass_kg", {0.0, 5.0}, z.mass_kg);
  z.max_force_n = map.number("max_force_n", {0.0, 200.0}, z.max_force_n);
  return z;
}

PushMotion parse_push(Map& map) {
  PushMotion push;
  push.start_m = point(map, "start_m");
  push.direction = point(map, "direction", {-1e3, 1e3});
  if (push.direction.norm() < 1e-9) map.fail("direction", "has no length; give for example [0, -1, 0]");
  push.direction.normalize();
  push.distance_m = map.number("distance_m", {1e-6, 1.0});
  push.speed_m_s = map.number("speed_m_s", {1e-4, 10.0}, push.speed_m_s);
  push.start_s = map.number("start_s", {0.0, 3600.0}, push.start_s);
  push.ramp_s = map.number("ramp_s", {0.0, 10.0}, push.ramp_s);
  return push;
}

SinusoidMotion parse_sinusoid(Map& map) {
  SinusoidMotion sinusoid;
  sinusoid.centre_m = point(map, "centre_m");
  sinusoid.amplitude_m = point(map, "amplitude_m");
  sinusoid.frequency_hz = map.number("frequency_hz", {0.001, 50.0}, sinusoid.frequency_hz);
  sinusoid.ramp_s = map.number("ramp_s", {0.0, 60.0}, sinusoid.ramp_s);
  return sinusoid;
}

WaypointPath parse_waypoints(Map& map) {
  const std::string file = map.existing_file("file");
  const bool smooth = map.choice("interpolation", {"linear", "smooth"}, "smooth") == "smooth";
  const bool loop = map.boolean("loop", false);
  auto points = read_waypoints(file);
  if (!points) map.fail("file", "cannot be used: " + points.error());
  constexpr double kSamePointM = 1e-6;
  if (loop && (points->front().position_m - points->back().position_m).norm() > kSamePointM) {
    map.fail("loop",
             "needs a motion that ends where it begins: make the last point of " + file + " equal to the first");
  }
  return {std::move(*points), smooth ? Interpolation::kSmooth : Interpolation::kLinear, loop};
}

std::vector<ButtonEvent> parse_buttons(Map& map) {
  std::vector<ButtonEvent> events;
  for (Map& item : map.list_of_maps("buttons")) {
    ButtonEvent event;
    event.time_s = item.number("time_s", {0.0, 86400.0});
    event.button = static_cast<std::uint32_t>(item.integer("button", 0, 31, 0));
    event.pressed = item.boolean("pressed", true);
    item.finish();
    events.push_back(event);
  }
  return events;
}

}  // namespace

Hand parse_hand(Map& map, Eigen::Vector3d& start_m) {
  const std::string type = map.choice("type", {"none", "hold", "push", "sinusoid", "drop", "waypoints"});
  HandMotion motion;
  if (type == "hold") {
    motion = HoldMotion{point(map, "position_m")};
  } else if (type == "push") {
    motion = parse_push(map);
  } else if (type == "sinusoid") {
    motion = parse_sinusoid(map);
  } else if (type == "drop") {
    DropMotion drop;
    drop.position_m = point(map, "position_m");
    drop.release_s = map.number("release_s", {0.0, 3600.0}, drop.release_s);
    motion = drop;
  } else if (type == "waypoints") {
    motion = parse_waypoints(map);
  }
  // A rigid grip and no grip have no impedance: its keys are unknown there.
  const bool springy = type != "none" && type != "drop";
  Hand hand(std::move(motion), springy ? parse_impedance(map) : HandImpedance{}, parse_buttons(map));
  const HandTarget first = hand.at(0);
  if (first.grip != Grip::kNone) start_m = first.position_m;
  return hand;
}

}  // namespace drivers::simulated
