// What becomes of messages from ROS 2 before they are orders.
#include "tools/bridge/order_rules.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace {

using bridge::Verdict;

constexpr std::uint64_t kS = rtbus::kNsPerS;
constexpr std::uint64_t kMs = rtbus::kNsPerMs;

TEST(BridgeOwner, IsWhoSpokeFirstUntilHeIsSilent) {
  bridge::Owner owner(1.0);
  EXPECT_TRUE(owner.hears(7, 10 * kS));
  EXPECT_FALSE(owner.hears(8, 10 * kS + 500 * kMs));
  EXPECT_TRUE(owner.hears(7, 10 * kS + 900 * kMs));
  EXPECT_FALSE(owner.lost(11 * kS + 800 * kMs));
  EXPECT_TRUE(owner.lost(12 * kS));
  EXPECT_FALSE(owner.lost(12 * kS)) << "once";
  EXPECT_TRUE(owner.hears(8, 12 * kS));
  EXPECT_FALSE(owner.hears(7, 12 * kS));
}

TEST(BridgeEstop, TrueStopsFromAnybodyAndSilenceOfTheWatcherStopsToo) {
  bridge::EstopRule rule(1.0);
  EXPECT_EQ(rule.hears(false, 1, 10 * kS), Verdict::kNothing);
  EXPECT_EQ(rule.hears(false, 2, 10 * kS), Verdict::kRefused) << "one watches";
  EXPECT_EQ(rule.hears(true, 2, 10 * kS), Verdict::kOrder);
  EXPECT_NEAR(rule.watched_for_s(10 * kS + 400 * kMs), 0.6, 1e-9);
  EXPECT_FALSE(rule.stops_by_silence(11 * kS));
  EXPECT_TRUE(rule.stops_by_silence(13 * kS));
  EXPECT_FALSE(rule.stops_by_silence(20 * kS)) << "nobody watches any more";
}

TEST(BridgeEstop, WhoStopsWatchesOverNothing) {
  bridge::EstopRule rule(1.0);
  EXPECT_EQ(rule.hears(true, 2, 10 * kS), Verdict::kOrder);
  EXPECT_NEAR(rule.watched_for_s(10 * kS), 0.0, 1e-9);
  EXPECT_FALSE(rule.stops_by_silence(20 * kS));
  EXPECT_EQ(rule.hears(false, 1, 20 * kS), Verdict::kNothing) << "the topic is free for a watcher";
}

TEST(BridgeEstop, NobodyTakesOverBeforeTheSilenceIsAnswered) {
  bridge::EstopRule rule(1.0);
  (void)rule.hears(false, 1, 10 * kS);
  EXPECT_EQ(rule.hears(false, 2, 12 * kS), Verdict::kRefused) << "1 is silent, and nobody has said so yet";
  EXPECT_TRUE(rule.stops_by_silence(12 * kS));
  EXPECT_EQ(rule.hears(false, 2, 12 * kS), Verdict::kNothing);
}

TEST(BridgeEnable, OnlyTheStepFromFalseToTrueReArms) {
  bridge::EnableRule rule(0.5);
  EXPECT_EQ(rule.hears(true, 1, 10 * kS), Verdict::kNothing) << "whoever begins with true has not been seen to let go";
  EXPECT_EQ(rule.hears(false, 1, 10 * kS), Verdict::kOrder);
  EXPECT_EQ(rule.hears(false, 1, 10 * kS), Verdict::kNothing);
  EXPECT_EQ(rule.hears(true, 1, 10 * kS), Verdict::kRearm);
  EXPECT_EQ(rule.hears(true, 1, 10 * kS), Verdict::kNothing);
  EXPECT_EQ(rule.hears(false, 2, 10 * kS), Verdict::kRefused);
  EXPECT_EQ(rule.hears(false, 1, 10 * kS), Verdict::kOrder);
}

TEST(BridgeEnable, SilenceStopsAndWhoComesNextBeginsWithFalse) {
  bridge::EnableRule rule(0.5);
  (void)rule.hears(false, 1, 10 * kS);
  EXPECT_EQ(rule.hears(true, 1, 10 * kS), Verdict::kRearm);
  EXPECT_FALSE(rule.stops_by_silence(10 * kS + 400 * kMs));
  EXPECT_TRUE(rule.stops_by_silence(11 * kS));
  EXPECT_EQ(rule.hears(true, 2, 11 * kS), Verdict::kNothing);
  EXPECT_EQ(rule.hears(false, 2, 11 * kS), Verdict::kOrder);
  EXPECT_EQ(rule.hears(true, 2, 11 * kS), Verdict::kRearm);
}

