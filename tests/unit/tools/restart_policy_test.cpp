#include "tools/cli/run/restart_policy.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <vector>

#include "rtbus/clock.hpp"

namespace tools {
namespace {

using rtbus::config::SuperviseConfig;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr int exited(int status) { return status << 8; }  // as wait(2) codes it
constexpr int kSegfault = SIGSEGV;
constexpr std::uint64_t at(double seconds) { return static_cast<std::uint64_t>(1e12 + seconds * 1e9); }

TEST(EndKind, TellsACrashFromAWrongConfigurationAndFromAnEndOnRequest) {
  EXPECT_EQ(end_kind(exited(0)), EndKind::kClean);
  EXPECT_EQ(end_kind(exited(1)), EndKind::kCrash);
  EXPECT_EQ(end_kind(exited(2)), EndKind::kUsage);
  EXPECT_EQ(end_kind(exited(127)), EndKind::kUsage);
  EXPECT_EQ(end_kind(kSegfault), EndKind::kCrash);
  EXPECT_EQ(end_kind(SIGKILL), EndKind::kCrash);
}

TEST(RestartPolicy, DoublesTheDelayUpToTheLongest) {
  RestartPolicy policy(SuperviseConfig{.restarts = 100});
  std::vector<double> delays_s;
  for (int i = 0; i < 7; ++i) delays_s.push_back(policy.on_end(kSegfault, at(i), at(i + 0.5)).delay_s);
  EXPECT_THAT(delays_s, ElementsAre(0.25, 0.5, 1.0, 2.0, 4.0, 5.0, 5.0));
}

TEST(RestartPolicy, BeginsAnewAfterAGoodLife) {
  RestartPolicy policy(SuperviseConfig{});
  (void)policy.on_end(kSegfault, at(0), at(1));
  EXPECT_EQ(policy.on_end(kSegfault, at(2), at(3)).delay_s, 0.5);
  EXPECT_EQ(policy.on_end(kSegfault, at(4), at(14.5)).delay_s, 0.25);
  EXPECT_EQ(policy.on_end(kSegfault, at(15), at(16)).delay_s, 0.5);
}

TEST(RestartPolicy, GivesUpAfterTooManyWithinTheWindowAndSaysWhichKey) {
  RestartPolicy policy(SuperviseConfig{.restarts = 3, .window_s = 60.0});
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(policy.on_end(kSegfault, at(10.0 * i), at(10.0 * i + 1)).restart);
  const auto verdict = policy.on_end(kSegfault, at(40), at(41));
  EXPECT_FALSE(verdict.restart);
  EXPECT_THAT(verdict.why_not, HasSubstr("4. time within 60 s"));
  EXPECT_THAT(verdict.why_not, HasSubstr("supervise.restarts = 3"));
}

TEST(RestartPolicy, ForgetsCrashesThatAreOlderThanTheWindow) {
  RestartPolicy policy(SuperviseConfig{.restarts = 1, .window_s = 60.0});
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(policy.on_end(kSegfault, at(100.0 * i), at(100.0 * i + 1)).restart) << i;
  EXPECT_FALSE(policy.on_end(kSegfault, at(402), at(403)).restart);
}

TEST(RestartPolicy, NeverRestartsAWrongConfigurationOrAnEndOnRequest) {
  RestartPolicy policy(SuperviseConfig{});
  EXPECT_FALSE(policy.on_end(exited(2), at(0), at(1)).restart);
  EXPECT_FALSE(policy.on_end(exited(127), at(0), at(1)).restart);
  EXPECT_FALSE(policy.on_end(exited(0), at(0), at(1)).restart);
  EXPECT_EQ(policy.on_end(exited(1), at(0), at(1)).delay_s, 0.25) << "they do not count as crashes either";
}

TEST(RestartPolicy, CanBeSwitchedOff) {
  RestartPolicy policy(SuperviseConfig{.restart = false});
  const auto verdict = policy.on_end(kSegfault, at(0), at(1));
  EXPECT_FALSE(verdict.restart);
  EXPECT_THAT(verdict.why_not, HasSubstr("switched off"));
}

}  // namespace
}  // namespace tools
