#include "rtbus/why_behind.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace {

using rtbus::why_behind;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

rtbus::StepStats steps(double p50_ms, double p99_ms) {
  rtbus::StepStats out;
  out.rate_hz = 1000.0;
  out.steps = 1000;
  out.step_p50_ms = p50_ms;
  out.step_p99_ms = p99_ms;
  return out;
}

TEST(WhyBehind, BlamesTheMachineWhereStepsFitIntoTheirPeriod) {
  EXPECT_EQ(why_behind(steps(0.35, 0.8), "bullet"),
            "steps take 0.35 ms at the median and fit into 1 ms: the machine was busy with something else");
}

TEST(WhyBehind, NamesTheLongStepsWhereOnlyTheMedianFits) {
  EXPECT_THAT(why_behind(steps(0.35, 3.0), "bullet"),
              AllOf(HasSubstr("fit into 1 ms"), HasSubstr("1 % of them take 3 ms"), HasSubstr("heavy at times"),
                    Not(HasSubstr("lower"))));
}

TEST(WhyBehind, AdvisesASmallerSceneWhereStepsAreTooLong) {
  EXPECT_EQ(why_behind(steps(4.0, 5.0), "bullet"),
            "steps take 4 ms at the median, of 1 ms; lower physics.rate_hz or physics.solver_iterations, or make the "
            "scene smaller");
}

TEST(WhyBehind, AdvisesOnlyWhatTheEngineHas) {
  for (const char* const engine : {"analytic", "mujoco", "external"}) {
    EXPECT_THAT(why_behind(steps(4.0, 5.0), engine),
                AllOf(HasSubstr("lower physics.rate_hz, or make"), Not(HasSubstr("solver_iterations"))));
  }
}

TEST(WhyBehind, KnowsNothingOfStepsBeforeTheFirst) { EXPECT_FALSE(rtbus::steps_fit(rtbus::StepStats{})); }

}  // namespace
