#include "tools/cli/run/run_plan.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <sstream>
#include <utility>

#include "physics_node/engine_registry.hpp"
#include "rtbus/config/session.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/bridge/config/bridge_config.hpp"
#include "tools/cli/common/find_config.hpp"
#include "tools/cli/common/tree_python.hpp"
#include "tools/cli/host/ask_kernel.hpp"
#include "tools/cli/host/core_plan.hpp"
#include "tools/link/config/only.hpp"

namespace tools {

namespace {

namespace fs = std::filesystem;

/// A part of `physics.command`: a file beside the session file is meant with its whole path, whatever the folder that
/// `rtbus run` was started in.
std::string resolved(const std::string& part, const std::string& session_file) {
  std::error_code failed;
  const fs::path beside = fs::absolute(session_file, failed).parent_path() / part;
  return fs::is_regular_file(beside, failed) ? beside.lexically_normal().string() : part;
}

/// A program as the shell finds it; as it is when there is none.
std::string in_path(const std::string& program) {
  const char* const folders = std::getenv("PATH");
  if (program.find('/') != std::string::npos || folders == nullptr) return program;
  std::istringstream list(folders);
  for (std::string folder; std::getline(list, folder, ':');) {
    const fs::path candidate = fs::path(folder) / program;
    if (::access(candidate.c_str(), X_OK) == 0) return candidate.string();
  }
  return program;
}

/// The program that takes the place of physics_node; none: the user starts it by hand. It learns from its environment
/// which session it serves (rtbus_engine.h).
std::optional<ChildSpec> external_physics(const physics::NodeConfig& config, const physics::EngineEntry& engine,
                                          const std::string& folder, const std::vector<std::string>& assignments) {
  ChildSpec child;
  child.name = "physics";
  child.stage = Stage::kPhysics;
  if (!engine.program.empty()) {
    child.program = folder + "/" + std::string(engine.program);
  } else if (config.physics.command.empty()) {
    return std::nullopt;
  } else {
    const std::vector<std::string>& command = config.physics.command;
    child.program = in_path(resolved(command.front(), config.file));
    for (std::size_t i = 1; i < command.size(); ++i) child.arguments.push_back(resolved(command[i], config.file));
  }
  child.waits_for_reader = true;
  std::error_code failed;
  std::string set;
  for (const std::string& text : assignments) set += (set.empty() ? "" : "\n") + text;
  child.environment = tree_python();
  child.environment.emplace_back("RTBUS_ENGINE_CONFIG", fs::absolute(config.file, failed).string());
  child.environment.emplace_back("RTBUS_ENGINE_SET", set);
  return child;
}

/// Checks the keys of `bridge` and whether its program, which not every build or package has, is here.
ChildSpec bridge_child(rtbus::config::SessionConfig& config, const RunPlan& plan, const std::string& folder,
                       const std::string& file, const std::vector<std::string>& assignments) {
  const std::string place = config.bridge->place();
  (void)bridge::read_bridge_config(config, plan.haptic);
  ChildSpec child{"bridge", Stage::kObserver, folder + "/rtbus_bridge", {"bridge", file}};
  for (const std::string& text : assignments) child.arguments.insert(child.arguments.end(), {"--set", text});
  if (::access(child.program.c_str(), X_OK) != 0) {
    throw rtbus::config::Error(place + " needs the program " + child.program +
                               "; install the package rtbus-bridge, or build with cyclonedds-dev and cyclonedds-tools, "
                               "or leave it out with --set bridge=null");
  }
  return child;
}

/// Likewise the program that links this machine to the others of the session.
ChildSpec link_child(const rtbus::config::SessionConfig& config, const std::string& folder, const std::string& file,
                     const std::vector<std::string>& assignments, const std::vector<std::string>& only) {
  ChildSpec child{"link", Stage::kObserver, folder + "/rtbus_link", {"link", file}};
  for (const std::string& node : only) child.arguments.insert(child.arguments.end(), {"--only", node});
  for (const std::string& text : assignments) child.arguments.insert(child.arguments.end(), {"--set", text});
  if (::access(child.program.c_str(), X_OK) != 0) {
    throw rtbus::config::Error(config.file + ": link: dds needs the program " + child.program +
                               "; install the package rtbus-bridge, or build with cyclonedds-dev and cyclonedds-tools");
  }
  return child;
}

}  // namespace

RunPlan make_run_plan(const std::string& file, const std::vector<std::string>& assignments,
                      const std::vector<std::string>& only) {
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : assignments) overrides.push_back(rtbus::config::parse_override(text));
  rtbus::config::SessionConfig config = rtbus::config::load_session(file, overrides);

  RunPlan plan;
  plan.session = config.session;
  plan.scene = config.scene.name;
  plan.supervise = config.supervise;
  plan.world = config.scene;
  const link_dds::Split split = link_dds::split_session(config, only);
  std::optional<physics::NodeConfig> physics;
  if (config.physics) physics = physics::read_node_config(config);
  for (std::size_t i = 0; i < config.haptic.size(); ++i) plan.haptic.push_back(haptic::read_haptic_config(config, i));

