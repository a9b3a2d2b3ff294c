#include "drivers/force_dimension/models.hpp"

#include <array>
#include <string>

namespace drivers::force_dimension {
namespace {

/// Peak force, stiffness and radius as CHAI3D's table assumes them, where it has the device. Everything else is our own
/// choice: 40 % of the peak without time limit, growth of the force just above 2·K·v at 0.6 m/s, no promise about
/// friction, a mass that is rather too small than too large.
DeviceInfo limits(double max_force_n, double stiffness_n_per_m, double radius_m, double height_m, double mass_kg) {
  DeviceInfo out;
  out.dof_sensed = 3;
  out.max_force_n = max_force_n;
  out.continuous_force_n = 0.4 * max_force_n;
  out.max_stiffness_n_per_m = stiffness_n_per_m;
  out.max_slew_n_per_ms = 1.25e-3 * stiffness_n_per_m;
  out.position_quantum_m = 10e-6;
  out.apparent_mass_kg = mass_kg;
  out.workspace_min_m = {-radius_m, -height_m, -radius_m};
  out.workspace_max_m = {radius_m, height_m, radius_m};
  out.can_pace_loop = true;
  return out;
}

std::array<Model, 9> make_models() {
  // Workspaces: diameter and height of the maker's sheet as quoted elsewhere, not verified. lambda: nothing was found,
  // so its limits are low on purpose. delta.6: its stiffness was not found.
  const DeviceInfo omega = limits(12.0, 5000.0, 0.080, 0.055, 0.15);
  const DeviceInfo delta3 = limits(20.0, 5000.0, 0.200, 0.130, 0.25);  // the SDK's effector mass: 0.279 kg
  const DeviceInfo delta6 = limits(20.0, 2000.0, 0.150, 0.130, 0.25);
  const DeviceInfo sigma = limits(12.0, 4000.0, 0.095, 0.065, 0.25);
  const DeviceInfo lambda = limits(8.0, 2000.0, 0.075, 0.055, 0.25);
  const DeviceInfo falcon = limits(8.0, 1000.0, 0.040, 0.040, 0.14);  // as our own driver of the Falcon has them
  return {{{"omega3", "omega.3", {33, -1}, false, false, false, true, omega},
           {"omega6", "omega.6", {34, 36}, true, false, false, true, omega},
           {"omega7", "omega.7", {35, 37}, true, true, true, true, omega},
           {"delta3", "delta.3", {63, -1}, false, false, false, false, delta3},
           {"delta6", "delta.6", {64, -1}, true, true, false, false, delta6},
           {"sigma7", "sigma.7", {104, 105}, true, true, true, true, sigma},
           {"lambda3", "lambda.3", {203, -1}, false, false, false, true, lambda},
           {"lambda7", "lambda.7", {108, 109}, true, true, true, true, lambda},
           {"falcon", "Falcon", {60, -1}, false, false, false, false, falcon}}};
}

}  // namespace

std::span<const Model> models() {
  static const std::array<Model, 9> all = make_models();
  return all;
}

std::string product_of(int type) {
  for (const Model& model : models()) {
    if (type == model.types[0] || type == model.types[1]) return model.product;
  }
  return "device of type " + std::to_string(type);
}

}  // namespace drivers::force_dimension
