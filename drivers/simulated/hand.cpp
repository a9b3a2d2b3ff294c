#include "drivers/simulated/hand.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <utility>

namespace drivers::simulated {
namespace {

double smoothstep(double u) { return u <= 0.0 ? 0.0 : u >= 1.0 ? 1.0 : u * u * (3.0 - 2.0 * u); }
double smoothstep_slope(double u) { return u <= 0.0 || u >= 1.0 ? 0.0 : 6.0 * u * (1.0 - u); }

// Integral of smoothstep from 0 to u, 0 <= u <= 1.
double smoothstep_area(double u) { return u * u * u * (1.0 - 0.5 * u); }

HandTarget target(const NoHand&, double) { return {}; }

HandTarget target(const HoldMotion& hold, double) { return {Grip::kSpring, hold.position_m, Eigen::Vector3d::Zero()}; }

HandTarget target(const PushMotion& push, double time_s) {
  // Each ramp covers half of what full speed would: with ramps of at most distance/speed they meet without a gap.
  const double ramp_s = std::min(push.ramp_s, push.distance_m / push.speed_m_s);
  const double total_s = push.distance_m / push.speed_m_s + ramp_s;
  const double t = std::clamp(time_s - push.start_s, 0.0, total_s);

  double way_m = 0.0;
  double speed_m_s = push.speed_m_s;
  if (t < ramp_s) {
    way_m = push.speed_m_s * ramp_s * smoothstep_area(t / ramp_s);
    speed_m_s *= smoothstep(t / ramp_s);
  } else if (t > total_s - ramp_s) {
    const double left = (total_s - t) / ramp_s;
    way_m = push.distance_m - push.speed_m_s * ramp_s * smoothstep_area(left);
    speed_m_s *= smoothstep(left);
  } else {
    way_m = push.speed_m_s * (t - 0.5 * ramp_s);
    if (t >= total_s) speed_m_s = 0.0;  // without ramps the end is abrupt
  }
  if (time_s < push.start_s) speed_m_s = 0.0;
  return {Grip::kSpring, push.start_m + way_m * push.direction, speed_m_s * push.direction};
}

HandTarget target(const SinusoidMotion& sinusoid, double time_s) {
  const double rate = 2.0 * std::numbers::pi * sinusoid.frequency_hz;
  const double phase = rate * time_s;
  double gain = 1.0;
  double gain_slope = 0.0;
  if (sinusoid.ramp_s > 0.0) {
    gain = smoothstep(time_s / sinusoid.ramp_s);
    gain_slope = smoothstep_slope(time_s / sinusoid.ramp_s) / sinusoid.ramp_s;
  }
  const double wave = std::sin(phase);
  return {Grip::kSpring, sinusoid.centre_m + gain * wave * sinusoid.amplitude_m,
          (gain * rate * std::cos(phase) + gain_slope * wave) * sinusoid.amplitude_m};
}

HandTarget target(const DropMotion& drop, double time_s) {
  constexpr double kHalfNs = 0.5e-9;  // times are whole nanoseconds: rounding to seconds must not delay the release
  if (time_s > drop.release_s + kHalfNs) return {};
  return {Grip::kRigid, drop.position_m, Eigen::Vector3d::Zero()};
}

HandTarget target(const WaypointPath& path, double time_s) {
  HandTarget out{Grip::kSpring, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  path.at(time_s, out.position_m, out.velocity_m_s);
  return out;
}

}  // namespace

Hand::Hand(HandMotion motion, const HandImpedance& impedance, std::vector<ButtonEvent> buttons)
    : motion_(std::move(motion)), impedance_(impedance) {
  std::stable_sort(buttons.begin(), buttons.end(),
                   [](const ButtonEvent& a, const ButtonEvent& b) { return a.time_s < b.time_s; });
  std::uint32_t pressed = 0;
  for (const ButtonEvent& event : buttons) {
    const std::uint32_t bit = std::uint32_t{1} << event.button;
    pressed = event.pressed ? pressed | bit : pressed & ~bit;
    buttons_.push_back({static_cast<std::uint64_t>(std::llround(event.time_s * 1e9)), pressed});
  }
}

std::vector<Waypoint> Hand::turning_points() const {
  struct Points {
    std::vector<Waypoint> operator()(const NoHand&) const { return {}; }
    std::vector<Waypoint> operator()(const HoldMotion& hold) const { return {{0.0, hold.position_m}}; }
    std::vector<Waypoint> operator()(const PushMotion& push) const {
      return {{push.start_s, push.start_m},
              {push.start_s + push.distance_m / push.speed_m_s, push.start_m + push.distance_m * push.direction}};
    }
    std::vector<Waypoint> operator()(const SinusoidMotion& sinusoid) const {
      const double quarter_s = 0.25 / sinusoid.frequency_hz;
      return {{sinusoid.ramp_s + quarter_s, sinusoid.centre_m + sinusoid.amplitude_m},
              {sinusoid.ramp_s + 3.0 * quarter_s, sinusoid.centre_m - sinusoid.amplitude_m}};
    }
    std::vector<Waypoint> operator()(const DropMotion& drop) const { return {{0.0, drop.position_m}}; }
    std::vector<Waypoint> operator()(const WaypointPath& path) const { return path.points(); }
  };
  return std::visit(Points{}, motion_);
}

HandTarget Hand::at(std::uint64_t elapsed_ns) const noexcept RTBUS_NONBLOCKING {
  const double time_s = static_cast<double>(elapsed_ns) * 1e-9;
  return std::visit([time_s](const auto& motion) { return target(motion, time_s); }, motion_);
}

std::uint32_t Hand::buttons(std::uint64_t elapsed_ns) const noexcept RTBUS_NONBLOCKING {
  const auto next = std::upper_bound(buttons_.begin(), buttons_.end(), elapsed_ns,
                                     [](std::uint64_t t, const ButtonState& state) { return t < state.from_ns; });
  return next == buttons_.begin() ? 0 : std::prev(next)->pressed;
}

}  // namespace drivers::simulated
