// `rtbus top`: live monitor of a session in the terminal.
#include <curses.h>
#include <unistd.h>

#include <algorithm>
#include <clocale>
#include <cstdio>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/clock.hpp"
#include "tools/command.hpp"
#include "tools/interrupt.hpp"
#include "tools/top_collect.hpp"
#include "tools/top_json.hpp"
#include "tools/top_view.hpp"

namespace tools {

namespace {

struct TopOptions {
  std::optional<std::string> session;
  bool once = false;
  bool json = false;
  double refresh_hz = 4.0;
};

/// Owns the terminal: whatever ends the command, the user gets it back as it was.
class Screen {
 public:
  Screen() {
    std::setlocale(LC_ALL, "");
    ::initscr();
    ::cbreak();
    ::noecho();
    ::curs_set(0);
    ::keypad(stdscr, TRUE);
    if (::has_colors()) {
      ::start_color();
      ::use_default_colors();
      ::init_pair(1, COLOR_YELLOW, -1);
      ::init_pair(2, COLOR_RED, -1);
    }
  }
  ~Screen() { ::endwin(); }
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;

  void draw(const std::vector<ViewLine>& lines) {
    ::erase();
    for (std::size_t row = 0; row < lines.size(); ++row) {
      const attr_t attributes = attributes_of(lines[row].tone);
      ::attron(attributes);
      mvaddstr(static_cast<int>(row), 0, lines[row].text.c_str());
      ::attroff(attributes);
    }
    ::refresh();
  }

  /// The next key within `wait_ms`; ERR when there is none.
  [[nodiscard]] int key(int wait_ms) {
    ::timeout(wait_ms);
    return ::getch();
  }

 private:
  static attr_t attributes_of(Tone tone) {
    switch (tone) {
      case Tone::kPlain:
        return A_NORMAL;
      case Tone::kHeading:
        return A_BOLD;
      case Tone::kWarn:
        return static_cast<attr_t>(A_BOLD | COLOR_PAIR(1));
      case Tone::kBad:
        return static_cast<attr_t>(A_BOLD | COLOR_PAIR(2));
      case Tone::kDim:
        return A_DIM;
    }
    return A_NORMAL;
  }
};

int watch(const TopOptions& options) {
  if (::isatty(STDIN_FILENO) != 1 || ::isatty(STDOUT_FILENO) != 1) {
    std::cerr << "rtbus top: needs a terminal; in a script use --once or --once --json\n";
    return kExitUsage;
  }
  TopCollector collector(options.session);
  Screen screen;
  TopSnapshot snapshot = collector.collect();
  bool help = false;
  std::uint64_t next_ns = 0;
  while (!interrupted()) {
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    if (now_ns >= next_ns) {
      // While paused the screen keeps its figures, and only follows the size of the window.
      if (!snapshot.paused) snapshot = collector.collect();
      next_ns = now_ns + static_cast<std::uint64_t>(1e9 / options.refresh_hz);
    }
    screen.draw(help ? help_lines(COLS, LINES) : top_lines(snapshot, COLS, LINES));
    const std::uint64_t later_ns = rtbus::monotonic_ns();
    const int wait_ms = next_ns > later_ns ? static_cast<int>((next_ns - later_ns) / rtbus::kNsPerMs) + 1 : 0;
    const int key = screen.key(wait_ms);
    if (key == ERR || key == KEY_RESIZE) continue;
    if (key == 'q' || key == 'Q') break;
    if (help) {
      help = false;
    } else if (key == '?' || key == 'h') {
      help = true;
    } else if (key == 'p' || key == ' ') {
      snapshot.paused = !snapshot.paused;
    }
  }
  return kExitFine;
}

int print_once(const TopOptions& options) {
  const TopSnapshot snapshot = TopCollector(options.session).collect();
  if (snapshot.session.empty()) {
    std::cerr << "rtbus top: " << snapshot.message << '\n';
    return kExitFailed;
  }
  if (options.json) {
    std::cout << top_json(snapshot).dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) << '\n';
    return kExitFine;
  }
  for (const ViewLine& line : top_lines(snapshot, 0, 0)) std::puts(line.text.c_str());
  return kExitFine;
}

}  // namespace

Action add_top(CLI::App& command) {
  auto options = std::make_shared<TopOptions>();
  command.add_option("-s,--session", options->session, "Session; not needed while only one is live");
  auto* const once = command.add_flag("--once", options->once, "Print the state once, as plain text, and end");
  command.add_flag("--json", options->json, "With --once: as JSON, schema rtbus-top/1")->needs(once);
  command.add_option("--refresh", options->refresh_hz, "Screens a second [Hz]")
      ->check(CLI::Range(0.1, 20.0))
      ->capture_default_str();
  command.footer("Keys: q quit, p pause, ? help.");
  return [options] { return options->once ? print_once(*options) : watch(*options); };
}

}  // namespace tools
