// What is wrong with a session is said before anything of it is started.
#include "tools/cli/run/run_plan.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "rtbus/config/document.hpp"
#include "tools/cli/common/command.hpp"

namespace {

const std::string kFreeBlock = std::string(RTBUS_SOURCE_DIR) + "/config/free_block.yaml";

TEST(RunPlan, RefusesASceneThatTheEngineCannotDo) {
  std::string said;
  try {
    (void)tools::make_run_plan(kFreeBlock, {"physics.engine=analytic"}, {});
  } catch (const rtbus::config::Error& error) {
    said = error.what();
  }
  EXPECT_NE(said.find("free_block.yaml:7: scene.bodies.1.type = dynamic: body block moves, which physics.engine = "
                      "analytic cannot do; make it static or write engine: bullet"),
            std::string::npos)
      << said;
}

TEST(RunPlan, LeavesAloneAPhysicsThatNoMethodAsks) {
  EXPECT_NO_THROW((void)tools::make_run_plan(kFreeBlock, {"physics.engine=analytic", "haptic.0.method=direct"}, {}));
}

std::string still_at_0(const std::string& assignment) {
  rtbus::CommandLine line("still", "");
  const tools::Action action = tools::add_still(line.root());
  EXPECT_EQ(line.root().complaint_about(kFreeBlock + " --at 0 --set " + assignment), std::nullopt);
  testing::internal::CaptureStderr();
  EXPECT_EQ(action(), 2);
  return testing::internal::GetCapturedStderr();
}

TEST(Still, OfAFileIsRefusedForWhatRunRefusesIt) {
  EXPECT_NE(still_at_0("haptic.0.device=nope.yaml").find("haptic.0.device = \"nope.yaml\" cannot be read"),
            std::string::npos);
  EXPECT_NE(still_at_0("physics.engine=analytic").find("body block moves"), std::string::npos);
}

}  // namespace
