#pragma once
/// @file engine_registry.hpp
/// The engines this build knows, one row each.
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "physics_node/engine/engine_module.hpp"
#include "physics_node/engine/world.hpp"
#include "rtbus/config/scene.hpp"

namespace physics {

/// Makes a world from a checked scene. An engine that lives in a module of its own loads it in here, so that a session
/// which names another engine never maps it. Throws rtbus::config::Error when the engine cannot do what the scene asks,
/// or when its module is not there.
using EngineFactory = std::unique_ptr<World> (*)(const rtbus::config::Scene& scene, const EngineSettings& settings);

/// The engine of exact contact with what stands.
inline constexpr std::string_view kAnalyticEngine = "analytic";
/// The engine that is a program of the user's (docs/your-own-physics.md).
inline constexpr std::string_view kExternalEngine = "external";

struct EngineEntry {
  std::string_view name;         ///< In YAML, `physics.engine`.
  std::string_view description;  ///< One line for people.
  std::string_view left_out;     ///< Comma-separated: what a session with this engine does without.
  std::string_view module;       ///< File that the engine lives in; empty: in the node itself.
  EngineFactory factory;
  /// Program that takes the place of physics_node, beside it; empty: none. `external` has the session's own command.
  std::string_view program = "";
};

/// All rows, in the order in which they are listed to the user.
[[nodiscard]] std::span<const EngineEntry> registered_engines() noexcept;

[[nodiscard]] std::vector<std::string> engine_names();

/// Null when there is no row of that name.
[[nodiscard]] const EngineEntry* find_engine(std::string_view name) noexcept;

/// False when the engine lives in a module that was not built or is not installed beside this program.
[[nodiscard]] bool engine_present(const EngineEntry& entry);

/// Whether that engine can do the bodies of `scene`, before anything is started. Throws rtbus::config::Error as
/// make_world() does: with file, line, key, value and remedy.
void check_scene(std::string_view engine, const rtbus::config::Scene& scene);

/// The world of `scene` in the engine of that name. Throws rtbus::config::Error, which lists the engines when the name
/// is unknown and names the body when the engine cannot do it.
[[nodiscard]] std::unique_ptr<World> make_world(std::string_view engine, const rtbus::config::Scene& scene,
                                                const EngineSettings& settings = {});

}  // namespace physics
