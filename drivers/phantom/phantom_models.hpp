#pragma once
/// @file phantom_models.hpp
/// The three arms that the bracket protocol knows, each number with its source in phantom_models.cpp.
///
/// Frame M (the maker's): x towards the user, y to the right, z up. Our frame D is x right, y up, z towards the user:
/// (x, y, z)_D = (y, z, x)_M. Both have their origin at the centre of the workspace.
#include <array>
#include <cstdint>
#include <span>
#include <string_view>

#include "drivers/device.hpp"

namespace drivers::phantom {

/// As on the wire.
enum class ModelId : std::uint8_t { kPolhem = 1, kVintage = 2, kWoody = 3 };

enum class GimbalKind : std::uint8_t {
  kNone,      ///< The counters e3…e5 stay 0.
  kMagnetic,  ///< 10 bit per turn; each is refreshed at a third of the rate. First axis along the arm.
  kEncoder    ///< 2000 counts per turn. First axis vertical to the arm.
};

/// Two links in a vertical plane on a turntable; the forearm is driven through a parallelogram, so that its angle is
/// measured against the ground.
struct SerialArm {
  double column_m = 0.0;     ///< Height of the shoulder, L_n.
  double upper_arm_m = 0.0;  ///< L_b.
  double forearm_m = 0.0;    ///< L_c, to the tip.
};

/// A five-bar linkage in a vertical plane on a turntable.
struct FiveBar {
  double pivots_m = 0.0;   ///< L0, between the two driven pivots.
  double crank_m = 0.0;    ///< L1, driven by motor b.
  double lever_m = 0.0;    ///< L2, driven by motor c.
  double rod_m = 0.0;      ///< L3, from the lever to the coupler.
  double coupler_m = 0.0;  ///< L4, of the coupler behind the crank.
  double pen_m = 0.0;      ///< L5, of the coupler before the crank, to the tip.
};

/// What weighs on a serial arm; zero when no figures are known.
struct ArmWeight {
  double upper_arm_kg = 0.0;
  double upper_arm_centre_m = 0.0;
  double forearm_kg = 0.0;
  double forearm_centre_m = 0.0;
};

struct Model {
  ModelId id = ModelId::kVintage;
  std::string_view key;   ///< `model:` in the device file.
  std::string_view name;  ///< For people.
  std::string_view home;  ///< Its home pose, in words: "with the upper arm …".
  bool five_bar = false;
  SerialArm arm;                      ///< Of a serial arm.
  FiveBar linkage;                    ///< Of a five-bar.
  std::array<double, 3> origin_m{};   ///< Centre of the workspace from the foot of the turntable's axis, frame M.
  std::array<double, 3> capstan_m{};  ///< Diameters of the capstans.
  std::array<double, 3> body_m{};     ///< Diameters that the cables run on.
  std::array<int, 3> direction{};     ///< Sign of joint angle over counts.
  int counts_per_turn = 0;            ///< Motor encoders, ×4.
  std::array<std::int32_t, 3> home_counts{};  ///< Added to the counters: what they would read in the zero pose.
  std::array<double, 3> torque_constant_n_m_per_a{};
  GimbalKind gimbal = GimbalKind::kNone;
  int gimbal_counts_per_turn = 0;
  std::array<std::int32_t, 3> gimbal_home_counts{};
  ArmWeight weight;
  /// Force, stiffness, slew, mass, friction and workspace; the rest is computed (phantom_config.cpp).
  DeviceInfo limits;
};

/// All models.
[[nodiscard]] std::span<const Model> models() noexcept;

/// The model of that number; null when there is none.
[[nodiscard]] const Model* find_model(int id) noexcept;

}  // namespace drivers::phantom
