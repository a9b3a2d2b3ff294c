#include "physics_node/frame_publisher.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <string>
#include <vector>

#include "physics_node/engine_registry.hpp"
#include "rtbus/clock.hpp"

namespace physics {
namespace {

using rtbus::BodyPoses;

constexpr std::size_t kBodies = 150;  // more than two samples

Stepper many_bodies() {
  rtbus::config::Scene scene;
  for (std::size_t i = 0; i < kBodies; ++i) {
    rtbus::config::Body body;
    body.name = "ball" + std::to_string(i);
    body.shape = rtbus::shapes::Sphere{0.001};
    body.p_WB = {static_cast<double>(i), 0.0, -1.0};
    scene.bodies.push_back(body);
  }
  return Stepper(make_world("analytic", scene), {}, 1);
}

class PosePublisherTest : public ::testing::Test {
 protected:
  void SetUp() override {
    static int count = 0;
    session_.name = "poses-" + std::to_string(::getpid()) + "-" + std::to_string(++count);
    auto created = PosePublisher::create(session_, kBodies);
    ASSERT_TRUE(created.has_value());
    poses_ = std::move(*created);
  }
  rtbus::Session session_;
  std::unique_ptr<PosePublisher> poses_;
  Stepper stepper_ = many_bodies();
};

TEST_F(PosePublisherTest, PublishesNothingWhileNobodyLooks) {
  auto reader = rtbus::Reader<BodyPoses>::open(session_, "physics.body_poses");  // reads, but does not ask
  ASSERT_TRUE(reader.has_value());
  for (std::uint64_t i = 1; i <= 10; ++i) {
    poses_->maintain();
    poses_->publish_if_due(stepper_, i * rtbus::kNsPerS);
  }
  rtbus::Stamped<BodyPoses> sample;
  EXPECT_EQ(reader->read_latest(sample), rtbus::ReadStatus::kSame);
  EXPECT_FALSE(poses_->observed());
}

TEST_F(PosePublisherTest, CutsAFrameIntoSamplesAndKeepsTheRate) {
  auto reader = rtbus::Reader<BodyPoses>::open(session_, "physics.body_poses", {.presence = true});
  ASSERT_TRUE(reader.has_value());
  poses_->maintain();
  EXPECT_TRUE(poses_->observed());
  constexpr std::uint64_t kStep_ns = rtbus::kNsPerMs;
  for (std::uint64_t i = 0; i < 67; ++i) poses_->publish_if_due(stepper_, rtbus::kNsPerS + i * kStep_ns);

  // 67 ms hold the frames at 0 ms and, a whole period later each, 34 ms; the next would be due at 68 ms.
  rtbus::Stamped<BodyPoses> sample;
  std::vector<BodyPoses> seen;
  while (reader->read_next(sample) == rtbus::ReadStatus::kFresh) seen.push_back(sample.value);
  ASSERT_EQ(seen.size(), 6u);
  std::size_t body = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(seen[i].frame, 1u);
    EXPECT_EQ(seen[i + 3].frame, 2u);
    EXPECT_EQ(seen[i].bodies, kBodies);
    EXPECT_EQ(seen[i].first_body, body);
    for (std::uint32_t k = 0; k < seen[i].count; ++k, ++body) {
      EXPECT_EQ(seen[i].position_m[k][0], static_cast<double>(body));
      EXPECT_EQ(seen[i].orientation_wxyz[k][0], 1.0);
    }
  }
  EXPECT_EQ(body, kBodies);
  EXPECT_EQ(seen[2].count, kBodies - 2 * BodyPoses::kBodies);
  EXPECT_EQ(seen[2].position_m[seen[2].count][0], 0.0);
}

TEST_F(PosePublisherTest, StopsWhenTheObserverLeaves) {
  {
    auto reader = rtbus::Reader<BodyPoses>::open(session_, "physics.body_poses", {.presence = true});
    ASSERT_TRUE(reader.has_value());
    poses_->maintain();
    EXPECT_TRUE(poses_->observed());
  }
  poses_->maintain();
  EXPECT_FALSE(poses_->observed());
}

}  // namespace
}  // namespace physics
