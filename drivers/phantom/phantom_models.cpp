#include "drivers/phantom/phantom_models.hpp"

#include <algorithm>

namespace drivers::phantom {
namespace {

// Lengths, transmissions, home offsets, torque constants, signs, force and stiffness: the published configuration of
// `hfabapi` (forsslund, 2026). Where it is silent, the comment says what stands here instead.

// SensAble PHANToM 1.0 class mechanics with new electronics. Home: upper arm horizontal, forearm straight down.
Model vintage() {
  Model m;
  m.id = ModelId::kVintage;
  m.key = "vintage";
  m.name = "Vintage PHANToM";
  m.home = "with the upper arm horizontal and the forearm straight down";
  m.arm = {0.0, 0.138, 0.112};  // 0.097 without the tip adapter
  m.origin_m = {0.138, 0.0, -0.097};
  m.capstan_m = {0.013, 0.010, 0.010};
  m.body_m = {0.117, 0.077, 0.077};
  m.direction = {-1, 1, -1};
  m.counts_per_turn = 4000;
  m.home_counts = {0, 7700, 0};
  m.torque_constant_n_m_per_a = {0.0234, 0.0234, 0.0234};  // Maxon RE25
  m.gimbal = GimbalKind::kEncoder;
  m.gimbal_counts_per_turn = 2000;
  m.limits.max_force_n = 5.0;
  m.limits.max_stiffness_n_per_m = 800.0;
  m.limits.max_slew_n_per_ms = 3.0;            // own choice: above 2·K·v at 0.6 m/s
  m.limits.apparent_mass_kg = 0.075;           // the PHANToM 1.0's data sheet, from memory: less than that
  m.limits.coulomb_friction_n = 0.03;          // own choice below the data sheet's 0.04 N
  m.limits.viscous_damping_n_s_per_m = 0.005;  // PHANToM 1.0 in stability papers, from memory
  m.limits.workspace_min_m = {-0.06, -0.05,
                              -0.08};  // own choice: a box within reach; published is "about 0.1 m around"
  m.limits.workspace_max_m = {0.06, 0.10, 0.05};
  return m;
}

// The open-source device of Forsslund and others (TEI 2015). Home: upper arm up, forearm horizontal.
Model woody() {
  Model m;
  m.id = ModelId::kWoody;
  m.key = "woodenhaptics";
  m.name = "WoodenHaptics";
  m.home = "with the upper arm upright and the forearm horizontal";
  m.arm = {0.080, 0.205, 0.245};
  m.origin_m = {0.220, 0.0, 0.080};
  m.capstan_m = {0.010, 0.010, 0.010};
  m.body_m = {0.160, 0.120, 0.120};
  m.direction = {1, -1, -1};
  m.counts_per_turn = 2000;
  m.home_counts = {0, 0, -6000};
  m.torque_constant_n_m_per_a = {0.0259, 0.0259, 0.0259};
  m.weight = {0.170, 0.051, 0.110, 0.091};
  m.limits.max_force_n = 5.0;
  m.limits.max_stiffness_n_per_m = 1000.0;
  m.limits.max_slew_n_per_ms = 3.0;            // own choice: above 2·K·v at 0.6 m/s
  m.limits.apparent_mass_kg = 0.2;             // own estimate from the link masses; nothing is published
  m.limits.coulomb_friction_n = 0.4;           // own choice below the 0.6…0.9 N measured (TEI 2015)
  m.limits.viscous_damping_n_s_per_m = 0.005;  // own choice: as Vintage
  m.limits.workspace_min_m = {-0.1, -0.1, -0.1};
  m.limits.workspace_max_m = {0.1, 0.1, 0.1};
  return m;
}

// Haptikfabriken's Polhem, third version.
Model polhem() {
  Model m;
  m.id = ModelId::kPolhem;
  m.key = "polhem";
  m.name = "Polhem";
  m.home = "with its links in the maker's calibration pose";
  m.five_bar = true;
  m.linkage = {0.034, 0.165, 0.025, 0.190, 0.034, 0.1308};
  m.origin_m = {0.2045, 0.0, 0.0325};
  m.capstan_m = {0.0288534, 0.0136981, 0.0137281};
  m.body_m = {0.175, 0.100, 0.100};
  m.direction = {1, -1, 1};
  m.counts_per_turn = 4096;
  m.home_counts = {8312, -10366, 19764};
  m.torque_constant_n_m_per_a = {0.0603, 0.0538, 0.0538};
  m.gimbal = GimbalKind::kMagnetic;
  m.gimbal_counts_per_turn = 1024;
  m.gimbal_home_counts = {0, 30, 0};
  m.limits.max_force_n = 5.0;
  m.limits.max_stiffness_n_per_m = 2000.0;
  m.limits.max_slew_n_per_ms = 3.0;            // own choice: above 2·K·v at 0.6 m/s
  m.limits.apparent_mass_kg = 0.15;            // own estimate; nothing is published
  m.limits.coulomb_friction_n = 0.03;          // own choice, nothing is published: as Vintage
  m.limits.viscous_damping_n_s_per_m = 0.005;  // own choice: as Vintage
  m.limits.workspace_min_m = {-0.065, -0.065,
                              -0.065};  // own choice: a cube within reach; a sphere of 0.15 m is published
  m.limits.workspace_max_m = {0.065, 0.065, 0.065};
  return m;
}

}  // namespace

std::span<const Model> models() noexcept {
  static const std::array all{vintage(), woody(), polhem()};
  return all;
}

const Model* find_model(int id) noexcept {
  const auto all = models();
  const auto found = std::find_if(all.begin(), all.end(), [&](const Model& m) { return static_cast<int>(m.id) == id; });
  return found == all.end() ? nullptr : &*found;
}

}  // namespace drivers::phantom
