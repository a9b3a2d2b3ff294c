// The program behind `rtbus link`: one machine's end of a session whose haptic entries have `link: dds`. A program of
// its own, so that no node maps DDS.
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "haptic_node/node_config.hpp"
#include "haptic_node/rendering/registry.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/config/session.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/common/find_config.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/host/loop_cores.hpp"
#include "tools/link/config/only.hpp"
#include "tools/link/link_node.hpp"

namespace {

/// A haptic node that starts beside this process tells its core within so long.
constexpr std::uint64_t kCoresPatience_ns = 2 * rtbus::kNsPerS;

struct LinkCommand {
  std::string file;
  std::vector<std::string> only;
  std::vector<std::string> assignments;
};

link_dds::LinkPlan read_plan(const LinkCommand& command) {
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : command.assignments) overrides.push_back(rtbus::config::parse_override(text));
  rtbus::config::SessionConfig session = rtbus::config::load_session(tools::find_session(command.file), overrides);
  const link_dds::Split split = link_dds::split_session(session, command.only);
  link_dds::LinkPlan out;
  out.session = session.session;
  out.network = session.network;
  out.here = split.here;
  out.nodes.emplace_back("physics");
  for (std::size_t i = 0; i < session.haptic.size(); ++i) {
    out.nodes.push_back(session.haptic[i].name);
    const haptic::HapticConfig config = haptic::read_haptic_config(session, i);
    if (!split.crosses(config.name)) continue;
    out.hands.push_back({config.name, config.wire.round_trip_s, haptic::find_method(config.method)->needs_contacts});
  }
  if (!rtbus::config::bodies_that_orders_move(session.scene).empty()) {
    for (const rtbus::config::Body& body : session.scene.bodies) out.bodies.push_back(body.name);
  }
  return out;
}

/// The threads of DDS stay where the process is when it makes them: off the cores of the loops on this machine.
void keep_off_loops(const link_dds::LinkPlan& plan) {
  const std::uint64_t end_ns = rtbus::monotonic_ns() + kCoresPatience_ns;
  const auto told = [&] {
    const auto topics = rtbus::list_topics(plan.session.name);
    for (const link_dds::LinkedHand& hand : plan.hands) {
      if (!plan.is_here(hand.name)) continue;
      bool there = false;
      for (const rtbus::TopicInfo& topic : topics) {
        there = there || (topic.topic == hand.name + ".node_info" && topic.published > 0);
      }
      if (!there) return false;
    }
    return true;
  };
  while (!told() && rtbus::monotonic_ns() < end_ns) {
    if (!tools::sleep_unless_interrupted(20 * rtbus::kNsPerMs)) return;
  }
  tools::keep_off_loops(rtbus::list_topics(plan.session.name));
}

int failed(const std::string& why) {
  std::fprintf(stderr, "rtbus link: %s\n", why.c_str());
  return tools::kExitFailed;
}

int serve(const LinkCommand& command) {
  link_dds::LinkPlan plan;
  try {
    plan = read_plan(command);
  } catch (const rtbus::config::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return tools::kExitUsage;
  }
  if (plan.hands.empty()) {
    std::fprintf(stderr, "rtbus link: all nodes of %s are here, so there is nothing to link; name some with --only\n",
                 command.file.c_str());
    return tools::kExitUsage;
  }
  auto node = link_dds::LinkNode::open(plan);
  if (!node) return failed(node.error());
  keep_off_loops(plan);
  if (auto connected = (*node)->connect(); !connected) return failed(connected.error());
  std::printf("rtbus link: session %s: %s is here, at %s, DDS domain %d\n", plan.session.name.c_str(),
              plan.here.front().c_str(), plan.network.machine_of(plan.here.front()).c_str(), plan.network.domain);
  std::fflush(stdout);
  (*node)->serve([] { return tools::interrupted(); },
                 [](const std::string& sentence) { std::fprintf(stderr, "rtbus link: %s\n", sentence.c_str()); });
  return tools::kExitFine;
}

tools::Action add_link(rtbus::Command command) {
  const auto options = std::make_shared<LinkCommand>();
  command.option("session", options->file, "Session file, or the name of one, with link: dds")
      .required()
      .type_name("FILE|NAME");
  command.option("--only", options->only, "The nodes that run on this machine: physics, or haptic nodes")
      .required()
      .take_all();
  command.option("--set", options->assignments, "Change a key of the session, as for its nodes")
      .take_all()
      .type_name("KEY=VALUE");
  command.footer("`rtbus run --only` starts this by itself. docs/distributed.md.");
  return [options] { return serve(*options); };
}

constexpr tools::CommandEntry kCommands[] = {{"link", "Link a session to its nodes on another machine", &add_link}};

}  // namespace

int main(int argc, char** argv) { return tools::run_commands(kCommands, "", argc, argv); }
