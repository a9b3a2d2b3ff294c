// `rtbus top`: live monitor of a session in the terminal.
#include <langinfo.h>
#include <unistd.h>

#include <algorithm>
#include <clocale>
#include <cstdio>
#include <cstring>
#include <iostream>
#include <memory>
#include <optional>
#include <string>

#include "rtbus/clock.hpp"
#include "tools/command.hpp"
#include "tools/field_format.hpp"
#include "tools/interrupt.hpp"
#include "tools/top_collect.hpp"
#include "tools/top_json.hpp"
#include "tools/top_screen.hpp"
#include "tools/top_view.hpp"

namespace tools {

namespace {

struct TopOptions {
  std::optional<std::string> session;
  bool once = false;
  bool json = false;
  bool ascii = false;
  bool no_telemetry = false;
  double refresh_hz = 4.0;

  [[nodiscard]] std::uint64_t period_ns() const { return static_cast<std::uint64_t>(1e9 / refresh_hz); }
};

/// Telemetry is followed this often however rarely the screen changes: its ring holds two seconds.
constexpr std::uint64_t kFollow_ns = 100 * rtbus::kNsPerMs;

/// The screen: collects, draws, and asks for keys until the user or a signal ends it.
class Monitor {
 public:
  explicit Monitor(const TopOptions& options) : options_(options), collector_(options.session, !options.no_telemetry) {}

  int run() {
    Screen screen;
    if (!screen.works()) {
      std::cerr << "rtbus top: this terminal is not known here (TERM); use --once or --json\n";
      return kExitFailed;
    }
    choice_.utf8 = screen.utf8() && !options_.ascii;
    std::uint64_t next_ns = 0;
    bool changed = true;
    while (!interrupted()) {
      const std::uint64_t now_ns = rtbus::monotonic_ns();
      if (now_ns >= next_ns) {
        // While paused the screen keeps its figures, and only follows the keys and the size of the window.
        if (!choice_.paused) snapshot_ = collector_.collect();
        changed = changed || !choice_.paused;
        next_ns = now_ns + options_.period_ns();
        look_at_sample(!choice_.paused);
      } else {
        collector_.follow();
      }
      if (changed) screen.draw(page_lines(snapshot_, sample_, choice_, screen.width(), screen.height()));
      changed = false;
      const std::uint64_t later_ns = rtbus::monotonic_ns();
      const std::uint64_t wait_ns = std::min(kFollow_ns, next_ns > later_ns ? next_ns - later_ns : 0);
      const TopKey key = screen.key(static_cast<int>(wait_ns / rtbus::kNsPerMs) + 1, changed);
      if (key.kind == TopKey::Kind::kNone) continue;
      if (!apply_key(key, snapshot_, choice_)) break;
      if (!choice_.session.empty()) {
        collector_.choose(choice_.session);
        next_ns = 0;
      }
      look_at_sample(false);
      changed = true;
    }
    return kExitFine;
  }

 private:
  /// Reads the chosen topic when its page is shown. @param anew Also when it has been read already.
  void look_at_sample(bool anew) {
    if (choice_.page != TopPage::kTopics || snapshot_.topics.empty()) {
      sample_.reset();
      collector_.leave_sample();
      return;
    }
    const std::string& topic = snapshot_.topics[chosen_index(snapshot_.topics, choice_.topic)].name;
    if (anew || !sample_ || sample_->topic != topic) sample_ = collector_.sample(topic);
  }

  const TopOptions& options_;
  TopCollector collector_;
  TopSnapshot snapshot_;
  std::optional<SampleView> sample_;
  TopChoice choice_;
};

int watch(const TopOptions& options) {
  if (::isatty(STDIN_FILENO) != 1 || ::isatty(STDOUT_FILENO) != 1) {
    std::cerr << "rtbus top: needs a terminal; in a script use --once, --json or --once --json\n";
    return kExitUsage;
  }
  return Monitor(options).run();
}

/// One line of JSON per period; also while no session is there, so that whoever reads it knows.
int stream(const TopOptions& options) {
  TopCollector collector(options.session, !options.no_telemetry);
  std::uint64_t next_ns = rtbus::monotonic_ns();
  while (!interrupted()) {
    std::cout << json_line(top_json(collector.collect())) << '\n' << std::flush;
    if (!std::cout) return kExitFailed;  // nobody takes the output any more
    next_ns += options.period_ns();
    for (std::uint64_t now_ns = rtbus::monotonic_ns(); now_ns < next_ns; now_ns = rtbus::monotonic_ns()) {
      if (!sleep_unless_interrupted(std::min(kFollow_ns, next_ns - now_ns))) return kExitFine;
      collector.follow();
    }
  }
  return kExitFine;
}

int print_once(const TopOptions& options) {
  // A single look does not wait for telemetry, so it does not ask for any.
  const TopSnapshot snapshot = TopCollector(options.session, false).collect();
  if (snapshot.session.empty()) {
    std::cerr << "rtbus top: " << snapshot.message << '\n';
    return kExitFailed;
  }
  if (options.json) {
    std::cout << top_json(snapshot).dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) << '\n';
    return kExitFine;
  }
  std::setlocale(LC_CTYPE, "");
  TopChoice choice;
  choice.utf8 = !options.ascii && std::strcmp(::nl_langinfo(CODESET), "UTF-8") == 0;
  for (const ViewLine& line : overview_lines(snapshot, choice, 0, 0)) std::puts(line.text().c_str());
  return kExitFine;
}

}  // namespace

Action add_top(CLI::App& command) {
  auto options = std::make_shared<TopOptions>();
  command.add_option("-s,--session", options->session, "Session; not needed while only one is live");
  command.add_flag("--once", options->once, "Print the state once, as plain text, and end");
  command.add_flag("--json", options->json, "Schema rtbus-top/1: one line per period, or with --once one document");
  command.add_option("--refresh", options->refresh_hz, "Screens or lines of JSON a second [Hz]")
      ->check(CLI::Range(0.1, 20.0))
      ->capture_default_str();
  command.add_flag("--ascii", options->ascii, "No block characters, also when the locale has them");
  command.add_flag("--no-telemetry", options->no_telemetry,
                   "Do not ask the haptic nodes for their ticks: no histogram, no curves, no last cut");
  command.footer("Keys: q quit, p pause, t topics, u units, Tab and arrows choose, ? help. docs/monitoring.md.");
  return [options] {
    if (options->once) return print_once(*options);
    return options->json ? stream(*options) : watch(*options);
  };
}

}  // namespace tools
