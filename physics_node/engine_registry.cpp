#include "physics_node/engine_registry.hpp"

#include <dlfcn.h>

#include <filesystem>

#include "physics_node/analytic/analytic_world.hpp"

namespace physics {
namespace {

using rtbus::config::Body;
using rtbus::config::BodyType;
using rtbus::config::Error;
using rtbus::config::Scene;

/// "scenes/wall.yaml:14: bodies.0.type": where a body says what the engine cannot do.
std::string place_of(const Scene& scene, const std::string& source, std::string_view key) {
  return (source.empty() ? scene.file + ": body" : source) + "." + std::string(key);
}

void check_analytic(const Scene& scene) {
  const std::string engine = ", which physics.engine = analytic ", remedy = "write engine: bullet";
  if (!scene.soft_bodies.empty()) {
    const auto& body = scene.soft_bodies.front();
    throw Error((body.source.empty() ? scene.file : body.source) + ": body " + body.name + " is soft" + engine +
                "cannot do; " + remedy);
  }
  for (const Body& body : scene.bodies) {
    if (body.type != BodyType::kStatic) {
      throw Error(place_of(scene, body.source, "type") + " = " +
                  (body.type == BodyType::kDynamic ? "dynamic" : "kinematic") + ": body " + body.name + " moves" +
                  engine + "cannot do; make it static or " + remedy);
    }
    if (body.shape.index() >= std::variant_size_v<rtbus::shapes::Shape>) {
      throw Error(place_of(scene, body.source, "shape") + ": body " + body.name + " is a " +
                  std::string(name_of(body.shape)) + engine + "does not know; it knows plane, sphere and box; " +
                  remedy);
    }
    if (body.restitution != 0.0) {
      throw Error(place_of(scene, body.source, "restitution") + ": body " + body.name + " has a restitution" + engine +
                  "does not know; leave it out or " + remedy);
    }
  }
}

std::unique_ptr<World> make_analytic(const Scene& scene, const EngineSettings&) {
  return std::make_unique<AnalyticWorld>(scene.static_shapes());
}

/// Beside this program, or in ../lib: where the build and an installation put modules.
std::vector<std::filesystem::path> module_places(std::string_view module) {
  std::error_code failed;
  const auto folder = std::filesystem::read_symlink("/proc/self/exe", failed).parent_path();
  return {folder / module, (folder / "../lib" / module).lexically_normal()};
}

std::filesystem::path find_module(std::string_view module) {
  std::error_code failed;
  for (const auto& place : module_places(module)) {
    if (std::filesystem::is_regular_file(place, failed)) return place;
  }
  return {};
}

/// Loads a module once per process and asks for its table.
const EngineModule& load_module(std::string_view engine, std::string_view module_name, const std::string& scene_file) {
  const std::string wanted = scene_file + ": physics.engine = " + std::string(engine);
  const auto file = find_module(module_name);
  if (file.empty()) {
    const auto places = module_places(module_name);
    throw Error(wanted + " needs the module " + std::string(module_name) + ", which is not in " +
                places[0].parent_path().string() + " or " + places[1].parent_path().string() +
                "; build with RTBUS_WITH_BULLET=ON (Debian package libbullet-dev), or choose another engine");
  }
  void* const library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);  // again: the same handle
  if (library == nullptr) throw Error(wanted + ": cannot load its module: " + dlerror());
  const auto function = reinterpret_cast<EngineModuleFunction>(dlsym(library, kEngineModuleSymbol));
  if (function == nullptr) throw Error(wanted + ": " + file.string() + " is no engine module; build it again");
  const EngineModule* const module = function();
  if (module->abi_version != kEngineAbiVersion || module->scene_bytes != sizeof(Scene) ||
      module->body_bytes != sizeof(Body)) {
    throw Error(wanted + ": " + file.string() + " belongs to another build of this program; build both again");
  }
  return *module;
}

constexpr std::string_view kRigidModule = "libphysics_bullet.so";
constexpr std::string_view kSoftModule = "libphysics_bullet_soft.so";  // the same, and Bullet's library of soft bodies

std::unique_ptr<World> make_bullet(const Scene& scene, const EngineSettings& settings) {
  const std::string_view module = scene.soft_bodies.empty() ? kRigidModule : kSoftModule;
  return load_module("bullet", module, scene.file).make_world(scene, settings);
}

/// An engine that is a process of its own: it runs in the place of this one.
std::unique_ptr<World> refuse_external(const Scene& scene, const EngineSettings&) {
  throw Error(
      scene.file +
      ": physics.engine names a program that takes the place of physics_node; start the session with `rtbus run`, "
      "or that program alone");
}

constexpr EngineEntry kEngines[] = {
    {kAnalyticEngine, "Exact contact with static planes, spheres and boxes", "Bullet, moving bodies", "",
     &make_analytic},
    {"bullet", "Bullet: rigid bodies that move, stack and sleep, and soft bodies", "", kRigidModule, &make_bullet},
    {kExternalEngine, "A program of your own, which physics.command names", "Bullet", "", &refuse_external},
    {"mujoco", "MuJoCo: rigid bodies with soft contacts, in a program of its own", "Bullet", "", &refuse_external,
     "mujoco_engine"},
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

bool engine_present(const EngineEntry& entry) { return entry.module.empty() || !find_module(entry.module).empty(); }

std::unique_ptr<World> make_world(std::string_view engine, const Scene& scene, const EngineSettings& settings) {
  check_scene(engine, scene);
  return find_engine(engine)->factory(scene, settings);
}

void check_scene(std::string_view engine, const Scene& scene) {
  if (find_engine(engine) == nullptr) {
    std::string known;
    for (const std::string& name : engine_names()) known += (known.empty() ? "" : ", ") + name;
    throw Error("physics.engine = " + std::string(engine) + " is not known; choose " + known);
  }
  if (engine == kAnalyticEngine) check_analytic(scene);
}

}  // namespace physics
