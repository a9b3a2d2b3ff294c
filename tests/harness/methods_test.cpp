/// What holds for every method, whoever makes its force: the ladder, new beginnings at zero energy, scales, and what is
/// left out.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "haptic_node/rendering/registry.hpp"
#include "haptic_node/safety.hpp"
#include "tools/cli/run/run_plan.hpp"
#include "tools/harness/harness.hpp"

namespace {

using rtbus::Telemetry;
using tools::Harness;
using tools::HarnessOptions;

std::string config(const char* file) { return std::string(RTBUS_SOURCE_DIR) + "/config/" + file; }
double norm(const rtbus::Vec3& v) { return std::hypot(v[0], v[1], v[2]); }

std::vector<Telemetry> record(const char* file, double duration_s, const std::vector<std::string>& assignments,
                              const HarnessOptions& options = {}) {
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : assignments) overrides.push_back(rtbus::config::parse_override(text));
  auto settings = rtbus::config::load_session(config(file), overrides);
  Harness harness(settings, options);
  std::vector<Telemetry> ticks;
  harness.run(duration_s, [&](const Telemetry& tick) { ticks.push_back(tick); });
  return ticks;
}

/// A method in one of its forms.
struct Law {
  const char* method;
  const char* form;
};
void PrintTo(const Law& law, std::ostream* out) { *out << law.method << ' ' << law.form; }
std::vector<std::string> sets(const Law& law) {
  return {std::string("haptic.0.method=") + law.method, std::string("haptic.0.form=") + law.form,
          "haptic.0.link_rate_hz=200", "haptic.0.prediction_periods=1.3"};
}

class NeedsPhysics : public testing::TestWithParam<Law> {};

TEST_P(NeedsPhysics, FadesAtLossAndReturnsWithoutAKick) {
  HarnessOptions options;
  options.physics_dies_s = 4.0;
  options.physics_returns_s = 6.0;
  auto assignments = sets(GetParam());
  // A hand that leans on the wall: after the loss it stays where it is.
  assignments.push_back(
      "haptic.0.device={schema: device/1, driver: simulated, model: phantom_desktop, hand: {type: push, start_m: [0, "
      "0.01, 0], direction: [0, -1, 0], distance_m: 0.015, speed_m_s: 0.02, start_s: 0.5, impedance: firm}}");
  const auto ticks = record("drop_paper.yaml", 8.0, assignments, options);
  ASSERT_GT(norm(ticks[3900].force_n), 0.1) << "the hand must lean on the wall by then";
  double last_n = 0.0;
  for (std::size_t i = 3999; i < ticks.size(); ++i) {
    const double t = static_cast<double>(i + 1) * 1e-3;
    const double force_n = norm(ticks[i].force_n);
    if (t > 4.1 && t < 6.0) {
      ASSERT_EQ(force_n, 0.0) << t << " s";
    }
    if (t >= 6.0) {
      ASSERT_LT(force_n - last_n, 0.05) << t << " s";
    }
    last_n = force_n;
  }
}

