// The program behind `rtbus evaluate`, `rtbus tune`, `rtbus bench` and `rtbus conformance`.
#include "tools/evaluation/commands.hpp"

namespace {

constexpr tools::CommandEntry kCommands[] = {
    {"evaluate", "Run an experiment and check its figures", &tools::add_evaluate},
    {"tune", "Gains that a device bears at given rates", &tools::add_tune},
    {"bench", "Measure this machine: what a step, a driver or an engine costs", &tools::add_bench},
    {"conformance", "Check an engine of your own by our conformance suite", &tools::add_engine_conformance},
};

}  // namespace

int main(int argc, char** argv) { return tools::run_commands(kCommands, "", argc, argv); }
