/// The published outcomes of the drop (He & Choi 2013, Figs 8 to 11), pinned under the simulated clock. Outcomes are
/// settled, oscillating and diverged; settling times are those of the simulated clock, never of a machine.
#include "tools/evaluation/drop/drop.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tools/evaluation/drop/drop_sweeps.hpp"

namespace {

using tools::DropCase;
using tools::DropOptions;
using tools::FallFigures;
using tools::FallTrace;
using tools::Outcome;

DropOptions options(const std::vector<std::string>& assignments = {}) {
  DropOptions out;
  out.session_file = std::string(RTBUS_SOURCE_DIR) + "/config/drop_paper.yaml";
  out.assignments = assignments;
  return out;
}

FallFigures fall(const DropCase& each, double latency_s, double phase_s, const std::vector<std::string>& sets = {}) {
  tools::HarnessOptions link;
  link.latency_s = latency_s;
  link.physics_phase_s = phase_s;
  return judge_fall(fall_in_harness(drop_setup(options(sets), each, 0.5), link), drop_limits(each));
}

class PublishedDrop : public testing::TestWithParam<std::size_t> {};

TEST_P(PublishedDrop, ComesOutAtEveryLatencyAndPhase) {
  const DropCase& each = tools::drop_cases()[GetParam()];
  for (const double latency_s : {0.0, 0.001, 0.002}) {
    for (const double phase_s : {0.0, 0.4e-3, 2.1e-3, 3.9e-3}) {
      const FallFigures figures = fall(each, latency_s, phase_s);
      EXPECT_EQ(figures.outcome, each.outcome) << each.id << ", " << latency_s << " s, " << phase_s << " s";
      if (each.settling_high_s > 0.0) {
        EXPECT_GE(figures.settling_s, each.settling_low_s);
        EXPECT_LE(figures.settling_s, each.settling_high_s);
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Cases, PublishedDrop, testing::Range<std::size_t>(0, 6),
                         [](const auto& row) { return std::string(tools::drop_cases()[row.param].id); });

// What the pinned setting rests on, said aloud: friction, the link's rate, the horizon.
TEST(DropSensitivity, FrictionOf70MillinewtonStillsTheInterpolation) {
  EXPECT_EQ(fall(tools::drop_cases()[1], 0.0, 0.4e-3, {"haptic.0.device.mechanics.coulomb_n=0.07"}).outcome,
            Outcome::kSettled);
}

TEST(DropSensitivity, AtTheLiteral50HzOnlyRemoteCouplingComesToRest) {
  const std::vector<std::string> sets{"haptic.0.link_rate_hz=50"};
  for (const std::size_t i : {1, 2, 4}) {
    EXPECT_EQ(fall(tools::drop_cases()[i], 0.0, 5.2e-3, sets).outcome, Outcome::kDiverged) << i;
  }
  for (const std::size_t i : {3, 5}) {
    EXPECT_EQ(fall(tools::drop_cases()[i], 0.0, 5.2e-3, sets).outcome, Outcome::kSettled) << i;
  }
}

// A hand moves in free air; 50 packets per second, 0.07 kg, 0.85 of critical damping.
TEST(DropSensitivity, TheExplicitServerSpringDivergesWhereTheImplicitOneDoesNot) {
  const auto peak_n = [](const char* form, double stiffness) {
    tools::FallSetup setup;
    setup.session_file = options().session_file;
    setup.duration_s = 4.0;
    setup.assignments = {
        "scene.bodies.wall.position_m=[0, -10, 0]",  // out of the way: the proxy must not be caught by it
        "haptic.0.device={schema: device/1, driver: simulated, model: phantom_desktop, hand: {type: sinusoid, "
        "centre_m: "
        "[0, 0.03, 0], amplitude_m: [0, 0.01, 0], frequency_hz: 1, impedance: firm}}",
        "haptic.0.method=remote_virtual_coupling",
        "haptic.0.link_rate_hz=50",
        "physics.step_on=packet",
        std::string("haptic.0.form=") + form,
        "haptic.0.proxy.stiffness_n_per_m=" + std::to_string(stiffness),
        "haptic.0.proxy.damping_n_s_per_m=" + std::to_string(2.0 * 0.85 * std::sqrt(stiffness * 0.07))};
    double peak = 0.0;
    for (const double force_n : fall_in_harness(setup, {}).rendered_n) peak = std::max(peak, std::abs(force_n));
    return peak;
  };
  EXPECT_LT(peak_n("paper", 100.0), 1.0);
  EXPECT_GT(peak_n("paper", 500.0), 7.9);
  EXPECT_LT(peak_n("improved", 500.0), 1.0);
}

TEST(DropSensitivity, TheImprovedFormSettlesWithEveryMethod) {
  for (const char* method :
       {"direct", "virtual_coupling", "remote_virtual_coupling", "interpolation", "interpolation_predicted"}) {
    for (const double stiffness : {100.0, 500.0}) {
      const DropCase each{"", "", method, stiffness, 1e-4 * stiffness, "", Outcome::kSettled, 0, 0, 4.0};
      EXPECT_EQ(fall(each, 0.0, 0.4e-3,
                     {"haptic.0.form=improved", "haptic.0.link_rate_hz=null", "physics.step_on=clock",
                      "haptic.0.prediction_periods=1"})
                    .outcome,
                Outcome::kSettled)
          << method << ' ' << stiffness;
    }
  }
}

/// Rests at 0.4 N unless changed: released after 0.2 s, at rest from 0.5 s on, 3 s long.
FallTrace trace_of(double (*force_after)(double)) {
  FallTrace trace;
  trace.max_force_n = 7.9;
  for (int i = 0; i < 3000; ++i) {
    const double t = 1e-3 * i;
    trace.time_s.push_back(t);
    trace.height_m.push_back(t < 0.2 ? 0.02 : -0.004);
    trace.force_n.push_back(force_after(t));
    trace.rendered_n.push_back(force_after(t));
    trace.overspeed.push_back(false);
  }
  return trace;
}

TEST(JudgeFall, TellsTheThreeOutcomesApart) {
  const auto rest = judge_fall(trace_of([](double t) { return t < 0.5 ? 2.0 : 0.4; }), {});
  EXPECT_EQ(rest.outcome, Outcome::kSettled);
  EXPECT_NEAR(rest.settling_s, 0.3, 0.002);
  const auto swing = judge_fall(trace_of([](double t) { return 0.4 + std::sin(60.0 * t); }), {});
  EXPECT_EQ(swing.outcome, Outcome::kOscillating);
  EXPECT_NEAR(swing.swing_n, 2.0, 0.01);
  const auto grow = judge_fall(trace_of([](double t) { return std::exp(2.0 * t) * std::sin(60.0 * t); }), {});
  EXPECT_EQ(grow.outcome, Outcome::kDiverged);
  EXPECT_GT(grow.diverged_s, 0.7);  // e^{2t} passes 7.9 at 1.03 s
  EXPECT_LT(grow.diverged_s, 0.95);
}

TEST(JudgeFall, CallsARunawayTipAndAnOverspeedCutDiverged) {
  FallTrace away = trace_of([](double) { return 0.4; });
  away.height_m[1500] = 0.061;
  EXPECT_EQ(judge_fall(away, {}).outcome, Outcome::kDiverged);
  FallTrace cut = trace_of([](double) { return 0.4; });
  cut.overspeed[1500] = true;
  EXPECT_EQ(judge_fall(cut, {}).outcome, Outcome::kDiverged);
}

TEST(JudgeFall, TakesNothingForGrantedOfATipThatWasNeverReleased) {
  FallTrace held = trace_of([](double) { return 0.0; });
  for (double& height : held.height_m) height = 0.02;
  EXPECT_EQ(judge_fall(held, {}).outcome, Outcome::kNoFall);
}

// The safety ladder stays whatever the form: diverging, the hand still gets no more than the device's peak force.
TEST(DropSafety, DivergenceIsClamped) {
  const auto trace = tools::representative_fall(options(), tools::drop_cases()[4]);
  double method_n = 0.0;
  for (std::size_t i = 0; i < trace.force_n.size(); ++i) {
    ASSERT_LE(std::abs(trace.force_n[i]), 7.9 + 1e-9);
    method_n = std::max(method_n, std::abs(trace.rendered_n[i]));
  }
  EXPECT_GT(method_n, 7.9);
}

}  // namespace