TEST_P(NeedsPhysics, GivesNoForceBeforeAnAnswerToASampleOfThisEnabling) {
  const std::string device =
      "{schema: device/1, driver: simulated, model: phantom_desktop, hand: {type: push, start_m: [0, 0.01, 0], "
      "direction: [0, -1, 0], distance_m: 0.02, speed_m_s: 0.4, start_s: 1.005, impedance: firm, buttons: ["
      "{time_s: 0.0, button: 0, pressed: true}, {time_s: 1.01, button: 0, pressed: false}, "
      "{time_s: 1.09, button: 0, pressed: true}]}}";
  auto assignments = sets(GetParam());
  assignments.insert(assignments.end(),
                     {"haptic.0.device=" + device, "haptic.0.enable_button=0", "haptic.0.link_rate_hz=15"});
  const auto ticks = record("drop_paper.yaml", 1.2, assignments);
  std::uint64_t enabled_ns = 0;
  double peak_n = 0.0;
  for (const Telemetry& tick : ticks) {
    const bool pressed = (tick.buttons & 1u) != 0;
    if (!pressed) enabled_ns = 0;
    if (pressed && enabled_ns == 0) enabled_ns = tick.device_time_ns;
    if (tick.device_time_ns <= ticks.front().device_time_ns + 1'050'000'000ULL || enabled_ns == 0) continue;
    // The newest proxy answers the sample measured proxy_age before now: an older one has no say.
    if (tick.proxy_sequence == 0) peak_n = std::max(peak_n, norm(tick.force_n));
    if (tick.proxy_sequence != 0) {
      EXPECT_GE(tick.device_time_ns - tick.proxy_age_ns, enabled_ns);
    }
  }
  EXPECT_EQ(peak_n, 0.0);
}

TEST_P(NeedsPhysics, FeelsTheSameAtEveryPositionScale) {
  std::vector<double> peak_n;
  for (const double scale : {0.1, 1.0, 5.0}) {
    auto assignments = sets(GetParam());
    assignments.push_back("haptic.0.mapping.position_scale=" + std::to_string(scale));
    assignments.push_back("haptic.0.proxy.mass_kg=" + std::to_string(0.07 / (scale * scale)));
    const auto ticks = record("drop_paper.yaml", 2.0, assignments);
    peak_n.push_back(0.0);
    for (const Telemetry& tick : ticks) peak_n.back() = std::max(peak_n.back(), norm(tick.force_n));
  }
  EXPECT_GT(peak_n[1], 0.5);
  EXPECT_NEAR(peak_n[0], peak_n[1], 1e-5);
  EXPECT_NEAR(peak_n[2], peak_n[1], 1e-5);
}

INSTANTIATE_TEST_SUITE_P(Forms, NeedsPhysics,
                         testing::Values(Law{"remote_virtual_coupling", "improved"},
                                         Law{"remote_virtual_coupling", "paper"}, Law{"interpolation", "improved"},
                                         Law{"interpolation", "paper"}, Law{"interpolation_predicted", "improved"},
                                         Law{"interpolation_predicted", "paper"}, Law{"local_contact", "improved"}),
                         [](const auto& row) { return std::string(row.param.method) + "_" + row.param.form; });

TEST(Forms, RepeatBitForBit) {
  for (const char* method : {"virtual_coupling", "interpolation", "interpolation_predicted"}) {
    for (const char* form : {"improved", "paper"}) {
      std::uint64_t hash[2] = {};
      for (std::uint64_t& each : hash) {
        std::vector<rtbus::config::Override> overrides;
        for (const auto& text : sets({method, form})) overrides.push_back(rtbus::config::parse_override(text));
        auto settings = rtbus::config::load_session(config("drop_paper.yaml"), overrides);
        Harness harness(settings, {});
        harness.run(2.0, {});
        each = harness.hash();
      }
      EXPECT_EQ(hash[0], hash[1]) << method << form;
    }
  }
}

TEST(Forms, ControlTheEnergyUnlessNobodyCanHoldTheDevice) {
  for (const char* form : {"improved", "paper"}) {
    auto settings = rtbus::config::load_session(config("drop_paper.yaml"),
                                                {rtbus::config::parse_override(std::string("haptic.0.form=") + form)});
    const auto haptic = haptic::read_haptic_config(settings, 0);
    ASSERT_TRUE(haptic.device->info().simulated);
    EXPECT_EQ(haptic.safety.passivity.control, std::string(form) == "improved");
  }
}

TEST(LeftOut, NoPhysicsProcessIsStartedThatNoMethodAsksFor) {
  for (const haptic::MethodEntry& law : haptic::registered_methods()) {
    const auto plan = tools::make_run_plan(config("drop_paper.yaml"),
                                           {"haptic.0.method=" + std::string(law.name), "haptic.0.form=improved"});
    const bool physics =
        std::any_of(plan.nodes.begin(), plan.nodes.end(), [](const auto& node) { return node.name == "physics"; });
    EXPECT_EQ(physics, law.needs_physics) << law.name;
    EXPECT_EQ(plan.physics.has_value(), law.needs_physics) << law.name;
  }
}

}  // namespace
