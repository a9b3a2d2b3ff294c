#pragma once
/// @file run_plan.hpp
/// What `rtbus run` is going to start, decided and checked before anything is: every node's own reader has seen the
/// session file.
#include <optional>
#include <string>
#include <vector>

#include "haptic_node/node_config.hpp"
#include "physics_node/node_config.hpp"
#include "rtbus/config/document.hpp"
#include "rtbus/config/scene.hpp"
#include "rtbus/config/session.hpp"
#include "rtbus/segment.hpp"
#include "tools/cli/run/supervisor.hpp"

namespace tools {

struct RunPlan {
  rtbus::Session session;
  std::string scene;           ///< Its name.
  rtbus::config::Scene world;  ///< The scene itself, for pictures.
  rtbus::config::SuperviseConfig supervise;
  std::vector<haptic::HapticConfig> haptic;  ///< Of this machine.
  std::vector<std::string> far_haptic;       ///< Nodes of other machines that a link leads to from here.
  std::optional<physics::NodeConfig> physics;
  std::vector<std::string> warnings;  ///< What the nodes are going to warn of, each with the node's name.
  std::vector<ChildSpec> plants;      ///< To be started first: a haptic node opens its device at once.
  std::vector<ChildSpec> nodes;       ///< Physics, then the haptic nodes, then the link to another machine.
  std::optional<ChildSpec> bridge;    ///< To ROS 2: started when all the others run.
  bool awaits_physics = false;        ///< `engine: external` without a command: the user starts it by hand.
};

/// Reads the session as each node will. @param assignments "key=value", as given with --set. @param only The nodes that
/// run on this machine; empty: all. Throws rtbus::config::Error: one sentence for the user.
[[nodiscard]] RunPlan make_run_plan(const std::string& file, const std::vector<std::string>& assignments,
                                    const std::vector<std::string>& only = {});

/// Who runs the session already: "haptic_node (pid 4711) writes haptic0.heartbeat"; empty when nobody does.
[[nodiscard]] std::string who_is_live(const RunPlan& plan);

}  // namespace tools
