#include "tools/run_plan.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "haptic_node/rendering/registry.hpp"
#include "rtbus/config/session.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/ask_kernel.hpp"
#include "tools/core_plan.hpp"

namespace tools {

RunPlan make_run_plan(const std::string& file, const std::vector<std::string>& assignments) {
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : assignments) overrides.push_back(rtbus::config::parse_override(text));
  rtbus::config::SessionConfig config = rtbus::config::load_session(file, overrides);

  RunPlan plan;
  plan.session = config.session;
  plan.scene = config.scene.name;
  plan.supervise = config.supervise;
  plan.world = config.scene;
  std::optional<physics::NodeConfig> physics;
  if (config.physics) physics = physics::read_node_config(config);
  for (std::size_t i = 0; i < config.haptic.size(); ++i) plan.haptic.push_back(haptic::read_haptic_config(config, i));

  // A physics that no method asks is left out, though its keys have been checked.
  const bool asked = std::any_of(plan.haptic.begin(), plan.haptic.end(), [](const haptic::HapticConfig& each) {
    return haptic::find_renderer(each.method)->needs_physics;
  });
  if (asked) plan.physics = std::move(physics);

  const std::string folder = folder_of_this_program();
  const auto child = [&](std::string name, Stage stage, const char* program, std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"--config", file});
    for (const std::string& text : assignments) arguments.insert(arguments.end(), {"--set", text});
    return ChildSpec{std::move(name), stage, folder + "/" + program, std::move(arguments)};
  };
  if (plan.physics) plan.nodes.push_back(child("physics", Stage::kPhysics, "physics_node", {}));
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
      const std::string key = "haptic." + std::to_string(i) + ".realtime.core";
      plan.nodes.back().arguments.insert(plan.nodes.back().arguments.end(),
                                         {"--set", key + "=" + std::to_string(cores[i])});
      haptic.realtime.core = cores[i];
      // Physics keeps off these cores when it runs freely.
      if (plan.physics) {
        plan.nodes.front().arguments.insert(plan.nodes.front().arguments.end(),
                                            {"--set", key + "=" + std::to_string(cores[i])});
      }
    }
  }
  return plan;
}

std::string who_is_live(const std::string& session) {
  for (const rtbus::TopicInfo& topic : rtbus::list_topics(session)) {
    if (!topic.writer_alive) continue;
    const auto process = ask_process(static_cast<pid_t>(topic.writer_pid));
    return (process ? process->name : "a process") + " (pid " + std::to_string(topic.writer_pid) + ") writes " +
           topic.topic;
  }
  return "";
}

}  // namespace tools
