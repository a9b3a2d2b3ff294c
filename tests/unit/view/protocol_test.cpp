// The bytes that docs/viewer-protocol.md promises.
#include "tools/view/protocol.hpp"

#include <gtest/gtest.h>

#include <cstring>

namespace {

using namespace view;

template <class T>
T at(const Message& message, std::size_t offset) {
  T value;
  std::memcpy(&value, message.data() + kMessageRoom + offset, sizeof value);
  return value;
}

/// Two bodies that are sent in the other order, one node, one contact, one hand.
struct Sample {
  ViewScene scene;
  ViewFrame frame;
  Sample() {
    scene.number = 3;
    scene.order = {1, 0};
    scene.soft_nodes = 1;
    frame.number = 7;
    frame.poses_number = 5;
    frame.poses_s = 99.5;
    frame.simulated_s = 12.25;
    frame.poses = {{{1, 2, 3}, Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5)}, {{4, 5, 6}, Eigen::Quaterniond::Identity()}};
    frame.soft_nodes_m.emplace_back(0.001, -0.002, 0.003);
    frame.contacts.push_back({{7, 8, 9}, {0, 1, 0}, -0.5, 0});
    ViewHand hand;
    hand.proxy_m = {0.1, 0.2, 0.3};
    hand.force_n = {1, 0, 0};
    hand.radius_m = 0.005;
    hand.ticks.first = 40;
    add_tick(hand, 99.0, 1.5F);
    add_tick(hand, 99.001, 2.5F);
    frame.hands.push_back(hand);
  }
  static void add_tick(ViewHand& hand, double time_s, float force_n) {
    ViewTick tick;
    tick.time_s = time_s;
    tick.force_n = {force_n, 0, 0};
    tick.safety = 0x201;
    hand.ticks.rows.push_back(tick);
  }
};

TEST(Frame, LiesAsThePageSays) {
  const Sample sample;
  FrameCursor cursor;
  const Message m = encode_frame(sample.scene, sample.frame, 100.0, 9, cursor);
  EXPECT_EQ(std::memcmp(m.data() + kMessageRoom, "RBV1", 4), 0);
  EXPECT_EQ(at<std::uint16_t>(m, 4), kProtocol);
  EXPECT_EQ(at<std::uint16_t>(m, 6), 64);
  EXPECT_EQ(at<std::uint64_t>(m, 8), 9U);
  EXPECT_EQ(at<double>(m, 16), 100.0);
  EXPECT_EQ(at<double>(m, 24), 99.5);
  EXPECT_EQ(at<double>(m, 32), 12.25);
  EXPECT_EQ(at<std::uint32_t>(m, 40), 3U);
  EXPECT_EQ(at<std::uint32_t>(m, 44), 2U);
  EXPECT_EQ(at<std::uint32_t>(m, 48), 1U);
  EXPECT_EQ(at<std::uint32_t>(m, 52), 1U);
  EXPECT_EQ(at<std::uint32_t>(m, 56), 1U);
  EXPECT_EQ(at<float>(m, 64), 4.0F);       // the second body is the first row
  EXPECT_EQ(at<float>(m, 92 + 12), 0.5F);  // w of the other one
  EXPECT_EQ(at<float>(m, 92 + 20), -0.5F);
  EXPECT_EQ(at<std::int32_t>(m, 120 + 4), -2000);
  EXPECT_EQ(at<float>(m, 132 + 24), -0.5F);         // gap
  EXPECT_EQ(at<float>(m, 164), 0.1F);               // proxy
  EXPECT_EQ(at<float>(m, 164 + 48), 0.005F);        // radius
  EXPECT_EQ(at<std::uint32_t>(m, 164 + 52), 2U);    // ticks
  EXPECT_EQ(at<std::uint64_t>(m, 164 + 56), 40U);   // number of the first
  EXPECT_NEAR(at<float>(m, 228), -1.0F, 1e-6F);     // before `now`
  EXPECT_EQ(at<float>(m, 228 + 68 + 4), 2.5F);      // force of the second
  EXPECT_EQ(at<float>(m, 228 + 64), float(0x201));  // bits of the first
  EXPECT_EQ(m.size(), kMessageRoom + 228 + 2 * 68);
}

TEST(Frame, SendsNothingTwice) {
  Sample sample;
  FrameCursor cursor;
  (void)encode_frame(sample.scene, sample.frame, 100.0, 1, cursor);
  Sample::add_tick(sample.frame.hands[0], 99.002, 3.5F);
  const Message m = encode_frame(sample.scene, sample.frame, 100.0, 2, cursor);
  EXPECT_EQ(at<std::uint32_t>(m, 44), 0U);  // no poses: the page has them
  EXPECT_EQ(at<std::uint32_t>(m, 48), 0U);
  EXPECT_EQ(at<std::uint64_t>(m, 96 + 56), 42U);
  EXPECT_EQ(at<std::uint32_t>(m, 96 + 52), 1U);
}

TEST(Frame, CatchesUpInParts) {
  Sample sample;
  for (std::size_t i = 0; i < kTicksPerFrame; ++i) Sample::add_tick(sample.frame.hands[0], 99.0, 0.0F);
  FrameCursor cursor;
  const Message first = encode_frame(sample.scene, sample.frame, 100.0, 1, cursor);
  EXPECT_EQ(at<std::uint32_t>(first, 164 + 52), kTicksPerFrame);
  const Message second = encode_frame(sample.scene, sample.frame, 100.0, 2, cursor);
  EXPECT_EQ(at<std::uint32_t>(second, 96 + 52), 2U);
}

TEST(Frame, OfAnotherSceneHasNoPoses) {
  Sample sample;
  sample.frame.poses.pop_back();
  FrameCursor cursor;
  EXPECT_EQ(at<std::uint32_t>(encode_frame(sample.scene, sample.frame, 100.0, 1, cursor), 44), 0U);
}

}  // namespace
