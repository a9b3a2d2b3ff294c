#pragma once
/// @file push.hpp
/// A hand that pushes bodies of a scene along −z (simulated clock), and what it feels.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "tools/harness/harness.hpp"

namespace tests {

inline constexpr const char* kPhysics_hz[] = {"100", "43", "18"};

/// A push along −z that begins after a second. The second body is the box.
struct Push {
  std::string bodies, start_m;
  double distance_m, speed_m_s, duration_s;
  double tip_friction = 0.5;
};

struct Pushed {
  std::vector<double> force_n;   ///< On the hand along z, once a millisecond.
  std::vector<double> across_n;  ///< Across z, likewise.
  double tips_s = 0.0;           ///< When the box had turned by 1 mrad.
  double left_s = 0.0;           ///< When the box was `below_m` under where it began.
  physics::BodyPose last;
};

inline Pushed push(const Push& how, std::vector<std::string> more, double below_m = 1.0) {
  more.insert(more.begin(),
              {"scene={schema: scene/1, gravity_m_s2: [0, -9.81, 0], bodies: [" + how.bodies + "]}",
               "haptic.0.method=local_contact", "haptic.0.coupling={stiffness_n_per_m: 400, damping_n_s_per_m: 0.5}",
               "haptic.0.proxy={mass_kg: 0.1, radius_m: 0.005, friction: " + std::to_string(how.tip_friction) + "}",
               "haptic.0.mapping={offset_m: " + how.start_m + "}",
               "haptic.0.device={schema: device/1, driver: simulated, model: phantom_desktop, hand: {type: push, "
               "impedance: firm, start_m: [0, 0, 0], direction: [0, 0, -1], start_s: 1, distance_m: " +
                   std::to_string(how.distance_m) + ", speed_m_s: " + std::to_string(how.speed_m_s) + "}}"});
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : more) overrides.push_back(rtbus::config::parse_override(text));
  auto settings = rtbus::config::load_session(std::string(RTBUS_SOURCE_DIR) + "/config/free_block.yaml", overrides);
  tools::Harness harness(settings, {});
  const auto every = static_cast<std::uint64_t>(std::llround(harness.config().rate_hz / 1000.0));
  Pushed out;
  double began_m = 0.0;
  harness.run(how.duration_s, [&](const rtbus::Telemetry& tick) {
    if (tick.tick % every != 0) return;
    out.force_n.push_back(tick.force_n[2]);
    out.across_n.push_back(std::hypot(tick.force_n[0], tick.force_n[1]));
    const physics::BodyPose box = harness.stepper()->world().body_pose(1);
    const double height_m = box.position_m.y();
    if (out.tips_s == 0.0 && box.orientation.angularDistance(Eigen::Quaterniond::Identity()) > 1e-3) {
      out.tips_s = harness.now_s();
    }
    if (harness.now_s() < 0.9) began_m = height_m;
    if (out.left_s == 0.0 && harness.now_s() > 0.9 && height_m < began_m - below_m) out.left_s = harness.now_s();
  });
  out.last = harness.stepper()->world().body_pose(1);
  return out;
}

inline std::vector<std::string> physics_at(const char* hz) {
  return {"physics.rate_hz=1000", std::string("physics.throttle_hz=") + hz};
}
inline const std::vector<std::string> kConverged{"haptic.0.rate_hz=10000", "physics.rate_hz=10000"};

/// The worst difference of the force along z.
inline double apart_n(const Pushed& a, const Pushed& b) {
  double worst_n = 0.0;
  for (std::size_t i = 0; i < a.force_n.size(); ++i) worst_n = std::max(worst_n, std::abs(a.force_n[i] - b.force_n[i]));
  return worst_n;
}

}  // namespace tests
