#pragma once
/// @file tune_search.hpp
/// Which gains a device bears at given rates: what theory says, and what the harness does with the same code as the
/// nodes.
#include <functional>
#include <string>
#include <vector>

namespace tools {

struct TuneQuestion {
  std::string wall_file;    ///< Session with a wall at y = 0; device, rates and method are replaced.
  std::string device_file;  ///< Of a simulated device, absolute.
  std::string method;
  double physics_hz = 1000.0;
  double haptic_hz = 1000.0;
  double delay_us = 0.0;  ///< From the hand's sample to the force, measured; samples are up to as old in the harness.
};

/// Upper bounds of the stiffness at one damping. Formulas in their sources' symbols: T period of the loop, b and f_c
/// viscous and dry friction of the device, Δ its encoder step, B the damping that is rendered, t_d the delay beyond the
/// hold.
struct TheoryLimits {
  double passivity_n_per_m = 0.0;  ///< K < 2(b − |B|)/T: Colgate & Schenkel 1997, no hand, no friction. At least 0.
  double friction_n_per_m = 0.0;   ///< K ≤ min(2b/T, 2f_c/Δ): Abbott & Okamura 2005. Infinite without quantum and b.
  double linear_n_per_m = 0.0;     ///< K < (b + B)/(T/2 + t_d): Gil, Sánchez, Hulin et al. 2009.
};
struct DeviceFigures {
  std::string model;
  double mass_kg = 0.0, viscous_n_s_per_m = 0.0, coulomb_n = 0.0, quantum_m = 0.0, max_force_n = 0.0;
  double max_stiffness_n_per_m = 0.0;  ///< What the loop renders at most, here and at this rate.
};
[[nodiscard]] TheoryLimits theory_limits(const DeviceFigures& device, double damping_n_s_per_m, double haptic_hz,
                                         double delay_s);

/// One ratio of damping to stiffness, and the stiffest wall at which each hand comes to rest.
struct TuneRow {
  double damping_time_s = 0.0;  ///< B/K.
  double none_n_per_m = 0.0;    ///< Nobody holds the device: dropped from 20 mm.
  double normal_n_per_m = 0.0;  ///< A hand of 300 N/m pushes 5 mm in.
  double firm_n_per_m = 0.0;    ///< A hand of 700 N/m.
  [[nodiscard]] double all_n_per_m() const noexcept;
};

/// In free air at 0.1 m/s with the advised gains.
struct FreeAir {
  double drag_n_s_per_m = 0.0;            ///< Mean force against the motion over the speed.
  double ripple_n = 0.0;                  ///< Peak to peak of what is left.
  double predicted_drag_n_s_per_m = 0.0;  ///< K times the age of what is rendered: two periods of physics.
  double predicted_ripple_n = 0.0;        ///< An encoder step at each end of the spring.
};

struct TuneAnswer {
  DeviceFigures device;
  std::vector<TuneRow> rows;
  double stiffness_n_per_m = 0.0;  ///< Advised: kMargin of the best row's.
  double damping_n_s_per_m = 0.0;
  TheoryLimits theory;  ///< At the advised damping.
  FreeAir air;
};

/// Part of the stiffest that is advised: hands and devices differ from their models.
inline constexpr double kTuneMargin = 0.7;

/// @param progress Called with 0…1 now and then; false: stop, and answer with what there is.
/// Throws rtbus::config::Error.
[[nodiscard]] TuneAnswer search_gains(const TuneQuestion& question, const std::function<bool(double)>& progress);

}  // namespace tools
