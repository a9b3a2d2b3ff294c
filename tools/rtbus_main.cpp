// The `rtbus` tool: one program, one command per file.
#include <CLI/CLI.hpp>
#include <exception>
#include <iostream>
#include <utility>
#include <vector>

#include "tools/command.hpp"
#include "tools/interrupt.hpp"

namespace {

struct Entry {
  const char* name;
  const char* description;
  tools::Action (*add)(CLI::App&);
};

constexpr Entry kCommands[] = {
    {"run", "Start and supervise the nodes of a session file", &tools::add_run},
    {"list", "Sessions and their topics", &tools::add_list},
    {"echo", "Print the samples of a topic", &tools::add_echo},
    {"hz", "Rate and jitter of a topic", &tools::add_hz},
    {"top", "Live monitor of a session", &tools::add_top},
#if RTBUS_WITH_HDF5
    {"record", "Record a session into an HDF5 file", &tools::add_record},
    {"mark", "Note an event in the recordings under way", &tools::add_mark},
    {"export", "What a recording holds, or all of it as CSV", &tools::add_export},
    {"plot", "Draw signals of a recording or of a running session", &tools::add_plot},
#endif
    {"stream", "Send a session's samples to PlotJuggler", &tools::add_stream},
    {"still", "Render a picture of a session's scene", &tools::add_still},
    {"clean", "Remove what dead processes left in shared memory", &tools::add_clean},
    {"doctor", "Check this machine's realtime set-up, with remedies", &tools::add_doctor},
    {"devices", "Haptic devices on the USB bus: state, permissions, remedies", &tools::add_devices},
    {"device-test", "Test a device step by step: encoders, buttons, a small force", &tools::add_device_test},
    {"calibrate", "Find out with you what a device's file should say", &tools::add_calibrate},
    {"virtual-device", "Offer a virtual USB device over USB/IP", &tools::add_virtual_device},
    {"evaluate", "Run an experiment and check its figures", &tools::add_evaluate},
    {"tune", "Gains that a device bears at given rates", &tools::add_tune},
    {"bench", "Measure this machine: what a physics step costs", &tools::add_bench},
};

constexpr const char* kFooter =
    "\nA first look:\n"
    "  rtbus doctor                              is this machine fit for 1 kHz?\n"
    "  rtbus run config/wall.yaml --duration 20  a simulated hand falls on a wall\n"
    "  rtbus top                                 (in another terminal) watch it\n"
    "  rtbus echo loop_stats                     look into one topic\n"
    "Each command explains itself with --help. Exit status: 0 fine, 1 failed, 2 usage or configuration.";

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"rtbus: force feedback in two processes, joined by shared memory", "rtbus"};
  app.set_version_flag("--version", "rtbus " RTBUS_VERSION);
  app.require_subcommand(1);
  std::vector<std::pair<CLI::App*, tools::Action>> actions;
  for (const Entry& entry : kCommands) {
    CLI::App* const command = app.add_subcommand(entry.name, entry.description);
    actions.emplace_back(command, entry.add(*command));
  }
  app.footer(kFooter);  // after the commands, which would inherit it
  if (argc < 2) {
    std::cerr << app.help();
    return tools::kExitUsage;
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    // --help and --version end here too, with status 0.
    return app.exit(error) == 0 ? tools::kExitFine : tools::kExitUsage;
  }
  tools::catch_interrupts();
  try {
    for (const auto& [command, action] : actions) {
      if (command->parsed()) return action();
    }
  } catch (const std::exception& error) {
    std::cerr << "rtbus: " << error.what() << '\n';
    return tools::kExitFailed;
  }
  return tools::kExitUsage;
}
