/// The one symbol by which the node finds Bullet.
#include "physics_node/bullet/bullet_world.hpp"
#include "physics_node/engine/engine_module.hpp"

namespace {

std::unique_ptr<physics::World> make_world(const rtbus::config::Scene& scene, const physics::EngineSettings& settings) {
  return std::make_unique<physics::bullet::BulletWorld>(scene, settings);
}

constexpr physics::EngineModule kModule{physics::kEngineAbiVersion, sizeof(rtbus::config::Scene),
                                        sizeof(rtbus::config::Body), &make_world};

}  // namespace

extern "C" const physics::EngineModule* rtbus_engine_module() { return &kModule; }
