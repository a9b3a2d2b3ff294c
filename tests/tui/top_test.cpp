// `rtbus top` as its user sees it: in a terminal, on a live session whose nodes come, go and stop.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "tests/support/nodes.hpp"
#include "tests/support/tmux.hpp"
#include "tools/cli/top/top_marks.hpp"

namespace {

using testing::HasSubstr;
using testing::Not;

class Top : public tests::Nodes {
 protected:
  void SetUp() override {
    if (!tests::Tmux::available()) GTEST_SKIP() << "tmux is not there";
    Nodes::SetUp();
    start(80, 24, "C.UTF-8");
  }
  void TearDown() override {
    terminal_.reset();
    for (const char* const end : {"", ".pid", ".after"}) unlink((settings_file() + end).c_str());
    if (tests::Tmux::available()) Nodes::TearDown();
  }
  void start(int width, int height, const std::string& locale) {
    terminal_.reset();
    terminal_.emplace(width, height, locale);
    ASSERT_TRUE(terminal_->shows("ready>"));
    terminal_->type("stty -a > " + settings_file());
    // One shell more, so that the monitor's process number is known.
    terminal_->type("clear; sh -c \"echo \\$\\$ > " + settings_file() + ".pid; exec " + binary("rtbus") +
                    " top --session " + bus_.name + "\"");
  }
  void start_session() {
    start_physics();
    start_haptic();
    ASSERT_TRUE(terminal_->shows("haptic0 alive")) << terminal_->seen();
    ASSERT_TRUE(terminal_->shows("physics alive")) << terminal_->seen();
  }
  /// Shows `text`. With RTBUS_SCREENS=folder the screen that did is kept there under `name`, to be looked at.
  void expect(const std::string& text, const std::string& name = "") {
    EXPECT_TRUE(terminal_->shows(text)) << "no '" << text << "' in\n" << terminal_->seen();
    const char* const folder = std::getenv("RTBUS_SCREENS");
    if (folder != nullptr && !name.empty())
      std::ofstream(std::string(folder) + "/" + name + ".txt") << terminal_->screen();
  }
  /// The shell is back, at settings equal to those before.
  void expect_sane_terminal() {
    EXPECT_TRUE(terminal_->shows("ready>")) << terminal_->seen();
    EXPECT_THAT(terminal_->seen(), Not(HasSubstr("haptic0")));
    terminal_->type("stty -a > " + settings_file() + ".after; echo written");
    expect("\nwritten");
    const std::string before = text_of_file(settings_file()), after = text_of_file(settings_file() + ".after");
    EXPECT_THAT(before, HasSubstr("echo"));
    EXPECT_EQ(before, after);
  }
  /// Signals the monitor.
  void signal_top(int number) {
    const std::string file = settings_file() + ".pid";
    const int pid = std::atoi(text_of_file(file).c_str());
    unlink(file.c_str());
    ASSERT_GT(pid, 1);
    ASSERT_EQ(::kill(pid, number), 0);
  }
  [[nodiscard]] std::string settings_file() const { return testing::TempDir() + bus_.name + ".stty"; }
  static std::string text_of_file(const std::string& path) {
    std::ostringstream text;
    text << std::ifstream(path).rdbuf();
    return text.str();
  }
  /// Cells of the longest line.
  static std::size_t widest_line(const std::string& screen) {
    std::istringstream lines(screen);
    std::size_t widest = 0;
    for (std::string line; std::getline(lines, line);) widest = std::max(widest, tools::cells_of(line));
    return widest;
  }

