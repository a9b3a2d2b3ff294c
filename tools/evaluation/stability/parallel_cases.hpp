#pragma once
/// @file parallel_cases.hpp
/// Many independent cases on all cores: in processes, so that a case that crashes is a result and not the end.
#include <cstddef>
#include <functional>

#include "tools/evaluation/stability/stability_run.hpp"

namespace tools {

/// Runs `work(i)` for i = 0…count − 1 in `jobs` child processes, worker w taking w, w + jobs, …, and hands every result
/// to `done` here, in the order in which they come (StabilityResult::index says whose it is). A worker that dies costs
/// the case it was at, which comes back as failed, and is replaced. @returns false when somebody interrupted.
bool run_cases(std::size_t count, int jobs, const std::function<StabilityResult(std::size_t)>& work,
               const std::function<void(const StabilityResult&)>& done);

}  // namespace tools
