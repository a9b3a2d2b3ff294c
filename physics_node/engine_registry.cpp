#include "physics_node/engine_registry.hpp"

#include "physics_node/analytic/analytic_world.hpp"

namespace physics {
namespace {

std::unique_ptr<World> make_analytic(const rtbus::config::Scene& scene) {
  for (const rtbus::config::Body& body : scene.bodies) {
    if (body.type != rtbus::config::BodyType::kStatic) {
      throw rtbus::config::Error(scene.file + ": body " + body.name +
                                 " moves, which the engine analytic cannot do; make it "
                                 "static or choose an engine that moves bodies");
    }
  }
  return std::make_unique<AnalyticWorld>(scene.static_shapes());
}

constexpr EngineEntry kEngines[] = {
    {"analytic", "Exact contact with static planes, spheres and boxes",
     "Bullet, moving bodies, soft bodies, body poses, contact constraints on the link", &make_analytic},
};

}  // namespace

std::span<const EngineEntry> registered_engines() noexcept { return kEngines; }

std::vector<std::string> engine_names() {
  std::vector<std::string> names;
  for (const EngineEntry& entry : kEngines) names.emplace_back(entry.name);
  return names;
}

const EngineEntry* find_engine(std::string_view name) noexcept {
  for (const EngineEntry& entry : kEngines) {
    if (entry.name == name) return &entry;
  }
  return nullptr;
}

std::unique_ptr<World> make_world(std::string_view engine, const rtbus::config::Scene& scene) {
  const EngineEntry* entry = find_engine(engine);
  if (entry == nullptr) {
    std::string known;
    for (const std::string& name : engine_names()) known += (known.empty() ? "" : ", ") + name;
    throw rtbus::config::Error("physics.engine = " + std::string(engine) + " is not known; choose " + known);
  }
  return entry->factory(scene);
}

}  // namespace physics
