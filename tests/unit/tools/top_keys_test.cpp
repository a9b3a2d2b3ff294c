#include "tools/cli/top/top_keys.hpp"

#include <gtest/gtest.h>

#include "tests/unit/tools/top_samples.hpp"

namespace {

using Kind = tools::TopKey::Kind;
using tools::TopPage;

class Keys : public testing::Test {
 protected:
  bool press(char character) { return tools::apply_key({Kind::kCharacter, character}, shown_, choice_); }
  bool press(Kind kind) { return tools::apply_key({kind}, shown_, choice_); }
  tools::TopSnapshot shown_ = tests::snapshot(3, 9);
  tools::TopChoice choice_;
};

TEST_F(Keys, QuitFromEveryPage) {
  for (const TopPage page : {TopPage::kOverview, TopPage::kTopics, TopPage::kHelp}) {
    choice_.page = page;
    EXPECT_FALSE(press('q'));
  }
}

TEST_F(Keys, PauseAndGoOn) {
  EXPECT_TRUE(press('p'));
  EXPECT_TRUE(choice_.paused);
  EXPECT_TRUE(press(' '));
  EXPECT_FALSE(choice_.paused);
}

TEST_F(Keys, LeaveTheHelpWithAnyKeyThatThenDoesNothingElse) {
  EXPECT_TRUE(press('?'));
  EXPECT_EQ(choice_.page, TopPage::kHelp);
  EXPECT_TRUE(press('p'));
  EXPECT_EQ(choice_.page, TopPage::kOverview);
  EXPECT_FALSE(choice_.paused);
}

TEST_F(Keys, WalkThroughTheNodesRoundAndRound) {
  EXPECT_TRUE(press(Kind::kNext));
  EXPECT_EQ(choice_.node, "haptic1");
  EXPECT_TRUE(press(Kind::kPrevious));
  EXPECT_TRUE(press(Kind::kPrevious));
  EXPECT_EQ(choice_.node, "haptic2");
  EXPECT_TRUE(press(Kind::kNext));
  EXPECT_EQ(choice_.node, "haptic0");
}

TEST_F(Keys, ChooseATopicAndScrollItsFields) {
  EXPECT_TRUE(press('t'));
  EXPECT_EQ(choice_.page, TopPage::kTopics);
  EXPECT_TRUE(press(Kind::kPageDown));
  EXPECT_GT(choice_.scroll, 0u);
  EXPECT_TRUE(press(Kind::kNext));
  EXPECT_EQ(choice_.topic, "haptic0.topic_1");
  EXPECT_EQ(choice_.scroll, 0u);
  EXPECT_TRUE(press(Kind::kPageUp));
  EXPECT_EQ(choice_.scroll, 0u);
  EXPECT_TRUE(press(Kind::kEscape));
  EXPECT_EQ(choice_.page, TopPage::kOverview);
}

TEST_F(Keys, SurviveASessionWithoutNodes) {
  shown_ = {};
  choice_.page = TopPage::kTopics;
  EXPECT_TRUE(press(Kind::kNext));
  choice_.page = TopPage::kOverview;
  EXPECT_TRUE(press(Kind::kPrevious));
  EXPECT_EQ(choice_.node, "");
}

TEST_F(Keys, PickOneOfSeveralSessionsByItsNumberOnlyWhileNoneIsShown) {
  EXPECT_TRUE(press('1'));
  EXPECT_EQ(choice_.session, "");
  shown_ = {};
  shown_.sessions = {"left", "right"};
  EXPECT_TRUE(press('3'));
  EXPECT_EQ(choice_.session, "");
  EXPECT_TRUE(press('2'));
  EXPECT_EQ(choice_.session, "right");
}

}  // namespace
