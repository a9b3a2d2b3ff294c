/// physics_node: owns the world. Order: read config → open topics → loop. Everything that may fail for a reason of the
/// user's fails before the loop starts.
#include <pthread.h>
#include <signal.h>
#include <spdlog/spdlog.h>
#include <string.h>

#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "physics_node/engine_registry.hpp"
#include "physics_node/node.hpp"
#include "physics_node/node_config.hpp"
#include "rtbus/command_line/command_line.hpp"
#include "rtbus/config/session.hpp"
#include "rtbus/ending_signals.hpp"
#include "rtbus/node_log.hpp"
#include "rtbus/parent_death.hpp"

namespace {

constexpr int kExitFailed = 1;
constexpr int kExitUsage = 2;

std::string help_footer() {
  std::string text = "Engines (physics.engine):\n";
  for (const physics::EngineEntry& engine : physics::registered_engines()) {
    text += "  " + std::string(engine.name) + "  " + std::string(engine.description) + "\n";
  }
  text +=
      "\nReads <haptic>.device_state of every haptic entry of the session; publishes physics.proxy_state.<haptic>,\n"
      "physics.heartbeat, physics.step_stats and physics.node_info, and physics.contacts.<haptic> when a method or\n"
      "physics.contacts asks for it. SIGINT or SIGTERM ends it and removes its topics.\n"
      "Exit status: 0 ended by a signal, 1 failed (for example: another physics node runs this session),\n"
      "2 wrong usage or configuration.";
  return text;
}

}  // namespace

int main(int argc, char** argv) {
  rtbus::CommandLine line(
      "physics_node", "Physics node: simulates the world of a session and the proxy of each of its haptic devices.");
  rtbus::Command root = line.root();
  if (!rtbus::end_with_supervisor()) return kExitFailed;
  std::string file;
  std::vector<std::string> assignments;
  root.option("--config", file, "Session file, for example config/wall.yaml").required().type_name("FILE");
  root.option("--set", assignments, "Change a key of the session, as often as needed: --set physics.throttle_hz=18")
      .take_all()
      .type_name("KEY=VALUE");
  root.footer(help_footer());
  if (const std::optional<int> status = line.parse(argc, argv)) return *status;

  rtbus::log_to_stderr("physics_node");
  const sigset_t ending = rtbus::block_ending_signals();

  std::unique_ptr<physics::Node> node;
  try {
    std::vector<rtbus::config::Override> overrides;
    for (const std::string& text : assignments) overrides.push_back(rtbus::config::parse_override(text));
    rtbus::config::SessionConfig session = rtbus::config::load_session(file, overrides);
    auto opened = physics::Node::open(physics::read_node_config(session));
    if (!opened) {
      std::fprintf(stderr, "%s\n", opened.error().message.c_str());
      return kExitFailed;
    }
    node = std::move(*opened);
  } catch (const rtbus::config::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kExitUsage;
  }

  node->start();
  int received = 0;
  sigwait(&ending, &received);
  node->stop();
  spdlog::info("physics: {}, ended", strsignal(received));
  return 0;
}
