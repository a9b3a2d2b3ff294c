#pragma once
/// @file held_world.hpp
/// The world of local_contact with a hand on it, tick by tick of 1 ms.
#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <utility>

#include "haptic_node/rendering/local_world.hpp"
#include "rtbus/clock.hpp"

namespace tests {

struct HeldWorld {
  static constexpr double kTick_s = 1e-3;

  double stiffness_n_per_m, damping_n_s_per_m;
  std::unique_ptr<haptic::LocalWorld> world;
  std::uint64_t now_ns = rtbus::kNsPerS;

  /// @param more What LocalWorld is made of.
  template <class... More>
  explicit HeldWorld(double stiffness, double damping, More&&... more)
      : stiffness_n_per_m(stiffness),
        damping_n_s_per_m(damping),
        world(std::make_unique<haptic::LocalWorld>(std::forward<More>(more)...)) {}

  void reset(const Eigen::Vector3d& proxy_m) { world->reset(proxy_m, now_ns); }
  /// @returns the force on the hand, N.
  Eigen::Vector3d tick(const Eigen::Vector3d& hand_m, const Eigen::Vector3d& hand_m_s = Eigen::Vector3d::Zero()) {
    now_ns += rtbus::kNsPerMs;
    world->advance({hand_m, hand_m_s, stiffness_n_per_m, damping_n_s_per_m}, now_ns, kTick_s);
    return world->impulse_n_s() / kTick_s;
  }
  /// The same along x.
  double tick(double x_m, double velocity_m_s = 0.0) { return tick({x_m, 0, 0}, {velocity_m_s, 0, 0}).x(); }
};

}  // namespace tests
