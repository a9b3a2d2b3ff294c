#pragma once
/// @file live_pair.hpp
/// A session run as real processes for some seconds, and what it took: for comparisons of two variants in turn.
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace tools {

/// One way to run a session.
struct LiveVariant {
  std::string session_file;
  std::vector<std::string> assignments = {};  ///< --set.
  bool physics = true;                        ///< False: its process is not started, whatever the file says.
  bool observe_telemetry = false;             ///< Somebody looks at the first haptic node's ticks.
  bool observe_bodies = false;                ///< Somebody looks at the bodies, or at the nodes of soft ones.
  bool record = false;                        ///< `rtbus record` runs beside it, into a file that is removed.
  double settle_s = 0.4;                      ///< Of simulated time, before anything is measured.
};

/// What ran, over all processes of the session.
struct LiveFigures {
  std::vector<std::string> libraries;  ///< Mapped by any of them; full paths.
  unsigned processes = 0;
  std::vector<std::string> threads;         ///< Their names, one for each.
  std::map<std::string, double> topics_hz;  ///< Samples published per second, by topic.
  std::uint64_t shm_bytes = 0;
  double rss_mib = 0.0;      ///< Sum; pages that processes share count once for each.
  double cpu_s_per_s = 0.0;  ///< Sum.
  double tick_ns = 0.0;      ///< Median compute time of a haptic cycle, without the device.
  double step_us = 0.0;      ///< Median engine time of a physics step; 0 without physics.
  double step_p99_us = 0.0;  ///< Of the same.

  /// Libraries whose file name contains `part`, whatever the case of its letters.
  [[nodiscard]] std::size_t libraries_named(const std::string& part) const;
  /// Threads of that name.
  [[nodiscard]] std::size_t threads_named(const std::string& name) const;
};

/// Starts the session under a name of its own, lets it settle, measures for `duration_s`, ends it. nullopt, with the
/// reason on stderr, when it did not run through or the user interrupted. Throws rtbus::config::Error.
[[nodiscard]] std::optional<LiveFigures> run_live(const LiveVariant& variant, double duration_s);

}  // namespace tools
