/// haptic_node: owns the device and the force. Order: read config → open topics → start device → lock memory and take
/// priority → loop. Everything that may fail for a reason of the user's fails before the loop starts.
#include <pthread.h>
#include <signal.h>
#include <spdlog/spdlog.h>

#include <atomic>
#include <cstddef>
#include <cstdio>
#include <thread>
#include <utility>

#include "haptic_node/node.hpp"
#include "haptic_node/node_config.hpp"
#include "rtbus/command_line/command_line.hpp"
#include "rtbus/config/session.hpp"
#include "rtbus/ending_signals.hpp"
#include "rtbus/node_log.hpp"
#include "rtbus/parent_death.hpp"
#include "rtbus/realtime.hpp"

namespace {

constexpr int kExitFailed = 1;
constexpr int kExitUsage = 2;

/// Stacks are locked into memory: 8 MiB for each thread would be waste.
void use_small_stacks() {
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, std::size_t{1024} * 1024);
  pthread_setattr_default_np(&attributes);
  pthread_attr_destroy(&attributes);
}

/// Devices may take seconds to start (firmware, a board that does not answer): an ending signal ends that too. The
/// other cancels again and again, for it cannot tell when the device began to listen.
struct Started {
  rtbus::Result<void, haptic::NodeFault> outcome;
  int ended_by = 0;  ///< The signal that came meanwhile; 0: none.
};
Started start(haptic::Node& node, const sigset_t& ending) {
  std::atomic<bool> done{false};
  int ended_by = 0;
  std::thread watch([&] {
    rtbus::name_this_thread("haptic_start");
    while (!done.load()) {
      const timespec pause{0, 20'000'000};
      if (const int number = sigtimedwait(&ending, nullptr, &pause); number > 0) ended_by = number;
      if (ended_by != 0 && !done.load()) node.cancel_start();
    }
  });
  auto outcome = node.start();
  done.store(true);
  watch.join();
  return {std::move(outcome), ended_by};
}

}  // namespace

int main(int argc, char** argv) {
  rtbus::CommandLine line("haptic_node", "Haptic node: runs the force loop of one device of a session.");
  rtbus::Command root = line.root();
  std::string file;
  std::string name;
  std::vector<std::string> assignments;
  bool telemetry = false;
  root.option("--config", file, "Session file, for example config/wall.yaml").required();
  root.option("--name", name, "Which entry of `haptic:` to run; default: the first");
  root.option("--set", assignments, "Change a key of the session: --set haptic.0.rate_hz=2000").take_all();
  root.flag("--telemetry", telemetry, "Publish the telemetry from the first tick, though nobody observes it");
  if (const std::optional<int> status = line.parse(argc, argv)) return *status;

  rtbus::log_to_stderr("haptic_node");
  const sigset_t ending = rtbus::block_ending_signals();
  if (!rtbus::end_with_supervisor()) return kExitFailed;
  use_small_stacks();

  std::unique_ptr<haptic::Node> node;
  try {
    std::vector<rtbus::config::Override> overrides;
    for (const std::string& text : assignments) overrides.push_back(rtbus::config::parse_override(text));
    auto session = rtbus::config::load_session(file, overrides);
    std::size_t index = 0;
    if (!name.empty()) {
      while (index < session.haptic.size() && session.haptic[index].name != name) ++index;
      if (index == session.haptic.size()) throw rtbus::config::Error(file + ": no haptic entry is named " + name);
    }
    haptic::HapticConfig config = haptic::read_haptic_config(session, index);
    config.telemetry_always = telemetry;
    auto opened = haptic::Node::open(std::move(config), session.session);
    if (!opened) {
      spdlog::error("{}", opened.error().message);
      return kExitFailed;
    }
    node = std::move(*opened);
  } catch (const rtbus::config::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kExitUsage;
  }

  const Started started = start(*node, ending);
  if (!started.outcome && started.ended_by != 0) {
    spdlog::info("{}: ended before the device was ready; it got no force", strsignal(started.ended_by));
    return 0;
  }
  if (!started.outcome) {
    spdlog::error("{}", started.outcome.error().message);
    return kExitFailed;
  }
  // On a busy machine too, an ending signal is seen at once: the one that comes when `rtbus run` was killed.
  (void)rtbus::prefer_on_time();
  int received = started.ended_by;
  while (received <= 0) {
    const timespec pause{0, 50'000'000};
    received = sigtimedwait(&ending, nullptr, &pause);
    node->report_events();
  }
  // Zero force first; words afterwards.
  node->stop();
  node->report_events();
  spdlog::info("{}: ended at zero force", strsignal(received));
  return 0;
}
