#pragma once
/// @file network_grid.hpp
/// The grid of `rtbus evaluate network`, and what is said of it.
#include <vector>

#include "tools/evaluation/network/network.hpp"

namespace tools {

struct NetworkScene {
  const char* name;
  StabilityTask task;
  bool moves_by_itself;  ///< What is touched does not wait for the hand.
  double speed_m_s;      ///< Largest relative speed of hand and touched body.
};
[[nodiscard]] const std::vector<NetworkScene>& network_scenes();

/// One run of the grid.
struct NetworkGridCell {
  std::size_t scene, method;  ///< Of network_scenes() and network_methods().
  NetworkOptions network;

  /// A session is refused that asks for it (refused_across_network()): it is not run.
  [[nodiscard]] bool refused() const;
  /// What a session gets there that names no method.
  [[nodiscard]] bool usual() const;
};

/// The hand that is taken where stiffness is compared with theory: the preset light, with the device's own.
inline constexpr double kLightDamping = 1.05;

/// The largest stiffness at which a light hand comes to rest in free air and at a wall, out of steps of a factor of
/// two.
struct StiffnessRow {
  std::size_t method;
  double round_trip_s;
  double stable_n_per_m;  ///< 0: none.
};

void check_grid(const std::vector<NetworkGridCell>& cells, const std::vector<StabilityResult>& results,
                Experiment& experiment);
/// Force over time in the cell of the bars, beside the same hand without a network.
void draw_forces(const NetworkExperiment& options, Experiment& experiment);
void report_stiffness(const std::vector<StiffnessRow>& rows, Experiment& experiment);

/// Force by which a set-point is wrong that comes the round trip of the bars late: K·v·R.
[[nodiscard]] double position_bound_n(const NetworkScene& scene);

}  // namespace tools
