#include "drivers/openhaptics/models.hpp"

#include <array>

namespace drivers::openhaptics {
namespace {

/// The workspace is centred. Own choice for all: nothing is promised about friction, and the force may grow just above
/// 2·K·v at 0.6 m/s.
DeviceInfo limits(double peak_n, double continuous_n, double stiffness_n_per_m, double mass_kg, double quantum_m,
                  const Vec3& size_m) {
  DeviceInfo out;
  out.dof_sensed = 6;
  out.max_force_n = peak_n;
  out.continuous_force_n = continuous_n;
  out.max_stiffness_n_per_m = stiffness_n_per_m;
  out.max_slew_n_per_ms = 1.5e-3 * stiffness_n_per_m;
  out.apparent_mass_kg = mass_kg;
  out.position_quantum_m = quantum_m;
  for (std::size_t i = 0; i < 3; ++i) {
    out.workspace_min_m[i] = -0.5 * size_m[i];
    out.workspace_max_m[i] = 0.5 * size_m[i];
  }
  out.can_pace_loop = true;
  out.sample_rate_hz = 1000.0;
  out.force_timeout_s = 0.020;
  return out;
}

}  // namespace

std::span<const Model> models() {
  // Forces of Touch and Omni, and the stiffness of the Touch: the setup tool's configuration file. Forces of the
  // others, workspaces: quoted from data sheets. Stiffness of the others: own choice, below their data sheets where one
  // is known. Masses and resolutions: data sheets of Omni and Desktop; of the Premiums own choice.
  static const std::array<Model, 6> all{{
      {"touch", "Touch", limits(3.3, 0.88, 500.0, 0.045, 55e-6, {0.160, 0.120, 0.070})},
      {"touch_x", "", limits(7.9, 1.75, 1000.0, 0.045, 23e-6, {0.160, 0.120, 0.120})},
      {"omni", "PHANTOM Omni", limits(3.3, 0.88, 500.0, 0.045, 55e-6, {0.160, 0.120, 0.070})},
      {"desktop", "PHANTOM Desktop", limits(7.9, 1.75, 1000.0, 0.045, 23e-6, {0.160, 0.120, 0.120})},
      {"premium_1_5", "PHANTOM Premium 1.5 6DOF", limits(8.5, 1.4, 1000.0, 0.075, 30e-6, {0.381, 0.267, 0.191})},
      {"premium_3_0", "PHANTOM Premium 3.0 6DOF", limits(22.0, 3.0, 1000.0, 0.150, 20e-6, {0.838, 0.584, 0.406})},
  }};
  return all;
}

}  // namespace drivers::openhaptics
