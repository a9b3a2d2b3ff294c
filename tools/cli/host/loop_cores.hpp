#pragma once
/// @file loop_cores.hpp
/// Observers work on the CPUs that no haptic loop is pinned to, while there are such: their page faults and system
/// calls cannot be preempted everywhere, and would show in the loop's wake-up latency.
#include <vector>

#include "rtbus/topic_directory.hpp"

namespace tools {

/// CPUs that the live haptic loops among `topics` (of one session) are pinned to, from their `node_info`.
[[nodiscard]] std::vector<int> loop_cores(const std::vector<rtbus::TopicInfo>& topics);

/// Keeps the calling thread, and what it starts later, off them from now on, unless no CPU would be left. Not realtime.
void keep_off_loops(const std::vector<rtbus::TopicInfo>& topics);

}  // namespace tools
