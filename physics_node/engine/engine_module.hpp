#pragma once
/// @file engine_module.hpp
/// What an engine in a shared library of its own must export, so that a node which does not name it maps none of its
/// code. The node loads the library by dlopen from the folder it stands in itself, or ../lib beside that.
///
/// The table carries C++ types, so a module belongs to the build it was made with; the version guards against a module
/// left over from another one. A module is never unloaded: its worlds and their code live as long as the process.
#include <cstdint>
#include <memory>

#include "physics_node/engine/world.hpp"
#include "rtbus/config/scene.hpp"

namespace physics {

/// What of `physics:` an engine may use beside the scene.
struct EngineSettings {
  int solver_iterations = 10;  ///< Sweeps over all contacts in each part of a step.
};

/// Raise it when World, Scene, EngineSettings or this table change.
inline constexpr std::uint32_t kEngineAbiVersion = 4;

/// What a module tells about itself, and the function that makes its world.
struct EngineModule {
  std::uint32_t abi_version;  ///< First, whatever else changes.
  std::uint32_t scene_bytes;  ///< sizeof(Scene) and sizeof(Body) as the module saw them: catches a forgotten version.
  std::uint32_t body_bytes;
  /// Throws rtbus::config::Error.
  std::unique_ptr<World> (*make_world)(const rtbus::config::Scene& scene, const EngineSettings& settings);
};

/// The one symbol of a module, with C linkage.
using EngineModuleFunction = const EngineModule* (*)();
inline constexpr char kEngineModuleSymbol[] = "rtbus_engine_module";

}  // namespace physics
