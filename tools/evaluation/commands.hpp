#pragma once
/// @file commands.hpp
/// The commands of the program `rtbus_evaluation`.
#include "tools/cli/common/command.hpp"

namespace tools {

Action add_evaluate(rtbus::Command command);
Action add_tune(rtbus::Command command);
Action add_bench(rtbus::Command command);
Action add_engine_conformance(rtbus::Command command);

}  // namespace tools
