#include "drivers/phantom/homing.hpp"

#include <algorithm>
#include <cmath>

namespace drivers::phantom {
namespace {

// No arm turns faster for the length of an exchange (3 m/s at 0.1 m), nor for longer than kShortS faster than a hand.
constexpr double kShortRadS = 30.0;
constexpr double kLongRadS = 8.0;
constexpr double kShortS = 0.020;
constexpr double kAnyStepRad = 0.05;
// After a gap in the connection the counters may have moved so far and still be the same counters.
constexpr double kContinuesRad = 0.1;

double gap(const Counts& a, const Counts& b, std::size_t i) {
  return std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i]));
}

}  // namespace

Homing::Homing(const Kinematics& kinematics, HomingMode mode, double tolerance_rad)
    : mode_(mode),
      home_(kinematics.model().home),
      counts_per_rad_((kinematics.counts({1, 1, 1}) - kinematics.counts({0, 0, 0})).cwiseAbs()),
      tolerance_rad_(tolerance_rad) {}

bool Homing::near_zero(const Counts& counts) const noexcept {
  for (std::size_t i = 0; i < 3; ++i) {
    if (gap(counts, {}, i) > tolerance_rad_ * counts_per_rad_[static_cast<int>(i)]) return false;
  }
  return true;
}

bool Homing::jumped(const Seen& from, const Seen& to) const noexcept {
  const double dt_s = to.time_ns > from.time_ns ? static_cast<double>(to.time_ns - from.time_ns) * 1e-9 : 0.0;
  const double most_rad =
      kAnyStepRad + kShortRadS * std::min(dt_s, kShortS) + kLongRadS * std::max(0.0, dt_s - kShortS);
  for (std::size_t i = 0; i < 3; ++i) {
    if (gap(to.counts, from.counts, i) > most_rad * counts_per_rad_[static_cast<int>(i)]) return true;
  }
  return false;
}

void Homing::wait_for(Waits what) noexcept {
  homed_ = false;
  holding_ = false;
  waits_ = what;
}

void Homing::begin(std::uint64_t now_ns, const Counts& counts) noexcept RTBUS_NONBLOCKING {
  bool away = false;
  bool near_believed = true;
  for (std::size_t i = 0; i < 3; ++i) {
    const double per_rad = counts_per_rad_[static_cast<int>(i)];
    away = away || gap(counts, {}, i) > 2.0 * kContinuesRad * per_rad;
    near_believed = near_believed && gap(counts, believed_, i) <= kContinuesRad * per_rad;
  }
  const bool continues = ever_homed_ && away && near_believed && (homed_ || waits_ == Waits::kPowerLost);
  if (continues) {
    homed_ = true;
    was_lost_ = false;
  } else if (was_lost_ && ever_homed_) {
    wait_for(Waits::kPowerLost);
  } else if (mode_ == HomingMode::kCounters) {
    homed_ = true;
    ever_homed_ = true;
  } else {
    wait_for(mode_ == HomingMode::kButton ? Waits::kForButton : Waits::kForHome);
  }
  impossible_ = 0;
  last_ = {counts, now_ns};
  suspicious_ = false;
  if (!homed_ && waits_ == Waits::kForHome && near_zero(counts)) {
    holding_ = true;
    hold_since_ns_ = now_ns;
  }
}

void Homing::pressed(std::uint64_t now_ns, const Counts& counts) noexcept RTBUS_NONBLOCKING {
  wait_for(Waits::kForButton);
  holding_ = true;
  hold_since_ns_ = now_ns;
  last_ = {counts, now_ns};
  suspicious_ = false;
}

Homing::Verdict Homing::update(std::uint64_t now_ns, const Counts& counts, bool possible) noexcept RTBUS_NONBLOCKING {
  const bool home = near_zero(counts);
  const Seen seen{counts, now_ns};
  // Time that passed since a suspicious answer must not excuse it.
  if (jumped(last_, {counts, suspicious_ ? suspect_.time_ns : now_ns})) {
    const bool again = suspicious_ && !jumped(suspect_, seen);
    suspect_ = seen;
    suspicious_ = true;
    if (!again) return Verdict::kGlitch;
    // Onto zero: the button. Elsewhere: the counters cannot be believed.
    wait_for(home ? Waits::kForButton : Waits::kJumped);
    holding_ = home;
    hold_since_ns_ = now_ns;
  } else if (!homed_) {
    if (!home) {
      holding_ = false;
    } else if (!holding_ && waits_ == Waits::kForHome) {
      holding_ = true;
      hold_since_ns_ = now_ns;
    }
    if (holding_ && possible && now_ns - hold_since_ns_ >= kHoldNs) {
      homed_ = true;
      ever_homed_ = true;
      was_lost_ = false;
      impossible_ = 0;
    }
  }
  impossible_ = possible ? 0 : std::min(impossible_ + 1, kImpossiblePoses);
  if (homed_ && impossible_ == kImpossiblePoses) wait_for(Waits::kImpossible);
  last_ = {counts, now_ns};
  suspicious_ = false;
  if (homed_) believed_ = counts;
  return homed_ ? Verdict::kHomed : Verdict::kNotHomed;
}

std::string Homing::press_at_home() const {
  return "hold the arm at home, " + std::string(home_) +
         ", and press the calibration button of its controller while it is there (pressed in any other pose, the zero "
         "would be wrong and every force with it)";
}

std::string Homing::remedy() const {
  switch (waits_) {
    case Waits::kForHome:
      return "bring the arm home, " + std::string(home_) +
             ", and hold it there; if its counters are not near zero then, it was not plugged in there: " +
             press_at_home();
    case Waits::kForButton:
      return press_at_home() +
             "; if nothing changes, the counters were zero there already: homing: at_start takes that";
    case Waits::kPowerLost:
      return "the controller may have been without power and has forgotten where the arm is; " + press_at_home();
    case Waits::kJumped:
      return "the counters jumped; " + press_at_home();
    case Waits::kImpossible:
      return "the counters give a pose that the linkage cannot have; " + press_at_home();
  }
  return press_at_home();
}

}  // namespace drivers::phantom
