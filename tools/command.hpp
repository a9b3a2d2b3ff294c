#pragma once
/// @file command.hpp
/// The commands of the `rtbus` tool. One file per command; each adds its options to its CLI11 sub-command and returns
/// what is to be done once they are parsed.
#include <CLI/CLI.hpp>
#include <functional>

namespace tools {

/// Exit status of every command: 0 fine, 1 failed, 2 usage or configuration.
inline constexpr int kExitFine = 0;
inline constexpr int kExitFailed = 1;
inline constexpr int kExitUsage = 2;

using Action = std::function<int()>;

Action add_run(CLI::App& command);
Action add_list(CLI::App& command);
Action add_echo(CLI::App& command);
Action add_hz(CLI::App& command);
Action add_top(CLI::App& command);
Action add_clean(CLI::App& command);
Action add_doctor(CLI::App& command);
Action add_evaluate(CLI::App& command);
Action add_devices(CLI::App& command);
Action add_device_test(CLI::App& command);
Action add_calibrate(CLI::App& command);
Action add_virtual_device(CLI::App& command);
Action add_bench(CLI::App& command);
Action add_tune(CLI::App& command);
Action add_still(CLI::App& command);
Action add_stream(CLI::App& command);
// In builds with HDF5:
Action add_record(CLI::App& command);
Action add_mark(CLI::App& command);
Action add_export(CLI::App& command);
Action add_plot(CLI::App& command);

}  // namespace tools
