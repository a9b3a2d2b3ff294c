#pragma once
/// @file scenes.hpp
/// Scenes of the tests of the engine bullet, and what is asked of a pile of bodies.
#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "physics_node/engine_registry.hpp"

namespace tests {

using Eigen::Vector3d;

inline std::unique_ptr<physics::World> bullet(const rtbus::config::Scene& scene, int iterations = 10) {
  return physics::make_world("bullet", scene, {.solver_iterations = iterations});
}

inline rtbus::config::Body body(const std::string& name, rtbus::config::BodyShape shape,
                                const Vector3d& position_m = Vector3d::Zero(), double mass_kg = 0.0) {
  rtbus::config::Body out;
  out.name = name;
  out.shape = std::move(shape);
  out.p_WB = position_m;
  out.friction = 0.5;
  out.type = mass_kg > 0.0 ? rtbus::config::BodyType::kDynamic : rtbus::config::BodyType::kStatic;
  out.mass_kg = mass_kg;
  return out;
}

inline rtbus::config::Scene floor_scene() {
  rtbus::config::Scene scene;
  scene.file = "test.yaml";
  scene.bodies.push_back(body("floor", rtbus::shapes::Plane{}));
  return scene;
}

/// A block of cubes on the floor, `gap_m` apart sideways. Mass as of the 20 mm cubes of 20 g.
inline rtbus::config::Scene stack_scene(int wide, int high, int deep, double edge_m, double gap_m) {
  rtbus::config::Scene scene = floor_scene();
  const double mass_kg = 0.02 * std::pow(edge_m / 0.02, 3);
  for (int i = 0; i < wide; ++i) {
    for (int j = 0; j < high; ++j) {
      for (int k = 0; k < deep; ++k) {
        const Vector3d place(i * (edge_m + gap_m), (j + 0.5) * edge_m, k * (edge_m + gap_m));
        scene.bodies.push_back(body("cube_" + std::to_string(i) + '_' + std::to_string(j) + '_' + std::to_string(k),
                                    rtbus::shapes::Box{Vector3d::Constant(0.5 * edge_m)}, place, mass_kg));
      }
    }
  }
  return scene;
}

/// How a stack stands after a while.
struct Rest {
  double height_error_m = 0.0;      ///< Largest distance of a centre from the height it was built at.
  double creep_m = 0.0;             ///< Largest distance of a centre from where it was built.
  double mean_penetration_m = 0.0;  ///< Of a cube into what it stands on, mean over those deeper than touching.
  std::size_t awake = 0;
};

/// Height above the neighbour below tells the penetration: cubes of a column follow each other in the scene's order k
/// last, so the one below (i, j − 1, k) is `deep` bodies earlier; for the lowest it is the floor.
inline Rest look_at(const physics::World& world, const rtbus::config::Scene& scene, int high, int deep, double edge_m) {
  Rest out;
  double penetration_m = 0.0;
  for (std::size_t i = 1; i < scene.bodies.size(); ++i) {
    const Vector3d at = world.body_pose(i).position_m;
    out.height_error_m = std::max(out.height_error_m, std::abs(at.y() - scene.bodies[i].p_WB.y()));
    out.creep_m = std::max(out.creep_m, (at - scene.bodies[i].p_WB).norm());
    const int layer = static_cast<int>((i - 1) / static_cast<std::size_t>(deep)) % high;
    const double below_m =
        layer == 0 ? -0.5 * edge_m : world.body_pose(i - static_cast<std::size_t>(deep)).position_m.y();
    penetration_m += std::max(0.0, edge_m - (at.y() - below_m));
  }
  out.mean_penetration_m = penetration_m / static_cast<double>(scene.bodies.size() - 1);
  out.awake = world.awake_bodies();
  return out;
}

}  // namespace tests