  // A physics that no method asks is left out, though its keys have been checked.
  const bool asked = std::any_of(plan.haptic.begin(), plan.haptic.end(),
                                 [](const haptic::HapticConfig& each) { return each.asks_physics(); });
  if (asked) plan.physics = std::move(physics);
  // What runs on other machines has been checked too: the file is the same there.
  if (!split.is_here("physics")) plan.physics.reset();
  if (plan.physics) physics::check_scene(plan.physics->physics.engine, config.scene);
  for (const std::string& name : split.crossed) {
    if (!split.is_here(name)) plan.far_haptic.push_back(name);
  }
  std::vector<std::string> all;
  for (const haptic::HapticConfig& each : plan.haptic) all.push_back(each.name);
  std::erase_if(plan.haptic, [&](const haptic::HapticConfig& each) { return !split.is_here(each.name); });
  const auto add_warnings = [&plan](const std::string& node, const std::vector<std::string>& warnings) {
    for (const std::string& warning : warnings) plan.warnings.push_back(node + ": " + warning);
  };
  if (plan.physics) add_warnings("physics", plan.physics->warnings);
  for (const haptic::HapticConfig& each : plan.haptic) add_warnings(each.name, each.warnings);

  const std::string folder = folder_of_this_program();
  const auto child = [&](std::string name, Stage stage, const char* program, std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"--config", file});
    for (const std::string& text : assignments) arguments.insert(arguments.end(), {"--set", text});
    return ChildSpec{std::move(name), stage, folder + "/" + program, std::move(arguments)};
  };
  const physics::EngineEntry* const engine =
      plan.physics ? physics::find_engine(plan.physics->physics.engine) : nullptr;
  const bool external = engine != nullptr && (engine->name == physics::kExternalEngine || !engine->program.empty());
  if (external) {
    if (auto own = external_physics(*plan.physics, *engine, folder, assignments)) plan.nodes.push_back(std::move(*own));
    plan.awaits_physics = plan.nodes.empty();
  } else if (plan.physics) {
    plan.nodes.push_back(child("physics", Stage::kPhysics, "physics_node", {}));
  }
  if (config.bridge) plan.bridge = bridge_child(config, plan, folder, file, assignments);
  if (!only.empty() && plan.nodes.empty() && plan.haptic.empty()) {
    throw rtbus::config::Error(file + ": --only leaves no node for this machine: no method asks for physics");
  }
  std::vector<int> requested;
  for (const haptic::HapticConfig& haptic : plan.haptic) requested.push_back(haptic.realtime.core);
  const std::vector<int> cores = plan_cores(cores_of_this_process(), requested);
  for (std::size_t i = 0; i < plan.haptic.size(); ++i) {
    haptic::HapticConfig& haptic = plan.haptic[i];
    if (haptic.device->own_process()) {
      plan.plants.push_back(child(haptic.name + " plant", Stage::kPlant, "simulated_plant", {"--node", haptic.name}));
    }
    plan.nodes.push_back(child(haptic.name, Stage::kHaptic, "haptic_node", {"--name", haptic.name}));
    // A virtual device inside the node: its library comes before the C library.
    if (const std::string library = haptic.device->preload(); !library.empty()) {
      plan.nodes.back().preload = folder + "/" + library;
    }
    if (plan.haptic.size() > 1 && cores[i] != haptic.realtime.core) {
      // One loop alone chooses for itself. Last, it wins over an `auto` among the assignments.
      const auto entry = std::find(all.begin(), all.end(), haptic.name);
      const std::string key = "haptic." + std::to_string(entry - all.begin()) + ".realtime.core";
      plan.nodes.back().arguments.insert(plan.nodes.back().arguments.end(),
                                         {"--set", key + "=" + std::to_string(cores[i])});
      haptic.realtime.core = cores[i];
      // Physics keeps off these cores when it runs freely.
      if (plan.physics && !external) {
        plan.nodes.front().arguments.insert(plan.nodes.front().arguments.end(),
                                            {"--set", key + "=" + std::to_string(cores[i])});
      }
    }
  }
  if (!split.crossed.empty()) plan.nodes.push_back(link_child(config, folder, file, assignments, split.here));
  return plan;
}

std::string who_is_live(const RunPlan& plan) {
  for (const rtbus::TopicInfo& topic : rtbus::list_topics(plan.session.name)) {
    if (!topic.writer_alive) continue;
    if (plan.awaits_physics && topic.topic.starts_with("physics.")) continue;  // it is there before us
    const auto process = ask_process(static_cast<pid_t>(topic.writer_pid));
    return (process ? process->name : "a process") + " (pid " + std::to_string(topic.writer_pid) + ") writes " +
           topic.topic;
  }
  return "";
}

}  // namespace tools
