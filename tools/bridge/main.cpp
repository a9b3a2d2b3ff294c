// The program behind `rtbus bridge`: the bus on DDS, where ROS 2 sees it. A program of its own, so that nothing else
// maps DDS, and so that its end is felt by nobody.
#include <algorithm>
#include <cstdio>
#include <deque>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "rtbus/clock.hpp"
#include "rtbus/config/shared_keys.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/bridge/config/bridge_config.hpp"
#include "tools/bridge/foreign_orders.hpp"
#include "tools/bridge/frame_stream.hpp"
#include "tools/bridge/haptic_streams.hpp"
#include "tools/bridge/health_stream.hpp"
#include "tools/bridge/stop_orders.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/common/find_config.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/host/loop_cores.hpp"

namespace {

using bridge::Stream;

constexpr std::uint64_t kMaintain_ns = 20 * rtbus::kNsPerMs;

struct BridgeCommand {
  std::string file;
  std::vector<std::string> assignments;
};

/// What the session file says.
struct Plan {
  rtbus::Session session;
  bridge::BridgeConfig config;
  std::vector<haptic::HapticConfig> haptic;
  std::vector<rtbus::config::Body> bodies;
  bool physics = false;
};

Plan read_plan(const BridgeCommand& command) {
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : command.assignments) overrides.push_back(rtbus::config::parse_override(text));
  rtbus::config::SessionConfig session = rtbus::config::load_session(tools::find_session(command.file), overrides);
  Plan out;
  out.session = session.session;
  for (std::size_t i = 0; i < session.haptic.size(); ++i) {
    out.haptic.push_back(haptic::read_haptic_config(session, i));
  }
  out.config = bridge::read_bridge_config(session, out.haptic);
  const bool asked = std::any_of(out.haptic.begin(), out.haptic.end(),
                                 [](const haptic::HapticConfig& each) { return each.asks_physics(); });
  out.physics = asked && session.physics.has_value();  // else `rtbus run` leaves it out
  if (!session.physics || rtbus::config::simulates_the_scene(*session.physics)) out.bodies = session.scene.bodies;
  return out;
}

std::vector<std::string> names_of(const std::vector<haptic::HapticConfig>& haptic) {
  std::vector<std::string> out;
  for (const haptic::HapticConfig& each : haptic) out.push_back(each.name);
  return out;
}

/// All that goes out, each at its own rate.
class Streams {
 public:
  explicit Streams(Plan plan)
      : plan_(std::move(plan)),
        frames_(plan_.session, plan_.bodies),
        health_(plan_.session, names_of(plan_.haptic), plan_.physics) {
    for (const haptic::HapticConfig& each : plan_.haptic) nodes_.emplace_back(plan_.session, each.name, plan_.config);
  }

  [[nodiscard]] rtbus::Result<void, std::string> open(bridge::Participant& participant) {
    for (bridge::HapticStreams& node : nodes_) {
      if (auto opened = node.open(participant, plan_.config); !opened) return opened;
    }
    if (auto opened = frames_.open(participant, plan_.config, plan_.haptic, clock_); !opened) return opened;
    if (auto opened = health_.open(participant, plan_.config); !opened) return opened;
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    for (std::size_t i = 0; i < bridge::kStreams; ++i) {
      const bridge::StreamConfig& stream = plan_.config.streams[i];
      if (stream.on) due_.push_back({static_cast<Stream>(i), rtbus::ns_of(1.0 / stream.rate_hz), now_ns});
    }
    return {};
  }

  /// Until a signal comes.
  void serve(const bridge::OrderCounts& orders) {
    std::uint64_t maintained_ns = 0;
    while (!tools::interrupted()) {
      const std::uint64_t now_ns = rtbus::monotonic_ns();
      if (now_ns >= maintained_ns + kMaintain_ns) {
        maintained_ns = now_ns;
        for (bridge::HapticStreams& node : nodes_) node.maintain();
        frames_.maintain();
        health_.maintain();
      }
      std::uint64_t next_ns = maintained_ns + kMaintain_ns;
      for (Due& due : due_) {
        if (now_ns >= due.next_ns) {
          publish(due.stream, orders);
          due.next_ns = std::max(due.next_ns + due.period_ns, now_ns);  // what was missed is not caught up
        }
        next_ns = std::min(next_ns, due.next_ns);
      }
      rtbus::sleep_until(next_ns);
    }
  }

