// Through the interface of external engines nothing of the force is lost: Bullet behind it, beside Bullet in the node.
#include <cstdio>
#include <utility>

#include <gtest/gtest.h>

#include "tests/support/temporary_file.hpp"
#include "tools/evaluation/bench/external_force.hpp"

namespace {

TEST(ExternalEngine, FreeBlockIsFeltAsWithTheEngineInTheNode) {
  if (!RTBUS_WITH_BULLET) GTEST_SKIP() << "needs Bullet";
  const auto forces = tools::external_forces(RTBUS_SOURCE_DIR "/config/free_block.yaml");
  ASSERT_EQ(forces.size(), 6U) << "two methods at 18, 43 and 100 Hz";
  for (const tools::ExternalForce& force : forces) {
    std::printf("%s, %g Hz: force error %.2f mN RMS in the node, %.2f mN outside\n", force.method.c_str(),
                force.rate_hz, 1e3 * force.inside_n, 1e3 * force.outside_n);
    EXPECT_GT(force.inside_n, 0.0);
    EXPECT_LE(force.outside_n, force.most_n()) << force.method << ' ' << force.rate_hz;
  }
}

TEST(ExternalEngine, TheBenchFailsWhenTheForceIsWorseThanItsBar) {
  using tools::Verdict;
  for (const auto& [outside_n, verdict] : {std::pair{0.0449, Verdict::kPass}, std::pair{0.0451, Verdict::kFail}}) {
    const tests::TemporaryFolder folder;
    tools::Experiment experiment("bench", "external", "rtbus bench external", folder.path());
    tools::check_external_forces({{"local_contact", 18.0, 0.040, outside_n}}, experiment);
    EXPECT_EQ(experiment.verdict(), verdict) << outside_n;
  }
  EXPECT_DOUBLE_EQ((tools::ExternalForce{"", 18.0, 0.2, 0.0}.most_n()), 0.21);
}

}  // namespace
