#include "drivers/simulated/models.hpp"

#include <array>

namespace drivers::simulated {
namespace {

// SensAble PHANToM Desktop (3D Systems Touch X).
Model phantom_desktop() {
  Model model;
  model.name = "phantom_desktop";
  MechanicsParameters& m = model.mechanics;
  // Mass, friction and weight are calibrated together: with them a fall from 20 mm onto a wall of 200 N/m settles after
  // 0.7 s near -2 mm, as He & Choi (2013, Fig. 8) report of the real device. The data sheet says 0.045 kg and 0.06 N.
  m.mass_kg = 0.041;
  m.viscous_n_s_per_m = 0.05;
  m.coulomb_n = 0.06;
  m.gravity_m_s2 = {0.0, -9.81, 0.0};
  m.max_force_n = 7.9;                        // data sheet, peak
  m.force_step_n = 7.9 / 2048;                // own choice: 12 bit over ± full scale
  m.position_quantum_m = 23e-6;               // data sheet: 1100 dpi
  m.workspace_min_m = {-0.08, -0.06, -0.06};  // data sheet: 160 x 120 x 120 mm
  m.workspace_max_m = {0.08, 0.06, 0.06};
  model.limits.continuous_force_n = 1.75;       // data sheet
  model.limits.max_stiffness_n_per_m = 1480.0;  // data sheet: softest axis (z) of 1.86, 2.35, 1.48 N/mm
  model.limits.max_slew_n_per_ms = 3.0;         // own choice: above 2·K·v = 1.8 N/ms at that stiffness and 0.6 m/s
  return model;
}

// SensAble PHANToM Omni (3D Systems Touch).
Model phantom_omni() {
  Model model;
  model.name = "phantom_omni";
  MechanicsParameters& m = model.mechanics;
  m.mass_kg = 0.045;            // data sheet; identified rigid models give 0.03 to 0.2 kg by direction
  m.viscous_n_s_per_m = 0.028;  // own choice: 5e-4 N·m·s/rad at a joint, divided by the link length 0.13335 m squared
  m.coulomb_n = 0.26;           // data sheet; measured 0.2 to 1.1 N by direction
  m.gravity_m_s2 = {0.0, 0.0, 0.0};            // own choice: springs balance the arm near the centre
  m.max_force_n = 3.3;                         // data sheet, peak
  m.force_step_n = 3.3 / 2048;                 // own choice: 12 bit over ± full scale
  m.position_quantum_m = 55e-6;                // data sheet: 450 dpi
  m.workspace_min_m = {-0.08, -0.06, -0.035};  // data sheet: 160 x 120 x 70 mm
  m.workspace_max_m = {0.08, 0.06, 0.035};
  model.limits.continuous_force_n = 0.88;       // data sheet
  model.limits.max_stiffness_n_per_m = 1020.0;  // data sheet: softest axis (z) of 1.26, 2.31, 1.02 N/mm
  model.limits.max_slew_n_per_ms = 2.0;         // own choice: above 2·K·v = 1.2 N/ms
  return model;
}

// Novint Falcon.
Model falcon() {
  Model model;
  model.name = "falcon";
  MechanicsParameters& m = model.mechanics;
  // Two observations by users agree on 0.13 to 0.19 kg: the weight that has to be compensated, and the period of 166 ms
  // at the stability limit of a proportional controller at 185 N/m (K/ω²).
  m.mass_kg = 0.14;
  m.viscous_n_s_per_m = 0.28;          // own choice: that limit, 185 N/m, times 1.5 ms of delay (b = K·t_d)
  m.coulomb_n = 0.15;                  // own choice: users call it small; the grip sinks, so it is far below the weight
  m.gravity_m_s2 = {0.0, -9.81, 0.0};  // the arm is not balanced
  m.max_force_n = 8.0;                 // advertised: more than 8.9 N (2 lbf); common drivers limit to 8 N
  m.force_step_n = 8.0 / 4096;         // commands run to ±4095 at full scale
  m.position_quantum_m = 60e-6;  // advertised: more than 400 dpi; geometry gives 45 µm for one count of one encoder
  m.workspace_min_m = {-0.0508, -0.0508, -0.0508};  // advertised: 4 x 4 x 4 in
  m.workspace_max_m = {0.0508, 0.0508, 0.0508};
  model.limits.continuous_force_n = 4.0;        // own choice: the maker names none
  model.limits.max_stiffness_n_per_m = 1000.0;  // own choice within the 800 to 3000 N/m of common drivers
  model.limits.max_slew_n_per_ms = 3.0;         // own choice: above 2·K·v = 1.2 N/ms
  return model;
}

}  // namespace

std::span<const Model> models() {
  static const std::array all{phantom_desktop(), phantom_omni(), falcon()};
  return all;
}

}  // namespace drivers::simulated
