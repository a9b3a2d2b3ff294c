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
#include "tools/cli/common/command.hpp"
#include "tools/cli/common/field_format.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/orders/order_socket.hpp"
#include "tools/cli/top/top_collect.hpp"
#include "tools/cli/top/top_json.hpp"
#include "tools/cli/top/top_screen.hpp"
#include "tools/cli/top/top_view.hpp"

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

/// How long the outcome of an order is shown.
constexpr std::uint64_t kNotice_ns = 4 * rtbus::kNsPerS;

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
      if (!choice_.notice.empty() && now_ns > notice_end_ns_) choice_.notice.clear();
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
      if (!take_order(key) && !apply_key(key, snapshot_, choice_)) break;
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
  /// E: E-stop, R: re-arm. In capitals, so that no slip of a finger re-arms. @returns whether the key was one of them.
  bool take_order(const TopKey& key) {
    const bool letter = key.kind == TopKey::Kind::kCharacter && (key.character == 'E' || key.character == 'R');
    if (!letter || snapshot_.session.empty()) return false;
    const bool estop = key.character == 'E';
    nlohmann::json order{{"order", estop ? "estop" : "rearm"}};
    if (estop) order["reason"] = "rtbus top";
    const auto reply = send_order(snapshot_.session, order);
    if (!reply || !reply->value("ok", false)) {
      choice_.notice = "NOT DONE: " + (reply ? reply->value("error", "refused") : reply.error());
    } else {
      choice_.notice = estop ? "E-STOP: zero force until R re-arms" : "re-armed: force ramps up";
    }
    notice_end_ns_ = rtbus::monotonic_ns() + kNotice_ns;
    return true;
  }

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
  std::uint64_t notice_end_ns_ = 0;
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

Action add_top(rtbus::Command command) {
  auto options = std::make_shared<TopOptions>();
  command.option("-s,--session", options->session, "Session; not needed while only one is live").type_name("SESSION");
  command.flag("--once", options->once, "Print the state once, as plain text, and end");
  command.flag("--json", options->json, "Schema rtbus-top/1: one line per period, or with --once one document");
  command.option("--refresh", options->refresh_hz, "Screens or lines of JSON a second [Hz]")
      .range(0.1, 20.0)
      .show_default();
  command.flag("--ascii", options->ascii, "No block characters, also when the locale has them");
  command.flag("--no-telemetry", options->no_telemetry,
               "Do not ask the haptic nodes for their ticks: no histogram, no curves, no last cut");
  command.footer(
      "Keys: q quit, E E-stop, R re-arm, p pause, t topics, u units, Tab and arrows choose, ? help. "
      "docs/monitoring.md.");
  return [options] {
    if (options->once) return print_once(*options);
    return options->json ? stream(*options) : watch(*options);
  };
}

}  // namespace tools
