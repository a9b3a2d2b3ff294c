/// What an answer of physics changes in the force of local_contact at once: the same tick with the answer and without.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "tools/harness/answer_jumps.hpp"
#include "tools/harness/harness.hpp"

#if RTBUS_WITH_BULLET

namespace {

/// A surface that rises at 0.2 m/s under 500 N/m changes the force by so much in 1 ms.
constexpr double kMost_n = 0.1;
/// While that is eased in surfaces come to their places as well, several of them at a time.
constexpr double kMostLater_n = 0.3;

struct Row {
  const char* name;
  const char* file;
  double physics_hz;
  double until_s;
  double aside_m, stiffness_n_per_m;  ///< Of a hard push; 0: the hand of the file.
  double felt_n;                      ///< The hand feels at least this, and answers change it.
  int starts = 3;                     ///< An odd number.
};

void PrintTo(const Row& row, std::ostream* out) { *out << row.name; }

/// From 40 mm before the first cubes to 80 mm behind their faces, at 50 mm/s.
std::vector<std::string> hard_push(double aside_m, double stiffness_n_per_m) {
  return {"haptic.0.device.hand.start_m=[" + std::to_string(aside_m) + ", 0, 0.04]",
          "haptic.0.device.hand.distance_m=0.12", "haptic.0.device.hand.speed_m_s=0.05",
          "haptic.0.device.hand.start_s=0.3",
          "haptic.0.coupling.stiffness_n_per_m=" + std::to_string(stiffness_n_per_m)};
}

class AnswerJump : public testing::TestWithParam<Row> {};

/// The hand comes from up to so far beside where the row says.
constexpr double kAside_m = 0.2e-3;

struct Jumps {
  double by_answer_n = 0.0, later_n = 0.0, felt_n = 0.0;
};

Jumps jumps_of(const Row& row, double aside_m) {
  std::vector<rtbus::config::Override> overrides;
  if (row.stiffness_n_per_m > 0.0) {
    for (const std::string& text : hard_push(row.aside_m + aside_m, row.stiffness_n_per_m)) {
      overrides.push_back(rtbus::config::parse_override(text));
    }
  }
  overrides.push_back(rtbus::config::parse_override("haptic.0.method=local_contact"));
  overrides.push_back(rtbus::config::parse_override("physics.throttle_hz=" + std::to_string(row.physics_hz)));
  auto session = rtbus::config::load_session(std::string(RTBUS_SOURCE_DIR) + "/config/" + row.file, overrides);
  tools::Harness harness(session, {});
  tools::AnswerJumps jumps(harness.config());
  harness.observe_contacts([&](const rtbus::ProxyContacts& answer) { jumps.tell(answer); });
  Jumps out;
  harness.run(row.until_s, [&](const rtbus::Telemetry& tick) {
    jumps.see(tick);
    out.felt_n = std::max(out.felt_n, std::hypot(tick.force_n[0], tick.force_n[1], tick.force_n[2]));
  });
  EXPECT_EQ(jumps.others(), 0U) << "what is measured is not what the loop did";
  EXPECT_GE(jumps.changes_n().size(), 5U);
  out.by_answer_n = jumps.largest_n();
  out.later_n = jumps.fastest_n();
  std::printf("change by an answer %.3f N, in a tick after it %.3f N, force %.2f N\n", out.by_answer_n, out.later_n,
              out.felt_n);
  return out;
}

// What an answer changes, in every run. How far a pile without that answer is from one with it some ticks later hangs
// on rounding: the median of some starts. A stiff hand breaks the pile up, and 10 of 50 starts are over the bar. To the
// right of the middle 2 of 25 are, by up to 0.7 N.
TEST_P(AnswerJump, IsNoLargerThanASurfaceThatRises) {
  const Row& row = GetParam();
  std::vector<double> later_n;
  for (int start = 0; start < row.starts; ++start) {
    const Jumps jumps = jumps_of(row, kAside_m * (2.0 * start / (row.starts - 1) - 1.0));
    EXPECT_LE(jumps.by_answer_n, kMost_n + 1e-9) << "but for rounding";
    EXPECT_GT(jumps.by_answer_n, 0.0) << "answers are taken";
    EXPECT_GT(jumps.felt_n, row.felt_n);
    later_n.push_back(jumps.later_n);
  }
  std::sort(later_n.begin(), later_n.end());
  EXPECT_LE(later_n[later_n.size() / 2], kMostLater_n) << "nor does it grow fast in the ticks after it";
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, AnswerJump,
    testing::Values(Row{"cubes_125_at_18_hz", "stack_125.yaml", 18.0, 3.0, 0.0, 200, 0.5},
                    Row{"cubes_125_at_18_hz_to_the_right", "stack_125.yaml", 18.0, 3.0, 5e-3, 200, 0.5, 7},
                    Row{"cubes_125_at_18_hz_to_the_left", "stack_125.yaml", 18.0, 3.0, -7e-3, 200, 0.5},
                    Row{"cubes_125_at_18_hz_stiff", "stack_125.yaml", 18.0, 3.0, -7e-3, 500, 0.5, 9},
                    Row{"cubes_125_at_43_hz", "stack_125.yaml", 43.0, 3.0, 0.0, 200, 0.5},
                    Row{"cubes_500_at_18_hz", "stack_500.yaml", 18.0, 2.5, 0.0, 200, 0.5},
                    Row{"cubes_500_at_43_hz", "stack_500.yaml", 43.0, 2.5, 0.0, 200, 0.5},
                    Row{"free_block", "free_block.yaml", 18.0, 3.0, 0.0, 0.0, 0.2}),
    [](const auto& row) { return std::string(row.param.name); });

}  // namespace

#endif
