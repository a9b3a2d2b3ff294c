#include "tools/cli/common/choose.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

rtbus::TopicInfo topic(const std::string& session, const std::string& name, bool alive = true) {
  rtbus::TopicInfo info;
  info.session = session;
  info.topic = name;
  info.writer_alive = alive;
  return info;
}

const std::vector<rtbus::TopicInfo> kLab = {topic("lab", "haptic0.device_state"), topic("lab", "haptic0.loop_stats"),
                                            topic("lab", "haptic0.node_info"), topic("lab", "physics.node_info")};

TEST(ChooseSession, TakesTheOnlyLiveOne) {
  const std::vector<rtbus::TopicInfo> topics = {topic("dead", "a.b", false), topic("lab", "a.b")};
  const auto chosen = tools::choose_session(topics, std::nullopt);
  ASSERT_TRUE(chosen.has_value());
  EXPECT_EQ(*chosen, "lab");
}

TEST(ChooseSession, NamesThemAllWhenSeveralAreLive) {
  const std::vector<rtbus::TopicInfo> topics = {topic("lab1", "a.b"), topic("lab2", "a.b"), topic("old", "a.b", false)};
  const auto chosen = tools::choose_session(topics, std::nullopt);
  ASSERT_FALSE(chosen.has_value());
  EXPECT_THAT(chosen.error().message, AllOf(HasSubstr("lab1, lab2"), HasSubstr("--session"), Not(HasSubstr("old"))));
  EXPECT_EQ(chosen.error().exit_status, 2);
}

TEST(ChooseSession, TakesADeadOneOnlyByName) {
  const std::vector<rtbus::TopicInfo> topics = {topic("old", "a.b", false)};
  const auto unnamed = tools::choose_session(topics, std::nullopt);
  ASSERT_FALSE(unnamed.has_value());
  EXPECT_THAT(unnamed.error().message, HasSubstr("rtbus clean"));
  EXPECT_EQ(unnamed.error().exit_status, 1);
  EXPECT_TRUE(tools::choose_session(topics, "old").has_value());
}

TEST(ChooseSession, SaysWhatExistsWhenTheNameIsUnknown) {
  const auto chosen = tools::choose_session(kLab, "lap");
  ASSERT_FALSE(chosen.has_value());
  EXPECT_THAT(chosen.error().message, AllOf(HasSubstr("'lap'"), HasSubstr("lab")));
}

TEST(ChooseSession, RefusesANameThatNoSessionCanHave) {
  const auto chosen = tools::choose_session(kLab, "Lab/1");
  ASSERT_FALSE(chosen.has_value());
  EXPECT_THAT(chosen.error().message, HasSubstr("a-z 0-9"));
}

TEST(ChooseTopic, TakesTheExactNameThoughAnotherBeginsWithIt) {
  const std::vector<rtbus::TopicInfo> topics = {topic("s", "a.force_limit"), topic("s", "a.force")};
  const auto chosen = tools::choose_topic(topics, "a.force");
  ASSERT_TRUE(chosen.has_value());
  EXPECT_EQ(*chosen, "a.force");
}

TEST(ChooseTopic, CompletesAUniqueBeginning) {
  EXPECT_EQ(*tools::choose_topic(kLab, "haptic0.d"), "haptic0.device_state");
}

TEST(ChooseTopic, FindsAUniquePart) { EXPECT_EQ(*tools::choose_topic(kLab, "loop_stats"), "haptic0.loop_stats"); }

TEST(ChooseTopic, ListsThePossibilitiesOfAnAmbiguousPart) {
  const auto chosen = tools::choose_topic(kLab, "node_info");
  ASSERT_FALSE(chosen.has_value());
  EXPECT_THAT(chosen.error().message, HasSubstr("haptic0.node_info, physics.node_info"));
}

TEST(ChooseTopic, SuggestsANearNameWithoutItsNode) {
  const auto chosen = tools::choose_topic(kLab, "loopstats");
  ASSERT_FALSE(chosen.has_value());
  EXPECT_THAT(chosen.error().message,
              AllOf(HasSubstr("did you mean haptic0.loop_stats"), Not(HasSubstr("device_state"))));
}

TEST(ChooseTopic, ListsEverythingWhenNothingIsNear) {
  const auto chosen = tools::choose_topic(kLab, "zzzzzzzz");
  ASSERT_FALSE(chosen.has_value());
  EXPECT_THAT(chosen.error().message, HasSubstr("physics.node_info"));
}

TEST(EditDistance, CountsInsertionsDeletionsAndReplacements) {
  EXPECT_EQ(tools::edit_distance("", "abc"), 3u);
  EXPECT_EQ(tools::edit_distance("kitten", "sitting"), 3u);
  EXPECT_EQ(tools::edit_distance("same", "same"), 0u);
}

}  // namespace
