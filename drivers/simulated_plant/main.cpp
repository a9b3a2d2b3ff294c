// simulated_plant: the mechanics of a simulated device (`process: own`) in a process of their own.
#include <signal.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <exception>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "drivers/registry/registry.hpp"
#include "drivers/simulated/plant.hpp"
#include "drivers/simulated/simulated_config.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/config/session.hpp"
#include "rtbus/ending_signals.hpp"
#include "rtbus/node_log.hpp"
#include "rtbus/parent_death.hpp"

namespace {

using drivers::simulated::Plant;
using drivers::simulated::SimulatedConfig;

constexpr int kFailed = 1;
constexpr int kUsage = 2;

constexpr const char* kHelp =
    "usage: simulated_plant --config SESSION.yaml --node NAME [--set key=value]...\n"
    "\n"
    "Runs the mechanics of a simulated device with `process: own` until SIGINT or SIGTERM.\n"
    "Publishes <NAME>.plant_state, obeys <NAME>.plant_command; without commands for force_timeout_ms the\n"
    "actuator goes to zero. `rtbus run` starts it by itself.\n"
    "\n"
    "  --config FILE     session file, as for haptic_node\n"
    "  --node NAME       the haptic node in it whose device this is, for example haptic0\n"
    "  --set key=value   overrides one key of the session or a file it refers to; repeatable\n"
    "  --help            this text\n";

struct Arguments {
  std::string config;
  std::string node;
  std::vector<rtbus::config::Override> overrides;
};

int usage(const std::string& problem) {
  std::fprintf(stderr, "simulated_plant: %s\n%s", problem.c_str(), kHelp);
  return kUsage;
}

// An exit status when there is nothing to run.
std::optional<int> parse(int argc, char** argv, Arguments& out) {
  for (int i = 1; i < argc; ++i) {
    const std::string_view name = argv[i];
    if (name == "--help" || name == "-h") {
      std::fputs(kHelp, stdout);
      return 0;
    }
    if (name != "--config" && name != "--node" && name != "--set") {
      return usage("unknown argument '" + std::string(name) + "'");
    }
    if (i + 1 == argc) return usage(std::string(name) + " needs a value");
    const char* const value = argv[++i];
    if (name == "--config") out.config = value;
    if (name == "--node") out.node = value;
    if (name == "--set") out.overrides.push_back(rtbus::config::parse_override(value));
  }
  if (out.config.empty()) return usage("--config is missing");
  if (out.node.empty()) return usage("--node is missing");
  return std::nullopt;
}

/// How long the plant goes on after the force time-out: who looks on sees that it is at zero.
constexpr std::uint64_t kAtZero_ns = 30 * rtbus::kNsPerMs;

int run(Plant& plant, std::uint64_t force_timeout_ns, const std::string& node, const sigset_t& endings) {
  std::atomic<bool> stop{false};
  std::thread loop([&] {
    rtbus::name_this_thread("plant_loop");
    const rtbus::RealtimeGrant grant = drivers::simulated::enter_plant_realtime();
    spdlog::info("{}: simulated plant runs, {}", node, grant.summary());
    for (const std::string& warning : grant.warnings) spdlog::warn("{}: {}", node, warning);
    plant.run_until(stop);
  });
  // This thread does what needs the kernel, until a signal ends it.
  const timespec pause{0, 20'000'000};
  while (::sigtimedwait(&endings, nullptr, &pause) < 0) plant.maintain();
  // A device does not end with its node: when `rtbus run` was killed, both get the signal at once. The last command
  // acts until the node takes it back, or until it times out.
  const std::uint64_t end_ns = rtbus::monotonic_ns() + force_timeout_ns + kAtZero_ns;
  for (std::uint64_t now_ns = 0; (now_ns = rtbus::monotonic_ns()) < end_ns;) {
    plant.maintain();
    rtbus::sleep_until(std::min(end_ns, now_ns + 5 * rtbus::kNsPerMs));
  }
  stop.store(true, std::memory_order_relaxed);
  loop.join();
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  // Before any thread exists, so that all of them leave the signals to run().
  const sigset_t endings = rtbus::block_ending_signals();
  rtbus::log_to_stderr("simulated_plant");
  if (!rtbus::end_with_supervisor()) return kFailed;
  try {
    Arguments arguments;
    if (const auto status = parse(argc, argv, arguments)) return *status;
    rtbus::config::SessionConfig session = rtbus::config::load_session(arguments.config, arguments.overrides);
    rtbus::config::HapticEntry* const entry = session.find_haptic(arguments.node);
    if (entry == nullptr) {
      std::fprintf(stderr, "%s: has no haptic node '%s'; give one of its names as --node\n", arguments.config.c_str(),
                   arguments.node.c_str());
      return kUsage;
    }
    rtbus::config::Map file = entry->map.file_or_map("device");
    const auto config = drivers::parse_device(file);
    const auto* const simulated = dynamic_cast<const SimulatedConfig*>(config.get());
    if (simulated == nullptr || !simulated->own_process()) {
      spdlog::error("{}: the device of {} is not `driver: simulated` with `process: own`; nothing to run",
                    arguments.config, arguments.node);
      return kFailed;
    }
    auto plant = Plant::create(simulated->settings(), session.session, arguments.node);
    if (!plant) {
      spdlog::error("{}.plant_state: {}", arguments.node, rtbus::to_string(plant.error()));
      return kFailed;
    }
    return run(**plant, simulated->settings().force_timeout_ns(), arguments.node, endings);
  } catch (const rtbus::config::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kUsage;
  } catch (const std::exception& error) {
    spdlog::error("simulated_plant: {}", error.what());
    return kFailed;
  }
}
