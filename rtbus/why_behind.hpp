#pragma once
/// @file why_behind.hpp
/// Why simulated time lags behind real time, in a sentence with its remedy: the scene is too heavy, or the machine was
/// busy. `physics_node` warns by it, `rtbus run` and `rtbus top` report by it.
#include <string>
#include <string_view>

#include "rtbus/messages.hpp"

namespace rtbus {

/// The usual step takes less than half of its period: not the scene made physics late, but who else used the machine.
[[nodiscard]] bool steps_fit(const StepStats& stats) noexcept;

/// "steps take 0.35 ms at the median and fit into 1 ms: the machine was busy with something else", or what to lower.
/// @param stats Of the node that lags. @param engine As in physics.engine: only some engines have solver_iterations.
/// @realtime No.
[[nodiscard]] std::string why_behind(const StepStats& stats, std::string_view engine);

}  // namespace rtbus
