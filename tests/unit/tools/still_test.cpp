#include "tools/cli/still/still.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <string>
#include <vector>

#include "rtbus/topic.hpp"
#include "tools/cli/common/run_program.hpp"
#include "tools/cli/still/still_scene.hpp"

namespace tools {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;

rtbus::config::Scene two_boxes() {
  rtbus::config::Scene scene;
  scene.name = "two_boxes";
  for (const double x : {-0.02, 0.02}) {
    rtbus::config::Body body;
    body.type = rtbus::config::BodyType::kDynamic;
    body.shape = rtbus::shapes::Box{Eigen::Vector3d::Constant(0.01)};
    body.p_WB = {x, 0.01, 0.0};
    scene.bodies.push_back(body);
  }
  rtbus::config::Body floor;
  floor.shape = rtbus::shapes::Plane{};
  scene.bodies.push_back(floor);
  return scene;
}

StillFrame pushed(const rtbus::config::Scene& scene) {
  StillFrame frame = frame_of(scene);
  frame.poses[1].position_m.z() -= 0.015;
  frame.hands.push_back({"haptic0", 0.004, {0.02, 0.01, 0.0}, {0.02, 0.01, -0.003}, {0.0, 0.0, 1.5}});
  return frame;
}

TEST(StillCamera, HasAllPointsInItsPictureAndLooksWhereItShould) {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 8; ++i) points.emplace_back(i & 1 ? 0.3 : 0.1, i & 2 ? 0.2 : 0.0, i & 4 ? 0.5 : -0.4);
  const Camera camera = fit_camera(points, {}, 1600, 1000);
  double left = 1e9, right = 0.0, bottom = 1e9, top = 0.0;
  for (const Eigen::Vector3d& p : points) {
    const Eigen::Vector2d seen = camera.project(p);
    left = std::min(left, seen.x()), right = std::max(right, seen.x());
    bottom = std::min(bottom, seen.y()), top = std::max(top, seen.y());
  }
  EXPECT_GT(left, 0.06 * 1600);
  EXPECT_LT(right, 0.94 * 1600);
  EXPECT_GT(bottom, 0.17 * 1000);
  EXPECT_LT(top, 0.88 * 1000);
  EXPECT_TRUE(right - left > 0.75 * 1600 || top - bottom > 0.6 * 1000) << "too far away";
  EXPECT_TRUE(camera.project(camera.look_at_m).isApprox(Eigen::Vector2d(800, 500)));
  // Right-handed, seen from +z: +x is to the right, +y up.
  EXPECT_GT(camera.project({0.3, 0.0, 0.0}).x(), camera.project({0.1, 0.0, 0.0}).x());
  EXPECT_GT(camera.project({0.1, 0.2, 0.0}).y(), camera.project({0.1, 0.0, 0.0}).y());
}

TEST(StillLayout, RoundsUpToOneTwoOrFive) {
  EXPECT_DOUBLE_EQ(round_up_nicely(0.0131), 0.02);
  EXPECT_DOUBLE_EQ(round_up_nicely(0.02), 0.02);
  EXPECT_DOUBLE_EQ(round_up_nicely(3.0), 5.0);
  EXPECT_DOUBLE_EQ(round_up_nicely(5.1), 10.0);
}

TEST(StillLayout, ScalesArrowAndColoursToTheFrames) {
  const rtbus::config::Scene scene = two_boxes();
  const std::vector<StillFrame> frames{frame_of(scene), pushed(scene)};
  const StillLayout layout = lay_out(scene, frames, {}, 800, 500);
  EXPECT_DOUBLE_EQ(layout.moved_max_m, 0.02);  // the larger of two ways, 15 mm, rounded up
  const StillHand& hand = frames[1].hands[0];
  const double arrow_m = (arrow_tip(hand, layout) - hand.proxy_m).norm();
  EXPECT_NEAR(arrow_m, 1.5 / layout.n_per_cm * 0.01, 1e-12);
  EXPECT_GT(arrow_m, 0.2 * layout.radius_m);
  EXPECT_LT(arrow_m, 0.7 * layout.radius_m);
}

TEST(StillScene, SharesAShapeAndPlacesEachBody) {
  const rtbus::config::Scene scene = two_boxes();
  const std::vector<StillFrame> frames{pushed(scene)};
  const std::string text = pov_text(scene, frames[0], lay_out(scene, frames, {}, 800, 500));
  EXPECT_THAT(text, HasSubstr("#declare S0 = mesh"));
  EXPECT_THAT(text, HasSubstr("#declare S1 = plane"));
  EXPECT_THAT(text, Not(HasSubstr("#declare S2")));
  std::size_t boxes = 0;
  for (std::size_t at = text.find("object { S0"); at != std::string::npos; at = text.find("object { S0", at + 1))
    ++boxes;
  EXPECT_EQ(boxes, 2u);
  EXPECT_THAT(text, HasSubstr("cone {"));  // the arrow
}

TEST(BodyPoseReader, WaitsForCompleteFrames) {
  rtbus::Session session;
  session.name = "still-" + std::to_string(::getpid());
  auto writer = rtbus::Writer<rtbus::BodyPoses>::create(session, "physics.body_poses", {.capacity = 16});
  ASSERT_TRUE(writer.has_value());
  auto reader = BodyPoseReader::open(session);
  ASSERT_TRUE(reader.has_value());
  EXPECT_TRUE(writer->observed());
  rtbus::BodyPoses part;
  part.bodies = 65;
  const auto publish = [&](std::uint64_t frame, std::uint32_t first, std::uint32_t count, double x) {
    part.frame = frame, part.first_body = first, part.count = count;
    part.position_m[0][0] = x;
    writer->publish(part, 1);
  };
  publish(1, 64, 1, 1.0);  // the second half of a frame whose first was never seen
  EXPECT_FALSE(reader->drain());
  publish(2, 0, 64, 2.0);
  EXPECT_FALSE(reader->drain());
  publish(3, 64, 1, 3.0);  // the halves do not belong together
  EXPECT_FALSE(reader->drain());
  publish(4, 0, 64, 4.0);
  publish(4, 64, 1, 5.0);
  ASSERT_TRUE(reader->drain());
  ASSERT_EQ(reader->poses().size(), 65u);
  EXPECT_EQ(reader->poses()[0].position_m.x(), 4.0);
  EXPECT_EQ(reader->poses()[64].position_m.x(), 5.0);
}

TEST(Still, DrawsAPngAndLeavesItsSourcesBesideIt) {
  if (run_program("povray", "/", {"--version"}).status != 0) GTEST_SKIP() << "povray is not installed";
  std::string folder = (fs::temp_directory_path() / "still_test_XXXXXX").string();
  ASSERT_NE(::mkdtemp(folder.data()), nullptr);
  const rtbus::config::Scene scene = two_boxes();
  const std::vector<StillFrame> frames{pushed(scene)};
  StillOptions options;
  options.width_px = 320, options.height_px = 200;
  const StillsOutcome drawn = draw_stills(folder, scene, frames, options);
  EXPECT_EQ(drawn.problem, "");
  ASSERT_EQ(drawn.files.size(), 1u);
  std::ifstream in(drawn.files[0], std::ios::binary);
  std::string beginning(8, '\0');
  in.read(beginning.data(), 8);
  EXPECT_EQ(beginning, "\x89PNG\r\n\x1a\n");
  EXPECT_TRUE(fs::exists(fs::path(folder) / "still.pov"));
  EXPECT_TRUE(fs::exists(fs::path(folder) / "still.gp"));
  fs::remove_all(folder);
}

}  // namespace
}  // namespace tools
