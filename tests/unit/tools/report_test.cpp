#include "tools/cli/run/report.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>

namespace tools {
namespace {

using rtbus::set_text;
using ::testing::HasSubstr;
using ::testing::Not;

RunReport make_report() {
  RunReport report;
  report.config = "config/wall.yaml";
  report.session = "wall";
  report.scene = "wall";
  report.duration_s = 20.0;
  report.wall_s = 20.5;
  report.ended = "duration";
  report.machine.cpu = "a CPU";
  report.machine.cores = 2;

  HapticFigures haptic;
  haptic.name = "haptic0";
  haptic.needs_physics = true;
  set_text(haptic.info.kind, "phantom_desktop");
  set_text(haptic.info.method, "remote_virtual_coupling");
  set_text(haptic.info.clock, "timer");
  set_text(haptic.info.scheduling, "SCHED_FIFO");
  set_text(haptic.info.left_out, "libusb, USB I/O thread, pipe thread");
  haptic.info.rate_hz = 1000.0;
  haptic.stats.ticks = 19990;
  haptic.stats.ticks_due = 20000;
  haptic.stats.overruns = 10;
  haptic.stats.slew_limited = 7;
  haptic.stats.wakeup_p999_us = 123.5;
  haptic.stats.energy_absorbed_j = 0.25;
  haptic.stats.energy_removed_j = 0.125;
  StalenessFigures error;
  error.force_n.add(3.0);
  error.force_n.add(4.0);
  error.position_m.add(0.5);
  haptic.error = error;
  haptic.missed_by_observer = 3;
  haptic.cost.cpu_s = 2.0;
  report.haptic.push_back(haptic);

  BareLoopFigures bare;
  bare.beside = "haptic0";
  bare.scheduling = "SCHED_FIFO";
  bare.ticks = 19995;
  bare.due = 20000;
  bare.overruns = 5;
  report.bare_loop = bare;

  PhysicsFigures physics;
  set_text(physics.info.kind, "analytic");
  set_text(physics.info.left_out, "Bullet");
  physics.stats.steps = 20000;
  physics.stats.achieved_hz = 1000.0;
  physics.stats.simulated_s = 20.0;
  physics.stats.bodies = 1;
  physics.cost.cpu_s = 1.0;
  physics.proxies.push_back({"haptic0", 20000, 15000, {}, {}});
  report.physics = physics;
  report.shm_bytes = 4096;
  report.topics.push_back({"haptic0.telemetry", "rtbus/Telemetry", 240, 20000, 1000.0});
  return report;
}

std::set<std::string> keys_of(const nlohmann::ordered_json& json) {
  std::set<std::string> keys;
  for (const auto& item : json.items()) keys.insert(item.key());
  return keys;
}

void expect_keys(const nlohmann::ordered_json& json, const std::vector<std::string>& wanted) {
  const std::set<std::string> keys = keys_of(json);
  for (const std::string& key : wanted) EXPECT_TRUE(keys.count(key)) << "missing: " << key << " in " << json.dump();
}

TEST(Report, HasEveryKeyOfItsSchema) {
  const auto json = to_json(make_report());
  EXPECT_EQ(json["schema"], "rtbus-report/1");
  expect_keys(json, {"config", "duration_s", "wall_s", "machine", "haptic", "bare_loop", "physics", "bus"});
  expect_keys(json["machine"], {"cpu", "cores", "kernel", "realtime"});
  const auto& haptic = json["haptic"][0];
  expect_keys(haptic, {"name", "device", "method", "clock", "rate_hz", "ticks", "ticks_due", "overruns", "scheduling",
                       "wakeup_latency_us", "compute_us", "proxy_age_ms", "correction_mm", "force_n", "force_error_n",
                       "energy_j", "safety", "missed_by_observer"});
  expect_keys(haptic["wakeup_latency_us"], {"p50", "p99", "p999", "max"});
  expect_keys(haptic["compute_us"], {"p50", "p99", "max"});
  expect_keys(haptic["proxy_age_ms"], {"p50", "p99", "max"});
  expect_keys(haptic["force_n"], {"rms", "peak"});
  expect_keys(haptic["force_error_n"], {"rms", "peak", "reference"});
  expect_keys(haptic["energy_j"], {"absorbed", "removed_by_damper"});
  expect_keys(haptic["safety"], {"clamped", "slew_limited", "stale_ticks", "nonfinite", "overspeed"});
  expect_keys(json["bare_loop"], {"ticks", "due", "overruns", "wakeup_latency_us"});
  expect_keys(json["physics"],
              {"engine", "rate_hz", "steps", "step_ms", "bodies", "left_out", "rss_mib", "cpu_s_per_s"});
  expect_keys(json["bus"], {"shm_bytes", "topics"});
  expect_keys(json["bus"]["topics"][0], {"name", "type", "sample_bytes", "published", "rate_hz"});
}

TEST(Report, CarriesTheFiguresToTheirKeys) {
  const auto json = to_json(make_report());
  const auto& haptic = json["haptic"][0];
  EXPECT_EQ(haptic["device"], "phantom_desktop");
  EXPECT_EQ(haptic["ticks"], 19990);
  EXPECT_EQ(haptic["ticks_due"], 20000);
  EXPECT_EQ(haptic["wakeup_latency_us"]["p999"], 123.5);
  EXPECT_EQ(haptic["energy_j"]["absorbed"], 0.25);
  EXPECT_EQ(haptic["energy_j"]["removed_by_damper"], 0.125);
  EXPECT_EQ(haptic["safety"]["slew_limited"], 7);
  EXPECT_NEAR(haptic["force_error_n"]["rms"].get<double>(), std::sqrt(12.5), 1e-12);
  EXPECT_EQ(haptic["force_error_n"]["peak"], 4.0);
  EXPECT_NEAR(haptic["cpu_s_per_s"].get<double>(), 0.1, 1e-12);
  EXPECT_NEAR(json["physics"]["cpu_s_per_simulated_s"].get<double>(), 0.05, 1e-12);
  EXPECT_EQ(haptic["left_out"], (nlohmann::ordered_json{"libusb", "USB I/O thread", "pipe thread"}));
}

TEST(Report, RepeatsTheWarningsOfTheNodes) {
  RunReport report = make_report();
  EXPECT_EQ(to_json(report)["warnings"], nlohmann::ordered_json::array());
  report.warnings = {"haptic0: wall.yaml:12: haptic.0.proxy.mass_kg = 50 is more than the hand moves"};
  EXPECT_EQ(to_json(report)["warnings"][0], report.warnings[0]);
  EXPECT_NE(to_text(report).find("WARNING: " + report.warnings[0] + "\n"), std::string::npos);
}

TEST(Report, SaysWhyThereIsNoForceError) {
  RunReport report = make_report();
  report.haptic[0].error.reset();
  auto json = to_json(report);
  EXPECT_TRUE(json["haptic"][0]["force_error_n"]["rms"].is_null());
  EXPECT_THAT(json["haptic"][0]["force_error_n"]["reason"].get<std::string>(), HasSubstr("too short"));
  report.haptic[0].needs_physics = false;
  json = to_json(report);
  EXPECT_THAT(json["haptic"][0]["force_error_n"]["reason"].get<std::string>(), HasSubstr("never stale"));
  EXPECT_TRUE(json["haptic"][0]["proxy_age_ms"]["p50"].is_null());
}

TEST(Report, SaysByHowMuchAnswersMovedWhatWasTouched) {
  RunReport report = make_report();
  report.haptic[0].stats.corrections = 0;
  EXPECT_TRUE(to_json(report)["haptic"][0]["correction_mm"].is_null());
  EXPECT_THAT(to_text(report), testing::Not(HasSubstr("  correction ")));
  report.haptic[0].stats.corrections = 40;
  report.haptic[0].stats.correction_mean_mm = 0.012;
  report.haptic[0].stats.correction_max_mm = 0.3;
  const auto json = to_json(report)["haptic"][0]["correction_mm"];
  EXPECT_EQ(json["mean"], 0.012);
  EXPECT_EQ(json["max"], 0.3);
  EXPECT_EQ(json["answers"], 40);
  EXPECT_THAT(to_text(report), HasSubstr("correction    mean 0.012, max 0.3 mm in 40 answers while touching"));
}

TEST(Report, CarriesTheLinkOfAUsbDevice) {
  RunReport report = make_report();
  EXPECT_TRUE(to_json(report)["haptic"][0]["link"].is_null());
  EXPECT_THAT(to_text(report), testing::Not(HasSubstr("  link ")));
  auto& link = report.haptic[0].link.emplace();
  link.exchanges = 60'024;
  link.silences = 3;
  link.withheld = 2;
  link.sample_to_wire_p99_us = 29.0;
  const auto json = to_json(report)["haptic"][0]["link"];
  EXPECT_EQ(json["exchanges"], 60'024);
  EXPECT_EQ(json["silences"], 3);
  EXPECT_EQ(json["withheld"], 2);
  EXPECT_EQ(json["sample_to_wire_us"]["p99"], 29.0);
  EXPECT_THAT(to_text(report), HasSubstr("60024 exchanges, 3 without answer"));
}

TEST(Report, WritesNullForWhatIsNotThere) {
  RunReport report = make_report();
  report.bare_loop.reset();
  report.physics.reset();
  report.duration_s = 0.0;
  report.haptic[0].stats.force_rms_n = std::numeric_limits<double>::quiet_NaN();
  const auto json = to_json(report);
  EXPECT_TRUE(json["bare_loop"].is_null());
  EXPECT_TRUE(json["physics"].is_null());
  EXPECT_TRUE(json["haptic"][0]["force_n"]["rms"].is_null());
  EXPECT_TRUE(json["haptic"][0]["cpu_s_per_s"].is_null());
  EXPECT_THAT(json.dump(), Not(HasSubstr("nan")));
}

TEST(Report, TextShowsTheBareLoopBesideTheHapticLoop) {
  const std::string text = to_text(make_report());
  EXPECT_THAT(text, HasSubstr("haptic loop"));
  EXPECT_THAT(text, HasSubstr("bare loop"));
  EXPECT_THAT(text, HasSubstr("slew limited 7 ticks"));
  EXPECT_THAT(text, Not(HasSubstr("do not compare")));
  EXPECT_THAT(text, HasSubstr("missed 3 of"));
}

TEST(Report, TextWarnsWhenTheTwoLoopsWereNotGrantedTheSame) {
  RunReport report = make_report();
  report.bare_loop->scheduling = "SCHED_OTHER";
  EXPECT_THAT(to_text(report), HasSubstr("do not compare"));
}

TEST(Report, TextNamesTheCauseWherePhysicsLags) {
  RunReport report = make_report();
  rtbus::StepStats& stats = report.physics->stats;
  stats.rate_hz = 1000.0;
  stats.wall_s = 20.0;
  stats.simulated_s = 18.0;
  stats.step_p50_ms = 0.35;
  EXPECT_THAT(to_text(report), HasSubstr("BEHIND        simulated time ran at 90.0 % of real time: steps take 0.35 ms "
                                         "at the median and fit into 1 ms"));
  stats.step_p50_ms = 1.1;
  EXPECT_THAT(to_text(report), HasSubstr("TOO SLOW"));
  EXPECT_THAT(to_text(report), Not(HasSubstr("solver_iterations"))) << "the engine is analytic";
}

TEST(Report, TextTellsOfASecondOutOfBalanceOnlyWhereItMatters) {
  RunReport report = make_report();
  ASSERT_FALSE(report.physics->proxies.empty());
  report.physics->proxies[0].impulse = {1.14, 1.15, 0.05, 6};
  EXPECT_THAT(to_text(report), HasSubstr("1.14 N s on the hand, 1.15 N s on the world, over 6 s of contact\n"));
  report.physics->proxies[0].impulse.worst = 0.367;
  EXPECT_THAT(to_text(report), HasSubstr("in one of these seconds they differ by 36.7 %: normal where"));
}

TEST(Report, TextNamesOnlySafetyCountersThatAreNotZero) {
  RunReport report = make_report();
  report.haptic[0].stats.losses = 1;
  EXPECT_THAT(to_text(report), HasSubstr("slew limited 7 ticks, losses of physics 1\n"));
  report.haptic[0].stats.pauses = 2;
  EXPECT_THAT(to_text(report), HasSubstr("slew limited 7 ticks, losses of physics 1, pauses of the loop 2\n"));
  report.haptic[0].stats = {};
  EXPECT_THAT(to_text(report), HasSubstr("nothing was cut"));
}

}  // namespace
}  // namespace tools
