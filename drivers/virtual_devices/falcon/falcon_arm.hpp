#pragma once
/// @file falcon_arm.hpp
/// The mechanics of a virtual Falcon: a tip with mass, friction and weight, a scripted hand, three encoders and three
/// motors behind the linkage. Frame D as in the driver: axes of the linkage's frame B, origin at `centre_m`.
#include <array>
#include <cstdint>

#include <Eigen/Core>

#include "drivers/falcon/falcon_kinematics.hpp"
#include "drivers/falcon/motor_commands.hpp"
#include "drivers/simulated/hand.hpp"
#include "drivers/simulated/mechanics.hpp"

namespace drivers::virtual_usb {

/// How the arm gets homed. A real one is homed by its user, who pulls the grip out and pushes it in.
enum class FalconHoming : std::uint8_t {
  kByHand,  ///< A firm hand does it within three seconds, once the firmware asks for it; then the script begins.
  kDone,    ///< It is homed when its firmware starts; the script begins with the first frame.
  kNever,   ///< Nobody comes.
};

struct FalconArmSettings {
  simulated::MechanicsParameters mechanics;  ///< In D; without encoder quantum, jitter and force step.
  simulated::Hand hand;
  FalconHoming homing = FalconHoming::kByHand;
  falcon::Geometry geometry = falcon::geometries()[0];
  Eigen::Vector3d centre_m{0.0, 0.0, 0.120};
  double command_gain = falcon::kGainMartinHillier;  ///< Counts per N·m.
  std::uint64_t torque_timeout_ns = 50'000'000;      ///< A command acts for so long; not known of real ones.
};

/// The mechanics of the model `falcon` of drivers/simulated, with a workspace that the linkage reaches.
[[nodiscard]] FalconArmSettings default_falcon_arm();

class FalconArm {
 public:
  explicit FalconArm(FalconArmSettings settings);

  void power_up(std::uint64_t now_ns);
  void advance_to(std::uint64_t now_ns);

  /// The firmware runs; `homing_asked`: the frame's homing flag.
  void frame_received(bool homing_asked, std::uint64_t now_ns);
  void set_commands(const std::array<std::int16_t, 3>& count, std::uint64_t now_ns);
  /// The firmware forgot where the axes are.
  void forget_homing() noexcept { homed_ = 0; }

  /// What the firmware reports: 0 for an axis that is not homed.
  [[nodiscard]] std::array<std::int16_t, 3> encoders() const noexcept;
  [[nodiscard]] std::uint8_t homed() const noexcept { return homed_; }  ///< Bit i: axis i + 1.
  [[nodiscard]] std::uint32_t buttons() const noexcept { return mechanics_.buttons(); }

  [[nodiscard]] const simulated::Mechanics& mechanics() const noexcept { return mechanics_; }
  /// Of the user's script; 0 before it began.
  [[nodiscard]] std::uint64_t script_began_ns() const noexcept { return script_began_ns_; }
  [[nodiscard]] const FalconArmSettings& settings() const noexcept { return settings_; }

 private:
  enum class Phase : std::uint8_t { kAlone, kHoming, kScript };

  void take_in_hand(simulated::Hand hand, std::uint64_t now_ns);
  void begin_script(std::uint64_t now_ns);
  void look_at_references() noexcept;

  FalconArmSettings settings_;
  falcon::Kinematics kinematics_;
  simulated::Mechanics mechanics_;
  Phase phase_ = Phase::kAlone;
  std::uint64_t homing_ends_ns_ = 0;
  std::uint64_t script_began_ns_ = 0;
  std::uint64_t force_until_ns_ = 0;
  Eigen::Vector3d counts_ = Eigen::Vector3d::Zero();  ///< True ones, where the linkage was last seen.
  std::uint8_t was_outside_ = 0;                      ///< Bit i: axis i + 1 has been at its outer end.
  std::uint8_t homed_ = 0;
};

}  // namespace drivers::virtual_usb
