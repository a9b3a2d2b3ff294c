#pragma once
/// @file core_plan.hpp
/// Which CPU each haptic loop of a session stays on. A loop that runs alone takes the last one it may use; several that
/// chose for themselves would all take the same, and the second would wait for the first in every period.
#include <vector>

namespace tools {

/// One core for each loop, in their order. @param allowed CPUs of this process, ascending. @param requested What the
/// session says for each loop; −1: auto.
///
/// Requests are kept. The others get the last cores that nobody asked for, from the end, one each; the first allowed
/// core is taken last, so that physics and the tools keep one without a loop while there are enough. More loops than
/// cores share them evenly. Physics is not pinned: its thread goes wherever the loops leave time. With `allowed` empty
/// the requests come back.
[[nodiscard]] std::vector<int> plan_cores(const std::vector<int>& allowed, const std::vector<int>& requested);

/// CPUs that this process may use, ascending; empty when the kernel does not say.
[[nodiscard]] std::vector<int> cores_of_this_process();

}  // namespace tools