 private:
  struct Due {
    Stream stream;
    std::uint64_t period_ns, next_ns;
  };

  void publish(Stream stream, const bridge::OrderCounts& orders) {
    if (stream == Stream::kTf) {
      frames_.publish(nodes_, clock_);
    } else if (stream == Stream::kDiagnostics) {
      health_.publish(own_row(orders), clock_);
    } else {
      for (bridge::HapticStreams& node : nodes_) node.publish(stream, clock_);
    }
  }

  [[nodiscard]] bridge::Status own_row(const bridge::OrderCounts& orders) const {
    bridge::Status row;
    row.name = "rtbus " + plan_.session.name + ": bridge";
    row.message = "running";
    std::uint64_t written = frames_.written();
    for (const bridge::HapticStreams& node : nodes_) written += node.written();
    row.values.emplace_back("written", std::to_string(written));
    row.values.emplace_back("orders_carried_out", std::to_string(orders.carried_out));
    row.values.emplace_back("orders_refused", std::to_string(orders.refused));
    return row;
  }

  Plan plan_;
  bridge::RosClock clock_;
  std::deque<bridge::HapticStreams> nodes_;  // they do not move
  bridge::FrameStream frames_;
  bridge::HealthStream health_;
  std::vector<Due> due_;
};

int failed(const std::string& why) {
  std::fprintf(stderr, "rtbus bridge: %s\n", why.c_str());
  return tools::kExitFailed;
}

int serve(const BridgeCommand& command) {
  Plan plan;
  try {
    plan = read_plan(command);
  } catch (const rtbus::config::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return tools::kExitUsage;
  }
  const bridge::BridgeConfig config = plan.config;
  const std::string session = plan.session.name;
  tools::keep_off_loops(rtbus::list_topics(session));  // before DDS makes its threads, which inherit it
  auto participant = bridge::Participant::open(config.domain, config.network, config.peers);
  if (!participant) return failed(participant.error());
  Streams streams(std::move(plan));
  if (auto opened = streams.open(*participant); !opened) return failed(opened.error());
  bridge::OrderCounts counts;
  auto stops = bridge::StopOrders::open(*participant, config, session, counts);
  if (!stops) return failed(stops.error());
  auto orders = bridge::ForeignOrders::open(*participant, config, session, counts);
  if (!orders) return failed(orders.error());
  if (*stops) (*stops)->start();
  if (*orders) (*orders)->start();
  std::printf("rtbus bridge: session %s is on DDS domain %d, network %s%s\n", session.c_str(), config.domain,
              config.network.c_str(), config.orders.any() ? "; it takes orders" : "");
  std::fflush(stdout);
  streams.serve(counts);
  return tools::kExitFine;
}

tools::Action add_bridge(rtbus::Command command) {
  const auto options = std::make_shared<BridgeCommand>();
  command.option("session", options->file, "Session file, or the name of one; its `bridge` says what is published")
      .required()
      .type_name("FILE|NAME");
  command.option("--set", options->assignments, "Change a key of the session: --set bridge.network=eth0")
      .take_all()
      .type_name("KEY=VALUE");
  command.footer(
      "Publishes a session that runs until Ctrl-C. `rtbus run` does this by itself when its file has `bridge`. "
      "docs/bridge.md.");
  return [options] { return serve(*options); };
}

constexpr tools::CommandEntry kCommands[] = {{"bridge", "Show a session to ROS 2, over DDS", &add_bridge}};

}  // namespace

int main(int argc, char** argv) { return tools::run_commands(kCommands, "", argc, argv); }
