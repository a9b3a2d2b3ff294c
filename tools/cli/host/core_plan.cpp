#include "tools/cli/host/core_plan.hpp"

#include <sched.h>

#include <algorithm>

namespace tools {

std::vector<int> plan_cores(const std::vector<int>& allowed, const std::vector<int>& requested) {
  std::vector<int> out = requested;
  const auto asked_for = [&requested](int core) {
    return std::find(requested.begin(), requested.end(), core) != requested.end();
  };
  std::vector<int> free;  // the last first
  for (auto core = allowed.rbegin(); core != allowed.rend(); ++core) {
    if (!asked_for(*core)) free.push_back(*core);
  }
  if (free.empty()) free.assign(allowed.rbegin(), allowed.rend());  // every core has its loop: share
  if (free.empty()) return out;
  std::size_t next = 0;
  for (int& core : out) {
    if (core < 0) core = free[next++ % free.size()];
  }
  return out;
}

std::vector<int> cores_of_this_process() {
  std::vector<int> out;
  cpu_set_t set;
  CPU_ZERO(&set);
  if (::sched_getaffinity(0, sizeof set, &set) != 0) return out;
  for (int core = 0; core < CPU_SETSIZE; ++core) {
    if (CPU_ISSET(core, &set)) out.push_back(core);
  }
  return out;
}

}  // namespace tools
