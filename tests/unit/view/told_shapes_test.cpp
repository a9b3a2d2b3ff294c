// The world of an external engine, as it tells it on physics.body_shapes.
#include "tools/cli/still/told_shapes.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <numbers>
#include <optional>

#include <string>
#include <vector>

#include "rtbus/clock.hpp"
#include "tools/view/scene_document.hpp"

namespace {

using rtbus::BodyShapes;

class ToldShapes : public testing::Test {
 protected:
  ToldShapes() {
    session_.name = "told-" + std::to_string(::getpid());
    writer_.emplace(*rtbus::Writer<BodyShapes>::create(session_, "physics.body_shapes", {.capacity = 32}));
  }

  /// A table of so many balls, one per body from body 1 on, all of one radius.
  static std::vector<BodyShapes> balls(std::uint32_t count, double radius_m, std::uint64_t epoch) {
    std::vector<BodyShapes> out;
    for (std::uint32_t first = 0; first < count; first += BodyShapes::kShapes) {
      BodyShapes part;
      part.epoch = epoch;
      part.hash = static_cast<std::uint64_t>(1e6 * radius_m);
      part.first_shape = first;
      part.shapes = count;
      part.count = std::min(BodyShapes::kShapes, count - first);
      part.bodies = count + 1;
      for (std::uint32_t i = 0; i < part.count; ++i) {
        part.body[i] = first + i + 1;
        part.body_kind[i] = 2;
        part.shape[i] = static_cast<std::uint32_t>(rtbus::ShapeKind::kSphere);
        part.size_m[i] = {radius_m, 0, 0};
        part.position_m[i] = {0, 0.1, 0};
        part.orientation_wxyz[i] = {1, 0, 0, 0};
      }
      out.push_back(part);
    }
    return out;
  }
  void publish(const std::vector<BodyShapes>& parts) {
    for (const BodyShapes& part : parts) writer_->publish(part, rtbus::monotonic_ns());
  }

  rtbus::Session session_;
  std::optional<rtbus::Writer<BodyShapes>> writer_;
};

TEST_F(ToldShapes, AreTakenByAViewerThatComesLater) {
  publish(balls(100, 0.02, 7));
  tools::ToldShapesReader reader(session_.name);
  ASSERT_TRUE(reader.follow());
  ASSERT_TRUE(reader.told());
  EXPECT_EQ(reader.told()->shown.size(), 100U);
  EXPECT_EQ(reader.told()->bodies, 101U);
  EXPECT_FALSE(reader.follow());

  rtbus::config::Scene scene;
  scene.bodies = reader.told()->shown;
  const view::ViewScene shown = view::make_view_scene(scene, "s", {});
  EXPECT_EQ(shown.document["bodies"][99]["name"], "body 100");
  EXPECT_EQ(shown.document["bodies"][99]["type"], "dynamic");
  EXPECT_EQ(shown.document["shapes"], (nlohmann::ordered_json{{{"kind", "sphere"}, {"radius", 0.02}}}));
}

TEST_F(ToldShapes, ChangeWithTheHashAndNotWithTheEpoch) {
  tools::ToldShapesReader reader(session_.name);
  publish(balls(3, 0.02, 7));
  EXPECT_TRUE(reader.follow());
  publish(balls(3, 0.02, 8));  // the engine was started again
  EXPECT_FALSE(reader.follow());
  publish(balls(2, 0.03, 9));
  EXPECT_TRUE(reader.follow());
  EXPECT_EQ(reader.told()->shown.size(), 2U);
}

TEST_F(ToldShapes, AreTakenWhole) {
  auto parts = balls(100, 0.02, 7);
  tools::ToldShapesReader reader(session_.name);
  publish({parts[0]});
  EXPECT_FALSE(reader.follow());
  EXPECT_FALSE(reader.told());
  publish({balls(100, 0.03, 8)[1]});  // of another table
  EXPECT_FALSE(reader.follow());
  publish(parts);
  EXPECT_TRUE(reader.follow());
}

TEST_F(ToldShapes, LieInTheFrameOfTheirBody) {
  publish(balls(1, 0.02, 7));
  tools::ToldShapesReader reader(session_.name);
  ASSERT_TRUE(reader.follow());
  const Eigen::Quaterniond turned(Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitZ()));
  const auto placed = reader.told()->placed({{}, {{1, 2, 3}, turned}});
  ASSERT_EQ(placed.size(), 1U);
  EXPECT_LT((placed[0].position_m - Eigen::Vector3d(0.9, 2, 3)).norm(), 1e-12);
}

TEST_F(ToldShapes, LeaveOutBodiesThatDoNotExist) {
  auto parts = balls(2, 0.02, 7);
  parts[0].body[1] = 50;
  publish(parts);
  tools::ToldShapesReader reader(session_.name);
  ASSERT_TRUE(reader.follow());
  EXPECT_EQ(reader.told()->shown.size(), 1U);
}

}  // namespace
