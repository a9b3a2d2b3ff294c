// `rtbus still SESSION|FILE`: a rendered picture of a running session, or of one simulated up to an instant.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "physics_node/engine_registry.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/config/session.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/cli/common/choose.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/common/find_config.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/common/started_with.hpp"
#include "tools/cli/still/still.hpp"

namespace tools {

namespace {

namespace fs = std::filesystem;

struct StillCommand {
  std::string what;  ///< Session or file; "": the only live session.
  std::string out = "still.png";
  std::optional<double> at_s;
  std::vector<std::string> assignments;
  StillOptions picture;
};

int fail(const std::string& message, int status = kExitFailed) {
  std::fprintf(stderr, "rtbus still: %s\n", message.c_str());
  return status;
}

/// The newest frame of a live session.
std::optional<StillFrame> frame_from_bus(BusFrames& source) {
  constexpr std::uint64_t kPatience_ns = 3 * rtbus::kNsPerS;
  const std::uint64_t end_ns = rtbus::monotonic_ns() + kPatience_ns;
  // The first force seen may be from before somebody looked: two frames, then.
  int frames = 0;
  bool attached = false;
  while (rtbus::monotonic_ns() < end_ns && sleep_unless_interrupted(5 * rtbus::kNsPerMs)) {
    attached = attached || source.attach();
    if (attached && source.drain() && ++frames == 2) return source.frame();
  }
  return std::nullopt;
}

int still(StillCommand options) {
  const std::vector<rtbus::TopicInfo> topics = rtbus::list_topics();
  bool names_a_file = options.what.ends_with(".yaml") || options.what.find('/') != std::string::npos;
  const std::vector<std::string> live = sessions_in(topics, true);
  if (options.at_s && !options.what.empty() && std::find(live.begin(), live.end(), options.what) == live.end()) {
    names_a_file = true;  // nothing of that name runs, and nothing has to
  }
  if (!names_a_file) {
    auto session =
        choose_session(topics, options.what.empty() ? std::nullopt : std::optional<std::string>(options.what));
    if (!session) return fail(session.error().message, session.error().exit_status);
    const auto writer = std::find_if(topics.begin(), topics.end(), [&](const rtbus::TopicInfo& topic) {
      return topic.session == *session && topic.writer_alive && topic.topic.ends_with(".heartbeat");
    });
    if (writer == topics.end()) return fail("session " + *session + " has no living node; name its file, with --at");
    const auto started = started_with(writer->writer_pid);
    if (!started) {
      return fail("cannot tell which file session " + *session + " was started with; name the file instead");
    }
    options.what = started->file;
    options.assignments.insert(options.assignments.begin(), started->assignments.begin(), started->assignments.end());
  }
  std::vector<rtbus::config::Override> overrides;
  StillFrame frame;
  rtbus::config::Scene scene;
  try {
    if (names_a_file) options.what = find_session(options.what);
    for (const std::string& text : options.assignments) overrides.push_back(rtbus::config::parse_override(text));
    rtbus::config::SessionConfig session = rtbus::config::load_session(options.what, overrides);
    scene = session.scene;
    const rtbus::Session bus = session.session;
    // As `rtbus run` checks it, also where nothing of it is asked for: a picture of a file that cannot run misleads.
    std::optional<physics::NodeConfig> physics;
    if (session.physics) physics = physics::read_node_config(session);
    std::vector<StillHandConfig> hands;
    bool asked = false;
    for (std::size_t i = 0; i < session.haptic.size(); ++i) {
      const haptic::HapticConfig hand = haptic::read_haptic_config(session, i);
      asked = asked || hand.asks_physics();
      hands.push_back(hand_config(hand, physics ? &*physics : nullptr));
    }
    if (physics && asked) physics::check_scene(physics->physics.engine, scene);
    if (options.at_s && *options.at_s > 0.0) {
      Harness harness(session, {});
      std::vector<rtbus::Telemetry> last(harness.hands());
      harness.run_all(*options.at_s, [&](std::size_t hand, const rtbus::Telemetry& tick) { last[hand] = tick; });
      frame = frame_of(scene, harness, last);
    } else if (options.at_s) {
      frame = frame_of(scene);
    } else {
      BusFrames source(bus, scene, std::move(hands));
      auto seen = frame_from_bus(source);
      if (!seen) {
        return fail("session " + bus.name + " shows nothing: is it running? (--at S simulates " + options.what + ")");
      }
      frame = std::move(*seen);
      scene = source.scene();
    }
  } catch (const rtbus::config::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kExitUsage;
  }
  const fs::path out(options.out);
  if (out.extension() != ".png") return fail(options.out + " does not end in .png", kExitUsage);
  frame.stem = out.stem().string();
  const fs::path folder = out.parent_path().empty() ? fs::path(".") : out.parent_path();
  const StillsOutcome drawn = draw_stills(folder, scene, std::span(&frame, 1), options.picture);
  if (!drawn.problem.empty()) return fail(drawn.problem);
  std::printf("%s\n", drawn.files.front().c_str());
  return kExitFine;
}

}  // namespace

Action add_still(rtbus::Command command) {
  const auto options = std::make_shared<StillCommand>();
  command
      .option("session", options->what,
              "Running session, or a session file (with --at also its name); default: the only live session")
      .type_name("SESSION|FILE|NAME");
  command.option("-o,--out", options->out, "PNG to write; its .pov and .gp stay beside it")
      .show_default()
      .type_name("FILE");
  command
      .option("--at", options->at_s,
              "Simulate the file up to this instant instead of looking at a running session [s]; 0: as placed")
      .range(0.0, 3600.0)
      .type_name("S");
  command.option("--set", options->assignments, "Change a key of the session, as it was started")
      .take_all()
      .type_name("KEY=VALUE");
  command.option("--azimuth", options->picture.view.azimuth_deg, "Camera from +z towards +x [deg]")
      .show_default()
      .range(-360.0, 360.0);
  command.option("--elevation", options->picture.view.elevation_deg, "Camera above the horizon [deg]")
      .show_default()
      .range(1.0, 89.0);
  return [options] { return still(*options); };
}

}  // namespace tools
