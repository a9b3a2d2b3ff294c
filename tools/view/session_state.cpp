#include "tools/view/session_state.hpp"

#include <cmath>

#include "haptic_node/safety.hpp"
#include "rtbus/three_digits.hpp"

namespace view {

namespace {

std::string percent(double share) { return std::to_string(std::lround(100.0 * share)) + " %"; }

/// The node gives no signs of its own.
HandState silent(const HandSigns& signs) {
  if (!signs.tick_age_s) return {"STARTING", signs.name + ": no tick yet", Level::kWarn};
  if (!signs.writer_alive) {
    return {"LOST", signs.name + ": its process has ended; the device goes to zero force by itself", Level::kBad};
  }
  return {"LOST", signs.name + ": no tick; its process is stopped or starved", Level::kBad};
}

}  // namespace

HandState judge(const HandSigns& signs) {
  if (!signs.writer_alive || !signs.tick_age_s || *signs.tick_age_s > kSilent_s) return silent(signs);
  const std::uint32_t now = signs.safety;
  const bool zero = signs.gate <= 0.0;
  if ((now & haptic::kEstop) != 0) {
    const std::string by = signs.estop.empty() ? "" : " (" + signs.estop + ")";
    return {"E-STOP", (zero ? "no force until re-armed" : "the force fades to zero") + by, Level::kBad};
  }
  if ((now & haptic::kDeviceLost) != 0) return {"LOST", "the device does not answer: no force", Level::kBad};
  if ((now & haptic::kStale) != 0) {
    const std::string why = "physics lost" + (signs.physics.empty() ? "" : " (" + signs.physics + ")");
    if (zero) return {"LOST", why + ": no force", Level::kBad};
    return {"FADING", why + ": the force fades to zero", Level::kBad};
  }
  if ((now & haptic::kNonfinite) != 0) return {"CUT", "the method's force is not a number: no force", Level::kBad};
  if ((now & haptic::kOverspeed) != 0) return {"CUT", "the tip is faster than its limit: no force", Level::kBad};
  if ((now & haptic::kDisabled) != 0) return {"OFF", "forces are not enabled", Level::kWarn};
  if ((now & haptic::kRamping) != 0) return {"RAMPING", "the force comes back: " + percent(signs.gate), Level::kWarn};
  if ((signs.recent_safety & haptic::kClamped) != 0) {
    return {"CLAMPED", "the force reached the limit of " + rtbus::three_digits(signs.force_limit_n) + " N",
            Level::kWarn};
  }
  if ((signs.recent_safety & haptic::kThermalLimited) != 0) {
    return {"CLAMPED", "the motors would become too hot: the force is limited", Level::kWarn};
  }
  return {"NORMAL", "", Level::kGood};
}

const char* to_string(Level level) noexcept {
  switch (level) {
    case Level::kGood:
      return "good";
    case Level::kWarn:
      return "warn";
    case Level::kBad:
      break;
  }
  return "bad";
}

}  // namespace view
