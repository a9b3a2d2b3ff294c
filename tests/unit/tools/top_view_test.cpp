#include "tools/cli/top/top_view.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "haptic_node/safety.hpp"
#include "tests/unit/tools/top_samples.hpp"
#include "tools/cli/top/top_json.hpp"
#include "tools/cli/top/top_marks.hpp"

namespace {

using testing::HasSubstr;
using testing::Not;
using tests::all;
using tests::joined;
using tests::snapshot;
using tests::tone_at;
using tools::overview_lines;
using tools::Tone;

tools::TopChoice choice(bool utf8 = false) {
  tools::TopChoice chosen;
  chosen.utf8 = utf8;
  return chosen;
}

std::string screen(const tools::TopSnapshot& of, int width, int height) {
  return joined(overview_lines(of, choice(), width, height));
}

class Windows : public testing::TestWithParam<std::pair<int, int>> {};
INSTANTIATE_TEST_SUITE_P(TopView, Windows,
                         testing::Values(std::pair{80, 24}, std::pair{60, 20}, std::pair{120, 40}, std::pair{20, 5},
                                         std::pair{1, 1}, std::pair{80, 2}, std::pair{300, 90}));

TEST_P(Windows, AreFilledExactlyAndNeverExceeded) {
  const auto [width, height] = GetParam();
  for (const bool utf8 : {false, true}) {
    for (int haptics = 0; haptics < 6; ++haptics) {
      for (const int topics : {0, 1, 9, 60}) {
        const auto lines = overview_lines(snapshot(haptics, topics), choice(utf8), width, height);
        EXPECT_EQ(lines.size(), static_cast<std::size_t>(height));
        for (const auto& line : lines)
          EXPECT_LE(tools::cells_of(line.text()), static_cast<std::size_t>(width)) << line.text();
        EXPECT_THAT(lines.back().text(), testing::StartsWith("q"));
      }
    }
  }
  EXPECT_EQ(tools::help_lines(width, height).size(), static_cast<std::size_t>(height));
}

TEST_P(Windows, ShowTopicPagesOfTheirSize) {
  const auto [width, height] = GetParam();
  tools::SampleView sample{"haptic0.topic_3", "rtbus/Something", "", 12, 0.001, {}};
  for (int i = 0; i < 40; ++i) sample.fields.push_back({"field_" + std::to_string(i), "m", {1.5, 2.5, 3.5}});
  for (const std::size_t scroll : {0u, 5u, 1000u}) {
    auto chosen = choice(true);
    chosen.scroll = scroll;
    const auto lines = tools::topic_lines(snapshot(1, 60), sample, chosen, width, height);
    EXPECT_EQ(lines.size(), static_cast<std::size_t>(height));
    for (const auto& line : lines) EXPECT_LE(tools::cells_of(line.text()), static_cast<std::size_t>(width));
  }
}

TEST(TopView, PointsToTheTopicPageWhereOneLineIsLeft) {
  EXPECT_THAT(screen(snapshot(), 60, 20), HasSubstr("topics: 9, press t"));
}

TEST(ThreeFigures, AreThreeAlsoBelowOne) {
  EXPECT_EQ(tools::three_figures(0.000361), "0.000361");
  EXPECT_EQ(tools::three_figures(1.0), "1.00");
  EXPECT_EQ(tools::three_figures(13.94), "13.9");
  EXPECT_EQ(tools::three_figures(99.96), "100");
  EXPECT_EQ(tools::three_figures(3642.4), "3642");
  EXPECT_EQ(tools::three_figures(0.0), "0");
}

class UsualWindows : public testing::TestWithParam<std::pair<int, int>> {};
INSTANTIATE_TEST_SUITE_P(TopView, UsualWindows,
                         testing::Values(std::pair{80, 24}, std::pair{60, 20}, std::pair{120, 40}));

TEST_P(UsualWindows, ShowEverythingOfOneHandAndItsPhysics) {
  const auto [width, height] = GetParam();
  const std::string text = screen(snapshot(), width, height);
  for (const char* const each :
       {"haptic0 alive", "rate      999.9 of 1000 Hz", "wake-up   p50 14.0", "jitter", "compute", "proxy age p50 1.00",
        "force     [", "position", "energy", "safety    slew 7", "last cut", "physics alive", "step", "topics"})
    EXPECT_THAT(text, HasSubstr(each));
}

TEST(TopView, UsesTheRoomOfALargeWindow) {
  const std::string small = screen(snapshot(), 80, 24), large = screen(snapshot(), 120, 40);
  EXPECT_THAT(small, Not(HasSubstr("90.000 %")));
  EXPECT_THAT(large, HasSubstr("90.000 %"));  // the share of one bin, on a line of its own
  EXPECT_THAT(large, HasSubstr("granted   SCHED_FIFO 80, core 1, memory locked"));
}

TEST(TopView, NeverCutsAFigureInTwo) {
  // Every figure of the narrow screen stands in the wide one too, and ends at the same place.
  const auto wide = overview_lines(snapshot(), choice(), 0, 24);
  for (int width = 30; width < 100; ++width) {
    const auto narrow = overview_lines(snapshot(), choice(), width, 24);
    const std::string line = narrow[2].text();
    const std::string kept = line.substr(0, line.find(" ~"));
    EXPECT_TRUE(wide[2].text() == kept || wide[2].text().substr(kept.size(), 2) == "  ") << width << ": " << line;
  }
}

TEST(TopView, CountsTheTopicsThatFindNoRoom) {
  const std::string text = screen(snapshot(1, 60), 80, 24);
  std::size_t shown = 0;
  for (std::size_t at = text.find("haptic0.topic_"); at != std::string::npos; at = text.find("haptic0.topic_", at + 1))
    ++shown;
  EXPECT_GT(shown, 0u);
  EXPECT_THAT(text, HasSubstr("+ " + std::to_string(60 - shown) + " more"));
}

TEST(TopView, DropsDetailsBeforeItDropsANode) {
  const std::string text = screen(snapshot(3, 9), 80, 24);
  EXPECT_THAT(text, HasSubstr("haptic2 alive"));
  EXPECT_THAT(text, HasSubstr("physics alive"));
  // Only the chosen one in full.
  EXPECT_THAT(text, HasSubstr("position"));
  EXPECT_EQ(text.find("position"), text.rfind("position"));
}

TEST(TopView, DrawsTheChosenOneOfTwoHandsIn80x24) {
  auto chosen = choice();
  chosen.node = "haptic1";
  const std::string text = joined(overview_lines(snapshot(2, 16), chosen, 80, 24));
  EXPECT_THAT(text, HasSubstr("jitter"));
  EXPECT_GT(text.find("jitter"), text.find("haptic1 alive"));
}

TEST(TopView, GivesTheRoomToTheChosenNode) {
  auto chosen = choice();
  chosen.node = "haptic2";
  const std::string text = joined(overview_lines(snapshot(3, 9), chosen, 80, 24));
  EXPECT_THAT(text, HasSubstr("position"));
  EXPECT_GT(text.find("position"), text.find("haptic2 alive"));
  chosen.node = "gone";
  EXPECT_LT(joined(overview_lines(snapshot(3, 9), chosen, 80, 24)).find("position"), text.find("haptic2 alive"));
}

TEST(TopView, DrawsTheForceAgainstTheLimitWithThePeakAsAMark) {
  EXPECT_THAT(all(snapshot()), HasSubstr("[##########....|.....] now 4.00 of 8.0 N"));
  EXPECT_EQ(tone_at(overview_lines(snapshot(), choice(), 80, 24), "now 4.00"), Tone::kGood);
  auto hot = snapshot();
  hot.haptic[0].force_n = 7.9;
  EXPECT_EQ(tone_at(overview_lines(hot, choice(), 80, 24), "now 7.90"), Tone::kBad);
}

TEST(TopView, SurvivesForcesThatAreNoNumbers) {
  auto of = snapshot();
  of.haptic[0].force_n = std::numeric_limits<double>::quiet_NaN();
  of.haptic[0].recent->force_n = {1.0, std::numeric_limits<double>::infinity(), 2.0};
  EXPECT_THAT(all(of), HasSubstr("[##############|#####]"));  // full: nothing may look harmless that is unknown
  EXPECT_EQ(tone_at(overview_lines(of, choice(), 80, 24), "now nan"), Tone::kBad);
  of.haptic[0].force_n = 1e300;
  of.haptic[0].stats->force_peak_n = std::numeric_limits<double>::infinity();
  EXPECT_THAT(all(of), HasSubstr("###|] now 1e+300 of 8.0 N  peak inf"));
  of.haptic[0].info->force_limit_n = 0.0;
  EXPECT_THAT(all(of), HasSubstr("[....................]"));
}

TEST(TopView, MakesASingleLateTickAmongTenThousandVisible) {
  auto of = snapshot();
  const auto lines = overview_lines(of, choice(), 80, 24);
  EXPECT_EQ(tone_at(lines, "_ "), Tone::kWarn);  // the single wake-up beyond half a millisecond
  of.haptic[0].recent->jitter = {0, 10'000, 0, 0, 0, 0, 0, 0, 0, 0};
  EXPECT_EQ(tone_at(overview_lines(of, choice(), 80, 24), "_ "), std::nullopt);
}

TEST(TopView, NamesOnlyTheSafetyRungsThatActed) {
  const std::string text = all(snapshot());
  EXPECT_THAT(text, HasSubstr("slew 7"));
  EXPECT_THAT(text, Not(HasSubstr("overspeed")));
  auto calm = snapshot();
  calm.haptic[0].stats->slew_limited = 0;
  EXPECT_THAT(all(calm), HasSubstr("nothing acted"));
}

TEST(TopView, SaysWhenAndWhyTheForceWasCut) {
  auto of = snapshot();
  EXPECT_THAT(all(of), HasSubstr("last cut  none since this monitor looks"));
  of.haptic[0].recent->cut = tools::CutView{haptic::kOverspeed, 3.25, 0.1, false};
  EXPECT_THAT(all(of), HasSubstr("last cut  overspeed  3.2 s ago, for 0.100 s"));
  of.haptic[0].recent->cut = tools::CutView{haptic::kStale | haptic::kDeviceLost, 0.5, 0.5, true};
  EXPECT_THAT(all(of), HasSubstr("last cut  device lost, physics lost or silent  NOW, for 0.5 s"));
  of.haptic[0].recent.reset();
  EXPECT_THAT(all(of), HasSubstr("last cut  not followed"));
  of.haptic[0].loss_age_s = 12.0;  // known from the statistics, also without telemetry
  EXPECT_THAT(all(of), HasSubstr("last cut  physics lost  12 s ago"));
}

TEST(TopView, SaysWhichButtonsArePressedAndWhetherForcesAct) {
  EXPECT_THAT(all(snapshot()), HasSubstr("buttons 0 2"));
  EXPECT_THAT(all(snapshot()), HasSubstr("forces on"));
  auto off = snapshot();
  off.haptic[0].device->enabled = 0;
  EXPECT_THAT(all(off), HasSubstr("forces OFF"));
}

TEST(TopView, WarnsOfEnergyThatWasMade) {
  auto of = snapshot();
  of.haptic[0].stats->energy_absorbed_j = -0.5;
  EXPECT_EQ(tone_at(overview_lines(of, choice(), 0, 0), "MADE 0.5 J"), Tone::kWarn);
}

TEST(TopView, SaysWhetherPhysicsKeepsItsRate) {
  auto of = snapshot();
  EXPECT_THAT(all(of), HasSubstr("kept 18.0 of 18 Hz"));
  of.physics[0].stats->achieved_hz = 9.0;
  EXPECT_THAT(all(of), HasSubstr("TOO SLOW 9.0 of 18 Hz"));
  of.physics[0].stats->steps = 100;
  of.physics[0].stats->step_p50_ms = 60.0;
  EXPECT_THAT(all(of), HasSubstr("TOO SLOW 9.0 of 18 Hz"));
  of.physics[0].stats->step_p50_ms = 1.0;
  EXPECT_THAT(all(of), HasSubstr("BEHIND, the machine is busy: 9.0 of 18 Hz"));
}

TEST(TopView, SaysEStopAndHowToReArmAlsoWithoutTelemetry) {
  auto of = snapshot();
  EXPECT_THAT(all(of), Not(HasSubstr("E-STOP")));
  EXPECT_TRUE(tools::top_json(of)["haptic"][0]["estop"].is_null());
  of.haptic[0].estop = "rtbus estop";
  of.haptic[0].device->enabled = 0;
  of.haptic[0].recent.reset();
  EXPECT_THAT(all(of), HasSubstr("haptic0 alive  E-STOP, re-arm with R or rtbus estop --rearm"));
  EXPECT_THAT(all(of), HasSubstr("forces OFF: E-STOP"));
  EXPECT_THAT(all(of), HasSubstr("last cut  E-STOP (rtbus estop), zero force until re-armed"));
  EXPECT_THAT(screen(of, 60, 20), HasSubstr("E-STOP, re-arm with R"));
  EXPECT_EQ(tools::top_json(of)["haptic"][0]["estop"], "rtbus estop");
}

TEST(TopView, CountsPausesOfTheLoop) {
  auto of = snapshot();
  EXPECT_THAT(all(of), Not(HasSubstr("loop stood")));
  of.haptic[0].stats->pauses = 2;
  EXPECT_THAT(all(of), HasSubstr("loop stood 2 x"));
  EXPECT_EQ(tools::top_json(of)["haptic"][0]["safety"]["pauses"], 2);
}

TEST(TopView, CountsRestarts) {
  EXPECT_THAT(all(snapshot()), Not(HasSubstr("restarts")));
  auto of = snapshot();
  of.haptic[0].life.restarts = 2;
  EXPECT_THAT(all(of), HasSubstr("restarts 2, last 00:01:00 ago"));
}

TEST(TopView, ShowsANodeThatHasToldNothingYet) {
  auto of = snapshot(0);
  tools::HapticView fresh;
  fresh.name = "haptic0";
  fresh.life.writer_alive = true;
  of.haptic.push_back(fresh);
  EXPECT_THAT(screen(of, 80, 24), HasSubstr("haptic0 starting"));
}

TEST(TopView, TellsWhatToDoWhenNothingRuns) {
  tools::TopSnapshot nothing;
  nothing.message = "no session is running";
  EXPECT_THAT(screen(nothing, 80, 24), HasSubstr("no session is running"));
  EXPECT_THAT(screen(nothing, 80, 24), HasSubstr("rtbus run wall"));
  EXPECT_THAT(screen(nothing, 12, 24), HasSubstr("\nno session\nis running\n"));
}

TEST(TopView, OffersTheLiveSessionsByNumber) {
  tools::TopSnapshot several;
  several.message = "several";
  several.sessions = {"left", "right"};
  EXPECT_THAT(screen(several, 80, 24), HasSubstr("2  right"));
}

TEST(TopView, ShowsUnitsAsChosen) {
  EXPECT_THAT(all(snapshot()), HasSubstr("x +12.3  y -2.0  z +0.0 mm"));
  auto chosen = choice();
  chosen.si = true;
  const std::string text = joined(overview_lines(snapshot(), chosen, 0, 0));
  EXPECT_THAT(text, HasSubstr("x +0.0123  y -0.0020  z +0.0000 m"));
  EXPECT_THAT(text, HasSubstr("wake-up   p50 1.4e-05"));
}

TEST(TopicPage, ShowsTheFieldsOfTheChosenTopicInTheChosenUnits) {
  auto chosen = choice();
  chosen.page = tools::TopPage::kTopics;
  chosen.topic = "haptic0.topic_3";
  const tools::SampleView sample{"haptic0.topic_3",
                                 "rtbus/Something",
                                 "",
                                 12,
                                 0.001,
                                 {{"position_m", "m", {0.0125}}, {"kind", "", {std::string("a")}}}};
  const auto lines = tools::page_lines(snapshot(), sample, chosen, 80, 24);
  EXPECT_EQ(tone_at(lines, "haptic0.topic_3"), Tone::kChosen);
  EXPECT_THAT(joined(lines), testing::ContainsRegex("position_m +12.5 mm\n"));
  chosen.si = true;
  EXPECT_THAT(joined(tools::page_lines(snapshot(), sample, chosen, 80, 24)),
              testing::ContainsRegex("position_m +0.0125 m\n"));
}

TEST(TopicPage, FollowsTheChosenTopicThroughALongList) {
  auto chosen = choice();
  chosen.topic = "haptic0.topic_57";
  EXPECT_THAT(joined(tools::topic_lines(snapshot(1, 60), std::nullopt, chosen, 80, 24)), HasSubstr("haptic0.topic_57"));
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

TEST(TopLink, ShowsTheLinkOfAUsbDeviceAndOnlyOfOne) {
  auto of = snapshot();
  EXPECT_FALSE(tools::top_json(of)["haptic"][0].contains("link"));
  EXPECT_THAT(screen(of, 120, 40), Not(HasSubstr("  link  ")));
  auto& link = of.haptic[0].link.emplace();
  link.state = static_cast<std::uint32_t>(rtbus::LinkState::kNotReady);
  link.exchanges = 60'024;
  link.silences = 3;
  link.sample_to_wire_p99_us = 29.0;
  const auto json = tools::top_json(of)["haptic"][0]["link"];
  EXPECT_EQ(json["state"], "not homed");
  EXPECT_EQ(json["exchanges"], 60'024);
  EXPECT_EQ(json["sample_to_wire_us"]["p99"], 29.0);
  EXPECT_THAT(screen(of, 120, 40), HasSubstr("link  not homed  exchanges 60024  unanswered 3"));
}

TEST(TopJson, CarriesTheFiguresUnderTheNamesOfTheReport) {
  auto of = snapshot();
  of.haptic[0].recent->cut = tools::CutView{haptic::kOverspeed, 3.25, 0.1, false};
  const auto json = tools::top_json(of);
  EXPECT_EQ(json["schema"], "rtbus-top/1");
  EXPECT_EQ(json["haptic"][0]["overruns"], 11);
  EXPECT_EQ(json["haptic"][0]["wakeup_latency_us"]["max"], 12'345.6);
  EXPECT_EQ(json["haptic"][0]["force_n"]["now"], 4.0);
  EXPECT_EQ(json["haptic"][0]["life"]["alive"], true);
  EXPECT_EQ(json["haptic"][0]["recent"]["jitter"]["ticks"].size(),
            json["haptic"][0]["recent"]["jitter"]["upper_edge_us"].size() + 1);
  EXPECT_EQ(json["haptic"][0]["recent"]["last_cut"]["why"], "overspeed");
  EXPECT_EQ(json["physics"][0]["rate_asked_hz"], 18.0);
  EXPECT_EQ(json["topics"].size(), 9u);
}

}  // namespace
