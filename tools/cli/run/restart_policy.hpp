#pragma once
/// @file restart_policy.hpp
/// Whether and when `rtbus run` starts a node again that has ended by itself. Pure: times in, verdict out.
#include <cstdint>
#include <deque>
#include <string>

#include "rtbus/config/session.hpp"

namespace tools {

/// What an end says about a node.
enum class EndKind : std::uint8_t {
  kClean,  ///< Status 0: somebody asked it to end. It is not a crash, and not what the session asked for.
  kUsage,  ///< Status 2 or 127: its configuration or its program is wrong. Starting it again changes nothing.
  kCrash,  ///< Any other status, or a signal.
};
/// @param wait_status As waitpid() gives it.
[[nodiscard]] EndKind end_kind(int wait_status) noexcept;

/// The crashes of one node.
class RestartPolicy {
 public:
  explicit RestartPolicy(const rtbus::config::SuperviseConfig& config) : config_(config) {}

  struct Verdict {
    bool restart = false;
    double delay_s = 0.0;
    std::string why_not{};  ///< When it is not restarted: the rest of a sentence that begins with how it ended.
  };
  /// The node has ended. Times are CLOCK_MONOTONIC.
  [[nodiscard]] Verdict on_end(int wait_status, std::uint64_t started_ns, std::uint64_t ended_ns);

 private:
  rtbus::config::SuperviseConfig config_;
  std::deque<std::uint64_t> crashes_ns_;  ///< Within the window.
  double next_delay_s_ = 0.0;             ///< 0: the first.
};

}  // namespace tools
