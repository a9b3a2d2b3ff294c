#pragma once
/// @file report.hpp
/// The report of a run, schema rtbus-report/1: the figures of every node, as JSON for programs and as text for people.
/// docs/architecture.md lists the keys; they are a contract.
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/link_messages.hpp"
#include "rtbus/messages.hpp"
#include "tools/cli/host/ask_kernel.hpp"
#include "tools/cli/host/bare_loop.hpp"
#include "tools/cli/run/impulse_balance.hpp"
#include "tools/cli/run/live_error.hpp"

namespace tools {

/// What a node's process used during the run.
struct ProcessCost {
  double cpu_s = 0.0;  ///< While all nodes ran.
  double rss_mib = 0.0;
  unsigned threads = 0;
};

/// See live_error.hpp.
struct StalenessFigures {
  RmsPeak force_n, position_m;
  std::uint64_t dropped = 0;  ///< Ticks without a reference.
};

struct HapticFigures {
  std::string name;
  rtbus::NodeInfo info;
  rtbus::LoopStats stats;                ///< The last that the node published: everything since its loop started.
  std::optional<rtbus::LinkStats> link;  ///< Of a device over USB: likewise.
  bool needs_physics = false;
  bool finds_proxy = false;               ///< The method does, in the loop: its force is never stale.
  std::uint64_t observed_ticks = 0;       ///< Ticks whose telemetry was seen here.
  std::uint64_t missed_by_observer = 0;   ///< Telemetry that was overwritten before it could be read.
  double generated_peak_j = 0.0;          ///< Most energy that the device had given the hand, net, at any tick.
  double observed_min_j = 0.0;            ///< Lowest observed energy of the passivity observer.
  std::optional<StalenessFigures> error;  ///< None: needs no physics, or nothing could be compared.
  ProcessCost cost;
};

/// The proxy of one haptic node, as physics published it.
struct ProxyFigures {
  std::string device;
  std::uint64_t published = 0;
  std::uint64_t in_contact = 0;   ///< Steps with at least one contact.
  RmsPeak coupling_n, contact_n;  ///< On the proxy, in W.
  ImpulseBalance::Figures impulse{};
};

struct PhysicsFigures {
  rtbus::NodeInfo info;
  rtbus::StepStats stats;
  std::vector<ProxyFigures> proxies;
  ProcessCost cost;
};

/// A node that crashed and was started again.
struct RestartFigures {
  std::string node;
  std::string how;            ///< "was killed by signal 11 (Segmentation fault)"
  std::optional<int> status;  ///< Its exit status, or …
  std::optional<int> signal;  ///< … the signal that killed it.
  double at_s = 0.0;          ///< Since all nodes ran first.
  double lived_s = 0.0;
  double delay_s = 0.0;  ///< From its end to the new start.
};

struct TopicFigures {
  std::string name, type;
  std::uint32_t sample_bytes = 0;
  std::uint64_t published = 0;
  double rate_hz = 0.0;
};

struct RunReport {
  std::string config;                  ///< Session file, as given.
  std::vector<std::string> overrides;  ///< --set, as given.
  std::string session, scene;
  std::string started_utc;
  double duration_s = 0.0;            ///< While all nodes ran.
  double wall_s = 0.0;                ///< With start and end.
  std::string ended;                  ///< "duration", "interrupt" or "failure".
  std::vector<std::string> warnings;  ///< About the session file, each with the node that warned.
  std::vector<std::string> faults;
  std::vector<RestartFigures> restarts;
  MachineFacts machine;
  std::vector<HapticFigures> haptic;
  std::optional<BareLoopFigures> bare_loop;
  std::optional<PhysicsFigures> physics;
  std::uint64_t shm_bytes = 0;
  std::vector<TopicFigures> topics;
  std::vector<std::string> recordings;  ///< Files.
  std::vector<std::string> figures;     ///< Likewise.
};

[[nodiscard]] nlohmann::ordered_json to_json(const RunReport& report);

/// Some lines per node, for a terminal.
[[nodiscard]] std::string to_text(const RunReport& report);

}  // namespace tools
