#pragma once
/// @file top_json.hpp
/// The snapshot of `rtbus top --once --json` and of each line of `rtbus top --json`, schema rtbus-top/1. Names and
/// units as in the run report (rtbus-report/1).
#include <nlohmann/json.hpp>

#include "tools/cli/top/top_state.hpp"

namespace tools {

[[nodiscard]] nlohmann::ordered_json top_json(const TopSnapshot& snapshot);

}  // namespace tools
