#include "tools/top_view.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "tools/top_json.hpp"

namespace {

using testing::HasSubstr;
using testing::Not;

template <std::size_t N>
void set(rtbus::Text<N>& text, const char* value) {
  std::strncpy(text.data(), value, N - 1);
}

tools::HapticView haptic(const std::string& name) {
  tools::HapticView view;
  view.name = name;
  view.life = {true, 0.01, 4242};
  view.info.emplace();
  set(view.info->role, "haptic");
  set(view.info->kind, "phantom_desktop");
  set(view.info->method, "remote_virtual_coupling");
  set(view.info->clock, "timer");
  set(view.info->scheduling, "SCHED_FIFO");
  view.info->force_limit_n = 8.0;
  view.info->core = 1;
  view.stats.emplace();
  view.stats->rate_hz = 1000.0;
  view.stats->achieved_hz = 999.9;
  view.stats->ticks = 123'456'789;
  view.stats->ticks_due = 123'456'800;
  view.stats->overruns = 11;
  view.stats->wakeup_max_us = 12'345.6;
  view.stats->force_peak_n = 6.0;
  view.stats->slew_limited = 7;
  view.device.emplace();
  view.device->position_m = {0.0123, -0.002, 0.0};
  view.device->buttons = 0b101;
  view.device->enabled = 1;
  view.force_n = 4.0;
  return view;
}

tools::TopSnapshot snapshot(int haptics = 1, int topics = 9) {
  tools::TopSnapshot snapshot;
  snapshot.session = "wall";
  snapshot.uptime_s = 3725.0;
  for (int i = 0; i < haptics; ++i) snapshot.haptic.push_back(haptic("haptic" + std::to_string(i)));
  tools::PhysicsView physics;
  physics.name = "physics";
  physics.life = {true, 0.01, 4243};
  physics.stats.emplace();
  physics.stats->rate_hz = 18.0;
  snapshot.physics.push_back(physics);
  for (int i = 0; i < topics; ++i) {
    snapshot.topics.push_back({"haptic0.topic_" + std::to_string(i), 1000.0, 5, 4242, true, ""});
  }
  return snapshot;
}

std::string joined(const std::vector<tools::ViewLine>& lines) {
  std::string text;
  for (const tools::ViewLine& line : lines) text += line.text + "\n";
  return text;
}

std::string all(const tools::TopSnapshot& of) { return joined(tools::top_lines(of, 0, 0)); }

class Windows : public testing::TestWithParam<std::pair<int, int>> {};
INSTANTIATE_TEST_SUITE_P(TopView, Windows,
                         testing::Values(std::pair{80, 24}, std::pair{120, 40}, std::pair{20, 5}, std::pair{1, 1},
                                         std::pair{80, 2}));

TEST_P(Windows, AreFilledExactlyAndNeverExceeded) {
  const auto [width, height] = GetParam();
  for (int haptics = 0; haptics < 6; ++haptics) {
    for (const int topics : {0, 1, 9, 60}) {
      const auto lines = tools::top_lines(snapshot(haptics, topics), width, height);
      EXPECT_EQ(lines.size(), static_cast<std::size_t>(height));
      for (const auto& line : lines) EXPECT_LE(line.text.size(), static_cast<std::size_t>(width)) << line.text;
      EXPECT_THAT(lines.back().text, testing::StartsWith("q"));
    }
  }
  EXPECT_EQ(tools::help_lines(width, height).size(), static_cast<std::size_t>(height));
}

TEST(TopView, ShowsOneHandAndItsTopicsIn80x24WithoutCuttingALine) {
  const auto lines = tools::top_lines(snapshot(), 80, 24);
  const auto uncut = tools::top_lines(snapshot(), 0, 24);
  EXPECT_EQ(joined(lines), joined(uncut));
  EXPECT_THAT(joined(lines), HasSubstr("haptic0.topic_8"));
}

TEST(TopView, CountsTheTopicsThatFindNoRoom) {
  const std::string text = joined(tools::top_lines(snapshot(1, 40), 80, 24));
  const auto shown = [&] {
    std::size_t found = 0;
    for (std::size_t at = text.find("haptic0.topic_"); at != std::string::npos;
         at = text.find("haptic0.topic_", at + 1))
      ++found;
    return found;
  }();
  EXPECT_GT(shown, 0u);
  EXPECT_THAT(text, HasSubstr("+ " + std::to_string(40 - shown) + " more"));
}

TEST(TopView, DropsDetailsBeforeItDropsANode) {
  const std::string text = joined(tools::top_lines(snapshot(3, 9), 80, 24));
  EXPECT_THAT(text, HasSubstr("haptic2 alive"));
  EXPECT_THAT(text, HasSubstr("physics alive"));
  EXPECT_THAT(text, Not(HasSubstr("position")));
  EXPECT_THAT(joined(tools::top_lines(snapshot(3, 9), 120, 40)), HasSubstr("position"));
}

TEST(TopView, DrawsTheForceAgainstTheLimitWithThePeakAsAMark) {
  EXPECT_THAT(all(snapshot()), HasSubstr("[##########....|.....] now 4.00 of 8.0 N"));
}

TEST(TopView, SurvivesForcesThatAreNoNumbers) {
  auto of = snapshot();
  of.haptic[0].force_n = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(all(of), HasSubstr("[##############|#####]"));  // full: nothing may look harmless that is unknown
  of.haptic[0].force_n = 1e300;
  of.haptic[0].stats->force_peak_n = std::numeric_limits<double>::infinity();
  EXPECT_THAT(all(of), HasSubstr("###|] now 1e+300 of 8.0 N  rms 0.00  peak inf N"));
  of.haptic[0].info->force_limit_n = 0.0;
  EXPECT_THAT(all(of), HasSubstr("[....................]"));
}

TEST(TopView, NamesOnlyTheSafetyRungsThatActed) {
  const std::string text = all(snapshot());
  EXPECT_THAT(text, HasSubstr("slew 7"));
  EXPECT_THAT(text, Not(HasSubstr("overspeed")));
  auto calm = snapshot();
  calm.haptic[0].stats->slew_limited = 0;
  EXPECT_THAT(all(calm), HasSubstr("nothing acted"));
}

TEST(TopView, SaysWhichButtonsArePressedAndWhetherForcesAct) {
  EXPECT_THAT(all(snapshot()), HasSubstr("buttons 0 2   forces on"));
  auto off = snapshot();
  off.haptic[0].device->enabled = 0;
  EXPECT_THAT(all(off), HasSubstr("forces OFF"));
}

TEST(TopView, WarnsOfEnergyThatWasMade) {
  auto of = snapshot();
  of.haptic[0].stats->energy_absorbed_j = -0.5;
  const auto lines = tools::top_lines(of, 0, 0);
  const auto line = std::find_if(lines.begin(), lines.end(),
                                 [](const auto& each) { return each.text.find("MADE 0.5 J") != std::string::npos; });
  ASSERT_NE(line, lines.end());
  EXPECT_EQ(line->tone, tools::Tone::kWarn);
}

TEST(TopView, ShowsANodeThatHasToldNothingYet) {
  auto of = snapshot(0);
  tools::HapticView fresh;
  fresh.name = "haptic0";
  fresh.life.writer_alive = true;
  of.haptic.push_back(fresh);
  EXPECT_THAT(all(of), HasSubstr("haptic0 starting"));
}

TEST(TopView, TellsWhatToDoWhenNothingRuns) {
  tools::TopSnapshot nothing;
  nothing.message = "no session is running";
  EXPECT_THAT(joined(tools::top_lines(nothing, 80, 24)), HasSubstr("no session is running"));
  EXPECT_THAT(joined(tools::top_lines(nothing, 12, 24)), HasSubstr("\nno session\nis running\n"));
}

TEST(LifeText, TellsDeadStoppedAndLivingApart) {
  EXPECT_EQ(tools::life_text({true, 0.02, 1}), "alive");
  EXPECT_EQ(tools::life_text({true, 0.34, 1}), "STALE 0.34 s");
  EXPECT_EQ(tools::life_text({true, std::nullopt, 1}), "starting");
  EXPECT_EQ(tools::life_text({false, 0.02, 1}), "GONE");
}

TEST(ForceBetween, IsTheRmsOfTheTicksInBetween) {
  rtbus::LoopStats before, now;
  before.ticks = 1000;
  before.force_rms_n = 1.0;
  now.ticks = 1500;
  now.force_rms_n = std::sqrt((1000 * 1.0 + 500 * 9.0) / 1500);  // 3 N over the last 500 ticks
  EXPECT_NEAR(tools::force_between(before, now).value(), 3.0, 1e-12);
}

TEST(ForceBetween, IsUnknownWithoutTicksInBetween) {
  rtbus::LoopStats stats;
  stats.ticks = 1000;
  EXPECT_FALSE(tools::force_between(stats, stats).has_value());
}

TEST(ForceBetween, IsZeroAndNotNanWhenTheForceHasCeased) {
  rtbus::LoopStats before, now;
  before.ticks = 1'000'000;
  before.force_rms_n = 0.1;
  now.ticks = 1'000'200;
  now.force_rms_n = 0.1 * std::sqrt(1e6 / 1'000'200.0) * (1.0 - 1e-15);
  EXPECT_LT(tools::force_between(before, now).value(), 1e-5);
}

TEST(TopJson, CarriesTheFiguresUnderTheNamesOfTheReport) {
  const auto json = tools::top_json(snapshot());
  EXPECT_EQ(json["schema"], "rtbus-top/1");
  EXPECT_EQ(json["haptic"][0]["overruns"], 11);
  EXPECT_EQ(json["haptic"][0]["wakeup_latency_us"]["max"], 12'345.6);
  EXPECT_EQ(json["haptic"][0]["force_n"]["now"], 4.0);
  EXPECT_EQ(json["haptic"][0]["life"]["alive"], true);
  EXPECT_EQ(json["physics"][0]["rate_asked_hz"], 18.0);
  EXPECT_EQ(json["topics"].size(), 9u);
}

}  // namespace
