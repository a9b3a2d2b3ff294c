#include "tools/cli/common/command.hpp"

#include <cstdio>
#include <exception>
#include <new>
#include <optional>
#include <utility>
#include <vector>

#include "tools/cli/common/interrupt.hpp"

namespace tools {

namespace {

int parse_and_run(std::span<const CommandEntry> commands, const std::string& footer, int argc, char** argv) {
  rtbus::CommandLine line("rtbus", "rtbus: force feedback in two processes, joined by shared memory");
  line.version("rtbus " RTBUS_VERSION);
  line.require_command();
  std::vector<std::pair<std::string, rtbus::Command>> known;
  std::vector<Action> actions;
  for (const CommandEntry& entry : commands) {
    const rtbus::Command command = line.add_command(entry.name, entry.description);
    known.emplace_back(entry.name, command);
    actions.push_back(entry.add(command));
  }
  line.root().footer(footer);  // after the commands, which would inherit it
  if (argc < 2) {
    std::fprintf(stderr, "%s", line.root().help().c_str());
    return kExitUsage;
  }
  if (argc > 2 && std::string_view(argv[1]) == kComplete) {
    for (const std::string& word : completions(known, std::vector<std::string>(argv + 2, argv + argc))) {
      std::printf("%s\n", word.c_str());
    }
    return kExitFine;
  }
  if (const std::optional<int> status = line.parse(argc, argv)) return *status;
  catch_interrupts();
  for (std::size_t i = 0; i < known.size(); ++i) {
    if (known[i].second.parsed()) return actions[i]();
  }
  return kExitUsage;
}

}  // namespace

int run_commands(std::span<const CommandEntry> commands, const std::string& footer, int argc, char** argv) {
  try {
    return parse_and_run(commands, footer, argc, argv);
  } catch (const std::bad_alloc&) {
    std::fputs("rtbus: out of memory\n", stderr);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "rtbus: %s\n", error.what());
  }
  return kExitFailed;
}

}  // namespace tools
