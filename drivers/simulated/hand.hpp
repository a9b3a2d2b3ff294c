#pragma once
/// @file hand.hpp
/// The hand on a simulated device: a scripted motion that pulls at the tip through an impedance.
///
/// The script is a pure function of the time since the device was started; the hand itself keeps no state, so a run can
/// be repeated bit by bit. Everything is in D (x right, y up, z towards the user), SI units.
#include <cstdint>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "drivers/simulated/waypoints.hpp"
#include "rtbus/realtime.hpp"

namespace drivers::simulated {

/// Between the scripted motion and the tip. The presets (light, normal, firm) are in hand_config.cpp.
struct HandImpedance {
  double stiffness_n_per_m = 300.0;
  double damping_n_s_per_m = 3.0;
  double mass_kg = 0.08;      ///< Moves with the tip while the hand holds it; its weight is carried by the arm.
  double max_force_n = 10.0;  ///< Norm of spring plus damper: the grip slips above it.
};

/// Nobody touches the device.
struct NoHand {};

/// The hand stays at a point.
struct HoldMotion {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
};

/// Rests at `start_m` until `start_s`, moves `distance_m` along `direction` at `speed_m_s`, then rests. Speed rises and
/// falls over `ramp_s` by a smoothstep; a short way shortens the ramps instead of missing its end.
struct PushMotion {
  Eigen::Vector3d start_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction = -Eigen::Vector3d::UnitY();  ///< Unit length.
  double distance_m = 0.0;
  double speed_m_s = 0.05;
  double start_s = 0.0;
  double ramp_s = 0.1;
};

/// centre + amplitude·sin(2π f t); the amplitude grows over the first `ramp_s` by a smoothstep.
struct SinusoidMotion {
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d amplitude_m = Eigen::Vector3d::Zero();
  double frequency_hz = 1.0;
  double ramp_s = 0.5;
};

/// Holds the tip rigidly at a point until `release_s`, then lets go for good.
struct DropMotion {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  double release_s = 1.0;
};

using HandMotion = std::variant<NoHand, HoldMotion, PushMotion, SinusoidMotion, DropMotion, WaypointPath>;

/// A button goes down or up.
struct ButtonEvent {
  double time_s = 0.0;       ///< Since the script began.
  std::uint32_t button = 0;  ///< Bit number, 0…31.
  bool pressed = false;
};

enum class Grip : std::uint8_t {
  kNone,    ///< The hand does not touch the tip.
  kSpring,  ///< Through the impedance.
  kRigid,   ///< The tip is where the hand is.
};

/// What the hand wants at one instant.
struct HandTarget {
  Grip grip = Grip::kNone;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();
};

class Hand {
 public:
  Hand() = default;  ///< No hand.
  Hand(HandMotion motion, const HandImpedance& impedance, std::vector<ButtonEvent> buttons = {});

  [[nodiscard]] const HandImpedance& impedance() const noexcept RTBUS_NONBLOCKING { return impedance_; }

  /// Where the script turns or ends: between these points it goes nowhere else, but for a smooth table's small
  /// overshoot.
  [[nodiscard]] std::vector<Waypoint> turning_points() const;

  /// The target `elapsed_ns` after the script began. @realtime Yes.
  [[nodiscard]] HandTarget at(std::uint64_t elapsed_ns) const noexcept RTBUS_NONBLOCKING;

  /// Pressed buttons at that time, bit i: button i. @realtime Yes.
  [[nodiscard]] std::uint32_t buttons(std::uint64_t elapsed_ns) const noexcept RTBUS_NONBLOCKING;

 private:
  struct ButtonState {
    std::uint64_t from_ns;
    std::uint32_t pressed;
  };
  HandMotion motion_;
  HandImpedance impedance_;
  std::vector<ButtonState> buttons_;  ///< In order of time.
};

}  // namespace drivers::simulated
