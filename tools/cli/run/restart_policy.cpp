#include "tools/cli/run/restart_policy.hpp"

#include <sys/wait.h>

#include <algorithm>
#include <cstdio>

#include "rtbus/clock.hpp"

namespace tools {

EndKind end_kind(int wait_status) noexcept {
  if (!WIFEXITED(wait_status)) return EndKind::kCrash;
  switch (WEXITSTATUS(wait_status)) {
    case 0:
      return EndKind::kClean;
    case 2:    // every program of this project: wrong usage or configuration
    case 127:  // execv() failed
      return EndKind::kUsage;
    default:
      return EndKind::kCrash;
  }
}

RestartPolicy::Verdict RestartPolicy::on_end(int wait_status, std::uint64_t started_ns, std::uint64_t ended_ns) {
  switch (end_kind(wait_status)) {
    case EndKind::kClean:
      return {.why_not = "which was not requested"};
    case EndKind::kUsage:
      return {.why_not = "which another start would not change"};
    case EndKind::kCrash:
      break;
  }
  if (!config_.restart) return {.why_not = "and restarts are switched off"};
  crashes_ns_.push_back(ended_ns);
  while (rtbus::seconds_between(crashes_ns_.front(), ended_ns) > config_.window_s) crashes_ns_.pop_front();
  if (crashes_ns_.size() > static_cast<std::size_t>(config_.restarts)) {
    char text[120];
    std::snprintf(text, sizeof text, "for the %zu. time within %g s (supervise.restarts = %d): given up",
                  crashes_ns_.size(), config_.window_s, config_.restarts);
    return {.why_not = text};
  }
  const bool good_life = rtbus::seconds_between(started_ns, ended_ns) >= config_.good_life_s;
  const double delay_s = next_delay_s_ == 0.0 || good_life ? config_.first_delay_s : next_delay_s_;
  next_delay_s_ = std::min(2.0 * delay_s, config_.longest_delay_s);
  return {.restart = true, .delay_s = delay_s};
}

}  // namespace tools
