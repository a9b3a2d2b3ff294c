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
  std::vector<std::string> assignments;
  double felt_n;  ///< The hand feels at least this, and answers change it.
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

TEST_P(AnswerJump, IsNoLargerThanASurfaceThatRises) {
  const Row& row = GetParam();
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : row.assignments) overrides.push_back(rtbus::config::parse_override(text));
  overrides.push_back(rtbus::config::parse_override("haptic.0.method=local_contact"));
  overrides.push_back(rtbus::config::parse_override("physics.throttle_hz=" + std::to_string(row.physics_hz)));
  auto session = rtbus::config::load_session(std::string(RTBUS_SOURCE_DIR) + "/config/" + row.file, overrides);
  tools::Harness harness(session, {});
  tools::AnswerJumps jumps(harness.config());
  harness.observe_contacts([&](const rtbus::ProxyContacts& answer) { jumps.tell(answer); });
  double largest_n = 0.0;
  harness.run(row.until_s, [&](const rtbus::Telemetry& tick) {
    jumps.see(tick);
    largest_n = std::max(largest_n, std::hypot(tick.force_n[0], tick.force_n[1], tick.force_n[2]));
  });
  EXPECT_EQ(jumps.others(), 0U) << "what is measured is not what the loop did";
  EXPECT_LE(jumps.largest_n(), kMost_n + 1e-9) << "but for rounding";
  EXPECT_LE(jumps.fastest_n(), kMostLater_n) << "nor does it grow fast in the ticks after it";
  std::printf("change by an answer %.3f N, in a tick after it %.3f N, force %.2f N\n", jumps.largest_n(),
              jumps.fastest_n(), largest_n);
  EXPECT_GE(jumps.changes_n().size(), 5U);
  EXPECT_GT(jumps.largest_n(), 0.0) << "answers are taken";
  EXPECT_GT(largest_n, row.felt_n);
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, AnswerJump,
    testing::Values(Row{"cubes_125_at_18_hz", "stack_125.yaml", 18.0, 3.0, hard_push(0.0, 200), 0.5},
                    Row{"cubes_125_at_18_hz_to_the_right", "stack_125.yaml", 18.0, 3.0, hard_push(5e-3, 200), 0.5},
                    Row{"cubes_125_at_18_hz_to_the_left", "stack_125.yaml", 18.0, 3.0, hard_push(-7e-3, 200), 0.5},
                    Row{"cubes_125_at_18_hz_stiff", "stack_125.yaml", 18.0, 3.0, hard_push(-7e-3, 500), 0.5},
                    Row{"cubes_125_at_43_hz", "stack_125.yaml", 43.0, 3.0, hard_push(0.0, 200), 0.5},
                    Row{"cubes_500_at_18_hz", "stack_500.yaml", 18.0, 2.5, hard_push(0.0, 200), 0.5},
                    Row{"cubes_500_at_43_hz", "stack_500.yaml", 43.0, 2.5, hard_push(0.0, 200), 0.5},
                    Row{"free_block", "free_block.yaml", 18.0, 3.0, {}, 0.2}),
    [](const auto& row) { return std::string(row.param.name); });

}  // namespace

#endif