TEST(BridgeEnable, SilenceOfOneWhoHadSwitchedOffStopsNothingMore) {
  bridge::EnableRule rule(0.5);
  (void)rule.hears(false, 1, 10 * kS);
  EXPECT_FALSE(rule.stops_by_silence(12 * kS));
}

TEST(BridgeEnable, ASecondNodeBeginsWithFalseToo) {
  bridge::EnableRule rule(0.5);
  (void)rule.hears(false, 1, 10 * kS);
  EXPECT_EQ(rule.hears(true, 2, 11 * kS), Verdict::kRefused) << "1 is silent, and nobody has said so yet";
  EXPECT_FALSE(rule.stops_by_silence(11 * kS)) << "1 had switched off";
  EXPECT_EQ(rule.hears(true, 2, 11 * kS), Verdict::kNothing);
}

TEST(BridgeEnable, ReArmsAtMostTwiceASecond) {
  bridge::EnableRule rule(0.5);
  (void)rule.hears(false, 1, 10 * kS);
  EXPECT_EQ(rule.hears(true, 1, 10 * kS), Verdict::kRearm);
  EXPECT_EQ(rule.hears(false, 1, 10 * kS + 100 * kMs), Verdict::kOrder);
  EXPECT_EQ(rule.hears(true, 1, 10 * kS + 200 * kMs), Verdict::kRefused);
  EXPECT_NEAR(rule.watched_for_s(10 * kS + 200 * kMs), 0.0, 1e-9) << "he has not been obeyed";
  EXPECT_EQ(rule.hears(true, 1, 10 * kS + 600 * kMs), Verdict::kRearm);
  EXPECT_NEAR(rule.watched_for_s(10 * kS + 700 * kMs), 0.4, 1e-9);
}

TEST(BridgeAdjust, ClampsAndRefusesWhatIsNoNumber) {
  bridge::AdjustRule rule(100.0, 250.0, 1.0);
  EXPECT_EQ(rule.wanted(), std::nullopt);
  EXPECT_EQ(rule.hears(1e9, 1, 10 * kS), Verdict::kOrder);
  EXPECT_EQ(rule.wanted(), 250.0);
  EXPECT_EQ(rule.hears(-1.0, 1, 10 * kS), Verdict::kOrder);
  EXPECT_EQ(rule.wanted(), 100.0);
  EXPECT_EQ(rule.hears(std::numeric_limits<double>::quiet_NaN(), 1, 10 * kS), Verdict::kRefused);
  EXPECT_EQ(rule.hears(200.0, 2, 10 * kS), Verdict::kRefused);
  EXPECT_EQ(rule.wanted(), 100.0);
  rule.end_by_silence(10 * kS + 900 * kMs);
  EXPECT_EQ(rule.wanted(), 100.0);
  rule.end_by_silence(12 * kS);
  EXPECT_EQ(rule.wanted(), std::nullopt);
}

TEST(BridgeHeld, IsTheOwnersNewestAndNoLongerThanHeSpeaks) {
  bridge::HeldRule<bool> rule(0.5);
  EXPECT_EQ(rule.take(), std::nullopt);
  EXPECT_EQ(rule.hears(true, 1, 10 * kS), Verdict::kOrder);
  EXPECT_EQ(rule.hears(false, 2, 10 * kS), Verdict::kRefused);
  EXPECT_EQ(rule.take(), true);
  EXPECT_EQ(rule.take(), std::nullopt) << "once";
  EXPECT_NEAR(rule.holds_for_s(10 * kS + 100 * kMs), 0.4, 1e-9);
  EXPECT_NEAR(rule.holds_for_s(11 * kS), 0.0, 1e-9);
  rule.end_by_silence(11 * kS);
  EXPECT_EQ(rule.hears(false, 2, 11 * kS), Verdict::kOrder);
}

TEST(BridgeMark, ComesAtMostSoOften) {
  bridge::MarkRule rule(5.0);
  EXPECT_EQ(rule.hears(1, 10 * kS), Verdict::kOrder);
  EXPECT_EQ(rule.hears(1, 10 * kS + 100 * kMs), Verdict::kRefused);
  EXPECT_EQ(rule.hears(1, 10 * kS + 200 * kMs), Verdict::kOrder);
  EXPECT_EQ(rule.hears(2, 10 * kS + 900 * kMs), Verdict::kRefused);
}

TEST(BridgeMark, ItsTextIsPrintableAndShort) {
  EXPECT_EQ(bridge::printable("a\nb\x80"), "a?b?");
  EXPECT_EQ(bridge::printable(std::string(1000, 'x').c_str()).size(), 200u);
  EXPECT_EQ(bridge::printable(nullptr), "");
}

}  // namespace