  std::optional<tests::Tmux> terminal_;
};

TEST_F(Top, WaitsForASessionShowsItAndLeavesTheTerminalAsItWas) {
  expect("waiting for a session", "waiting");
  expect("rtbus run wall");
  start_session();
  expect("jitter");
  expect("last cut");
  expect("topics");
  terminal_->press("q");
  expect_sane_terminal();
}

TEST_F(Top, PagesHelpUnitsAndPause) {
  start_session();
  terminal_->press("?");
  expect("any key: back", "help");
  terminal_->press("x");
  expect("haptic0 alive");
  terminal_->press("u");
  expect(" m   forces on", "si");
  terminal_->press("u");
  terminal_->press("t");
  expect("rtbus/", "topics");
  // Walk down to the loop's statistics, whatever the order of topics is.
  for (int i = 0; i < 20 && !terminal_->shows("rtbus/LoopStats", 0.4); ++i) terminal_->press("Down");
  expect("wakeup_p50_us");
  terminal_->press("t");
  expect("haptic0 alive");

  terminal_->press("p");
  expect("PAUSED");
  const std::string paused = terminal_->screen();
  usleep(1'500'000);  // six periods
  EXPECT_EQ(terminal_->screen(), paused);
  terminal_->press("p");
  EXPECT_TRUE(terminal_->shows_no("PAUSED"));
  EXPECT_TRUE(tests::eventually(10.0, [&] { return terminal_->screen() != paused; }));
}

TEST_F(Top, FollowsTheSizeOfTheWindow) {
  start_session();
  expect("last 10 s max", "80x24");
  terminal_->resize(120, 40);
  expect("granted", "120x40");
  expect("q quit");
  terminal_->resize(60, 20);
  EXPECT_TRUE(terminal_->shows_no("granted")) << terminal_->seen();
  expect("q quit", "60x20");
  expect("haptic0 alive");
  EXPECT_LE(widest_line(terminal_->screen()), 60u);
}

TEST_F(Top, SaysStoppedDeadAndAliveAgain) {
  start_session();
  haptic_->signal(SIGSTOP);
  expect("haptic0 STALE", "stale");
  haptic_->signal(SIGCONT);
  expect("haptic0 alive");
  haptic_->end(SIGKILL);
  expect("haptic0 GONE", "gone");
  start_haptic();
  expect("haptic0 alive");
  expect("restarts 1", "restarted");
  physics_->end(SIGKILL);
  expect("physics GONE");
  expect("NOW, for", "cut");  // the hand lost its physics, and the screen says so
  start_physics();
  expect("physics alive");
  expect(" s ago, for ");
}

TEST_F(Top, DrawsInAsciiWhereTheLocaleHasNothingElse) {
  start(80, 24, "C");
  start_session();
  expect("jitter");
  const std::string screen = terminal_->screen();
  EXPECT_TRUE(std::all_of(screen.begin(), screen.end(), [](char c) { return static_cast<unsigned char>(c) < 128; }))
      << screen;
}

TEST_F(Top, RestoresTheTerminalAtSigterm) {
  start_session();
  signal_top(SIGTERM);
  expect_sane_terminal();
}

TEST_F(Top, ItsDeathIsInvisibleToTheNodes) {
  start_session();
  auto stats = reader<rtbus::LoopStats>("haptic0.loop_stats");
  ASSERT_TRUE(stats);
  signal_top(SIGKILL);
  EXPECT_TRUE(terminal_->shows("ready>"));
  rtbus::Stamped<rtbus::LoopStats> now;
  std::uint64_t first = 0;
  EXPECT_TRUE(tests::eventually(10.0, [&] {
    if (stats->read_latest(now) != rtbus::ReadStatus::kFresh) return false;
    if (first == 0) first = now.value.ticks;
    return now.value.ticks > first + 500;
  }));
  EXPECT_EQ(now.value.losses, 0u);
  // Nobody looks any more: the telemetry ends by itself.
  auto ticks = rtbus::Reader<rtbus::Telemetry>::open(bus_, "haptic0.telemetry", {});
  ASSERT_TRUE(ticks);
  rtbus::Stamped<rtbus::Telemetry> tick;
  EXPECT_TRUE(tests::eventually(10.0, [&] {
    while (ticks->read_next(tick) == rtbus::ReadStatus::kFresh) {
    }
    usleep(200'000);
    return ticks->read_next(tick) == rtbus::ReadStatus::kSame;
  }));
}

}  // namespace
