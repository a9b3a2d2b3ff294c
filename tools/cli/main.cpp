// The program `rtbus`. The viewer, the bridge and the evaluation are programs of their own, which this one becomes.
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <string>
#include <string_view>

#include "tools/cli/common/command.hpp"
#include "tools/cli/common/find_config.hpp"

namespace {

/// For the list of commands in --help; their options are the other program's.
tools::Action evaluation(rtbus::Command) { return {}; }
[[maybe_unused]] tools::Action viewer(rtbus::Command) { return {}; }
[[maybe_unused]] tools::Action bridge(rtbus::Command) { return {}; }
[[maybe_unused]] tools::Action link_machines(rtbus::Command) { return {}; }

constexpr tools::CommandEntry kCommands[] = {
    {"run", "Start and supervise the nodes of a session file", &tools::add_run},
    {"list", "Sessions and their topics", &tools::add_list},
    {"echo", "Print the samples of a topic", &tools::add_echo},
    {"hz", "Rate and jitter of a topic", &tools::add_hz},
    {"top", "Live monitor of a session", &tools::add_top},
    {"estop", "Zero force in a session, held until it is re-armed", &tools::add_estop},
    {"adjust", "Change a gain of a running session, where its file allows that", &tools::add_adjust},
#if RTBUS_WITH_VIEW
    {"view", "Show a session in a browser, live, or a recording", &viewer},
#endif
#if RTBUS_WITH_DDS
    {"bridge", "Show a session to ROS 2, over DDS", &bridge},
    {"link", "Link a session to its nodes on another machine", &link_machines},
#endif
#if RTBUS_WITH_HDF5
    {"record", "Record a session into an HDF5 file", &tools::add_record},
    {"mark", "Note an event in the recordings under way", &tools::add_mark},
    {"export", "What a recording holds, or all of it as CSV", &tools::add_export},
    {"plot", "Draw signals of recordings or of a running session", &tools::add_plot},
    {"compare", "How far two recordings are apart", &tools::add_compare},
#endif
    {"stream", "Send a session's samples to PlotJuggler", &tools::add_stream},
    {"still", "Render a picture of a session's scene", &tools::add_still},
    {"clean", "Remove what dead processes left in shared memory", &tools::add_clean},
    {"doctor", "Check this machine's realtime set-up, with remedies", &tools::add_doctor},
    {"devices", "Haptic devices on the USB bus: state, permissions, remedies", &tools::add_devices},
    {"device-test", "Test a device step by step: encoders, buttons, a small force", &tools::add_device_test},
    {"calibrate", "Find out with you what a device's file should say", &tools::add_calibrate},
    {"conformance", "Check a driver or an engine of your own by our conformance suite", &tools::add_conformance},
    {"virtual-device", "Offer a virtual USB device over USB/IP", &tools::add_virtual_device},
    {"evaluate", "Run an experiment and check its figures", &evaluation},
    {"tune", "Gains that a device bears at given rates", &evaluation},
    {"bench", "Measure this machine: what a step, a driver or an engine costs", &evaluation},
};

constexpr const char* kFooter =
    "\nA first look:\n"
    "  rtbus doctor                              is this machine fit for 1 kHz?\n"
    "  rtbus run wall --duration 20              a simulated hand falls on a wall\n"
    "  rtbus top                                 (in another terminal) watch it\n"
    "  rtbus view                                the same in a browser, in 3-D\n"
    "  rtbus echo loop_stats                     look into one topic\n"
    "Each command explains itself with --help. Exit status: 0 fine, 1 failed, 2 usage or configuration.";

/// `rtbus conformance ENGINE.yaml`; a driver's module is a .so.
bool checks_an_engine(std::string_view word, int count, char** arguments) {
  const auto ends_with = [=](std::string_view end) {
    return std::any_of(arguments, arguments + count, [=](std::string_view name) { return name.ends_with(end); });
  };
  return word == "conformance" && ends_with(".yaml") && !ends_with(".so");
}

/// The program that has the command `word`; null: this one.
const char* program_of(std::string_view word, int count, char** arguments) {
  if (checks_an_engine(word, count, arguments)) return "rtbus_evaluation";
  for (const tools::CommandEntry& entry : kCommands) {
    if (word != entry.name) continue;
    if (entry.add == &evaluation) return "rtbus_evaluation";
    if (entry.add == &viewer) return "rtbus_view";
    if (entry.add == &bridge) return "rtbus_bridge";
    if (entry.add == &link_machines) return "rtbus_link";
  }
  return nullptr;
}

bool asks_for_help(char** arguments) {
  for (; *arguments != nullptr; ++arguments) {
    if (std::string_view(*arguments) == "--help" || std::string_view(*arguments) == "-h") return true;
  }
  return false;
}

/// The line of `word` in the list of commands.
const char* summary_of(std::string_view word) {
  for (const tools::CommandEntry& entry : kCommands) {
    if (word == entry.name) return entry.description;
  }
  return "";
}

/// Becomes that program. Returns only when it is not there.
int become(const char* name, char** argv) {
  const std::string program = tools::folder_of_this_program() + "/" + name;
  ::execv(program.c_str(), argv);
  if (errno == ENOENT && asks_for_help(argv + 2)) {
    // Its options are that program's own; what it does and how to get it can be said without it.
    std::printf("rtbus %s: %s\n\nThis command is a program of its own, %s, which is not here yet.\n", argv[1],
                summary_of(argv[1]), name);
    std::printf("In a source tree `tools/build %s` builds it. Then --help lists its options.\n", name);
    return tools::kExitFine;
  }
  std::fprintf(stderr, "rtbus %s: %s: %s\n", argv[1], program.c_str(), std::strerror(errno));
  if (errno == ENOENT) {
    std::fprintf(
        stderr,
        "It is a program of its own. The package %s has it; in a source tree build it with\n"
        "  tools/build %s\n",
        std::string_view(name) == "rtbus_bridge" || std::string_view(name) == "rtbus_link" ? "rtbus-bridge" : "rtbus",
        name);
  }
  return tools::kExitFailed;
}

}  // namespace

int main(int argc, char** argv) {
  // `rtbus __complete evaluate …`: that program knows its options.
  const bool completes = argc > 3 && argv[1] == tools::kComplete;
  const char* const program = argc > 1 ? program_of(argv[completes ? 2 : 1], argc, argv) : nullptr;
  if (program != nullptr) return become(program, argv);
  return tools::run_commands(kCommands, kFooter, argc, argv);
}
