#include "rtbus/config/body_motion.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "rtbus/config/vector3.hpp"

namespace rtbus::config {
namespace {

using Eigen::Vector3d;

constexpr Range kTime_s{0.0, 3600.0};
constexpr Range kWaypoint_m{-1000.0, 1000.0};
constexpr std::size_t kMaxWaypoints = 1000;
constexpr double kSmoothStepPeak = 1.5;  // of 3s² − 2s³, at its middle

void check_speed(const Map& map, std::string_view key, double speed_m_s) {
  if (speed_m_s <= kMaxBodySpeed_m_s) return;
  char text[120];
  std::snprintf(text, sizeof text,
                "makes the body as fast as %.3g m/s, above %.3g m/s; take a shorter way or more time", speed_m_s,
                kMaxBodySpeed_m_s);
  map.fail(key, text);
}

BodyMotion read_sinusoid(Map& map, const Vector3d&) {
  SinusoidMotion out;
  out.travel_m = read_vector3(map, "travel_m", {-100.0, 100.0});
  out.frequency_hz = map.number("frequency_hz", {1e-3, 50.0});
  out.start_s = map.number("start_s", kTime_s, 0.0);
  check_speed(map, "frequency_hz", std::numbers::pi * out.frequency_hz * out.travel_m.norm());
  return out;
}

BodyMotion read_waypoints(Map& map, const Vector3d& p_WB) {
  WaypointMotion out;
  double before_s = 0.0;
  Vector3d before_m = p_WB;
  for (Map& point : map.list_of_maps("points")) {
    const double time_s = point.number("time_s", kTime_s);
    if (time_s <= before_s) point.fail("time_s", "is not after the point before it; times grow, the first is above 0");
    const Vector3d position_m = read_vector3(point, "position_m", kWaypoint_m);
    check_speed(point, "position_m", kSmoothStepPeak * (position_m - before_m).norm() / (time_s - before_s));
    out.times_s.push_back(time_s);
    out.positions_m.push_back(position_m);
    before_s = time_s;
    before_m = position_m;
    point.finish();
  }
  if (out.times_s.empty() || out.times_s.size() > kMaxWaypoints) {
    map.fail("points", "needs 1 to 1000 points: '- {time_s: 1, position_m: [0, 0.1, 0]}'");
  }
  out.repeat = map.boolean("repeat", false);
  if (out.repeat && (out.positions_m.back() - p_WB).norm() > 1e-9) {
    map.fail("repeat", "would make the body jump: its last point is not position_m, where it begins anew");
  }
  return out;
}

BodyMotion read_spin(Map& map, const Vector3d&) {
  SpinMotion out;
  const Vector3d axis = read_vector3(map, "axis", {-1e3, 1e3}, {0.0, 1.0, 0.0});
  if (axis.norm() < 1e-3) map.fail("axis", "has no direction; write [0, 1, 0] for the vertical");
  out.axis = axis.normalized();
  out.rate_rad_s = map.number("rate_rad_s", {-50.0, 50.0});
  out.ramp_s = map.number("ramp_s", {0.01, 60.0}, out.ramp_s);
  out.start_s = map.number("start_s", kTime_s, 0.0);
  return out;
}

BodyMotion read_target(Map& map, const Vector3d&) {
  TargetMotion out;
  out.max_speed_m_s = map.number("max_speed_m_s", {1e-4, kMaxBodySpeed_m_s}, out.max_speed_m_s);
  out.max_rate_rad_s = map.number("max_rate_rad_s", {0.0, 50.0}, out.max_rate_rad_s);
  out.reach_m = map.number("reach_m", {0.0, 100.0}, out.reach_m);
  return out;
}

struct MotionEntry {
  std::string_view name;
  BodyMotion (*read)(Map& keys, const Vector3d& p_WB);
};
constexpr MotionEntry kMotions[] = {
    {"sinusoid", read_sinusoid}, {"waypoints", read_waypoints}, {"spin", read_spin}, {"target", read_target}};

}  // namespace

BodyMotion read_body_motion(Map& body, const Vector3d& p_WB) {
  Map motion = body.map("motion");
  const std::vector<std::string> names = motion.keys();
  std::string known;
  for (const MotionEntry& entry : kMotions) known += (known.empty() ? "" : ", ") + std::string(entry.name);
  if (names.size() != 1) body.fail("motion", "needs exactly one motion; this build knows " + known);
  for (const MotionEntry& entry : kMotions) {
    if (entry.name != names.front()) continue;
    Map keys = motion.map(entry.name);
    BodyMotion out = entry.read(keys, p_WB);
    keys.finish();
    motion.finish();
    return out;
  }
  body.fail("motion", "names a motion that this build does not know: " + names.front() + "; it knows " + known);
}

}  // namespace rtbus::config
