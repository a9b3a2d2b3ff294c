#pragma once
/// @file command.hpp
/// The commands of the programs `rtbus` and `rtbus_evaluation`. One file per command; each adds its options and returns
/// what is to be done once they are parsed. A program is a table of commands, handed to run_commands().
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "rtbus/command_line/command_line.hpp"

namespace tools {

/// Exit status of every command: 0 fine, 1 failed, 2 usage or configuration.
inline constexpr int kExitFine = 0;
inline constexpr int kExitFailed = 1;
inline constexpr int kExitUsage = 2;

/// Instead of a command: what could be typed next (completions()).
inline constexpr std::string_view kComplete = "__complete";

using Action = std::function<int()>;

/// A row of a program's table.
struct CommandEntry {
  const char* name;
  const char* description;
  Action (*add)(rtbus::Command);
};

/// What may stand in the place of the last word of a line that begins with `words` (without "rtbus"): commands,
/// options, values that have names, live sessions, topics. Nothing when it is a file's name or unknown.
[[nodiscard]] std::vector<std::string> completions(std::span<const std::pair<std::string, rtbus::Command>> commands,
                                                   std::span<const std::string> words);

/// Parses the command line and runs the command that it names. Prints help, version and what is wrong.
/// `__complete WORDS…` prints completions(), one per line, for the shell.
/// @returns the exit status.
int run_commands(std::span<const CommandEntry> commands, const std::string& footer, int argc, char** argv);

Action add_run(rtbus::Command command);
Action add_list(rtbus::Command command);
Action add_echo(rtbus::Command command);
Action add_hz(rtbus::Command command);
Action add_top(rtbus::Command command);
Action add_clean(rtbus::Command command);
Action add_doctor(rtbus::Command command);
Action add_devices(rtbus::Command command);
Action add_device_test(rtbus::Command command);
Action add_calibrate(rtbus::Command command);
Action add_conformance(rtbus::Command command);
Action add_virtual_device(rtbus::Command command);
Action add_estop(rtbus::Command command);
Action add_adjust(rtbus::Command command);
Action add_still(rtbus::Command command);
Action add_stream(rtbus::Command command);
// In builds with HDF5:
Action add_record(rtbus::Command command);
Action add_mark(rtbus::Command command);
Action add_export(rtbus::Command command);
Action add_plot(rtbus::Command command);
Action add_compare(rtbus::Command command);

}  // namespace tools
