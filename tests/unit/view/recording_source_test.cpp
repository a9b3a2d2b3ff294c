// A recording as frames: hands, curves and physics steps at an instant.
#if RTBUS_WITH_HDF5
#include "tools/view/recording_source.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "rtbus/clock.hpp"
#include "rtbus/recording/writer.hpp"
#include "rtbus/shape_messages.hpp"
#include "tests/support/recording.hpp"

namespace {

namespace rec = rtbus::recording;

constexpr std::uint64_t kBegan_ns = 5000 * rtbus::kNsPerS;
constexpr int kTicks = 3000;

class Recorded : public testing::Test {
 protected:
  void TearDown() override { std::filesystem::remove(file_); }

  rec::ConfigFile config(const std::string& name) {
    const std::string path = std::string(RTBUS_SOURCE_DIR) + "/config/" + name;
    std::ifstream in(path);
    return {path, {std::istreambuf_iterator<char>(in), {}}};
  }
  /// 3 s of the wall: the hand moves along x, 1 mm in 100 ticks; physics steps every second tick.
  void record(const std::vector<rec::ConfigFile>& files, const rtbus::BodyShapes* told = nullptr,
              const rtbus::BodyPoses* poses = nullptr) {
    rec::Metadata about;
    about.session = "wall";
    about.config = files;
    about.commands = {"haptic_node --config config/wall.yaml --set session=wall"};
    auto writer = rec::Writer::create(file_, about);
    ASSERT_TRUE(writer) << writer.error().message;
    const auto ticks = writer->add_topic("haptic0.telemetry", tests::description_of<rtbus::Telemetry>());
    const auto states = writer->add_topic("haptic0.device_state", tests::description_of<rtbus::DeviceState>());
    const auto answers = writer->add_topic("physics.proxy_state.haptic0", tests::description_of<rtbus::ProxyState>());
    if (told != nullptr) {
      const auto shapes = writer->add_topic("physics.body_shapes", tests::description_of<rtbus::BodyShapes>());
      writer->append(*shapes, 1, kBegan_ns, tests::bytes_of(*told));
    }
    if (poses != nullptr) {
      const auto places = writer->add_topic("physics.body_poses", tests::description_of<rtbus::BodyPoses>());
      writer->append(*places, 1, kBegan_ns + rtbus::kNsPerMs, tests::bytes_of(*poses));
    }
    for (std::uint64_t i = 1; i <= kTicks; ++i) {
      const std::uint64_t stamp_ns = kBegan_ns + i * rtbus::kNsPerMs;
      const double x_m = 1e-5 * static_cast<double>(i);
      if (i % 2 == 0) {
        rtbus::ProxyState answer;
        answer.position_m = {x_m, 0.0, 0.0};
        answer.step_compute_s = i == 1000 ? 5e-3 : 1e-4;
        writer->append(*answers, i / 2, stamp_ns - 1000, tests::bytes_of(answer));
      }
      rtbus::DeviceState state;
      state.target_position_m = state.position_m = {x_m, -0.001, 0.0};
      state.enabled = 1;
      writer->append(*states, i, stamp_ns, tests::bytes_of(state));
      rtbus::Telemetry tick;
      tick.tick = i;
      tick.position_m = {x_m, -0.001, 0.0};
      tick.proxy_sequence = i / 2;
      tick.force_n = {0.0, 1.0, 0.0};
      tick.gate = 1.0;
      writer->append(*ticks, i, stamp_ns, tests::bytes_of(tick));
    }
    writer->mark(kBegan_ns + rtbus::kNsPerS, "hand on");
    ASSERT_TRUE(writer->close());
  }
  std::vector<rec::ConfigFile> wall() {
    return {config("wall.yaml"), config("scenes/wall.yaml"), config("devices/sim_phantom_desktop_drop.yaml"),
            config("devices/sim_phantom_desktop.yaml")};
  }

  std::string file_ = std::string(testing::TempDir()) + "view_recorded" + std::to_string(::getpid()) + ".h5";
};

TEST_F(Recorded, ShowsTheHandAndTheCurvesAtAnInstant) {
  record(wall());
  auto source = view::RecordingSource::open(file_);
  ASSERT_TRUE(source) << source.error();
  EXPECT_EQ((*source)->scene()->document["notes"].size(), 0U) << (*source)->scene()->document["notes"];
  EXPECT_EQ((*source)->scene()->document["bodies"].size(), 1U);
  EXPECT_EQ((*source)->playback_state().json["marks"][0]["text"], "hand on");
  view::Playback& playback = *(*source)->playback();
  EXPECT_NEAR(playback.length_s(), 2.999, 1e-9);

  playback.take({{"at", 1.5}, {"playing", false}}, 1);
  (*source)->follow();
  const view::ViewHand& hand = (*source)->frame().hands.at(0);
  EXPECT_NEAR(hand.device_m.x(), 1.501e-2, 1e-9);
  EXPECT_NEAR(hand.proxy_m.x(), 1.5e-2, 1e-9);
  EXPECT_EQ((*source)->state().json["word"], "NORMAL");
  ASSERT_EQ(hand.ticks.rows.size(), 1501U);
  EXPECT_FLOAT_EQ(hand.ticks.rows[500].step_ms, 0.1F);
  EXPECT_FLOAT_EQ(hand.ticks.rows[999].step_ms, 5.0F) << "the step that tick 1000 used";

  // One tick on is one row more; one back begins anew.
  playback.take({{"step", 1}}, 2);
  (*source)->follow();
  EXPECT_EQ(hand.ticks.end(), 1502U);
  const std::uint32_t jumps = (*source)->frame().jumps;
  playback.take({{"step", -1}}, 3);
  (*source)->follow();
  EXPECT_NE((*source)->frame().jumps, jumps);
  EXPECT_EQ(hand.ticks.rows.size(), 1501U);
}

TEST_F(Recorded, ShowsTheBodiesThatAnEngineTold) {
  rtbus::BodyShapes table;
  table.hash = table.epoch = 1;
  table.bodies = 2;
  table.count = table.shapes = 3;
  for (std::uint32_t i = 0; i < 3; ++i) {
    table.body[i] = i == 0 ? 0 : 1;
    table.shape[i] = static_cast<std::uint32_t>(i == 0 ? rtbus::ShapeKind::kPlane : rtbus::ShapeKind::kSphere);
    table.size_m[i] = {0.01, 0.0, 0.0};
    table.position_m[i] = {0.0, 0.1 * i, 0.0};
    table.orientation_wxyz[i] = {1.0, 0.0, 0.0, 0.0};
  }
  rtbus::BodyPoses poses;
  poses.frame = 1;
  poses.count = poses.bodies = 2;
  poses.position_m[1] = {1.0, 0.0, 0.0};
  poses.orientation_wxyz[0] = poses.orientation_wxyz[1] = {1.0, 0.0, 0.0, 0.0};
  record(wall(), &table, &poses);
  auto source = view::RecordingSource::open(file_);
  ASSERT_TRUE(source) << source.error();
  EXPECT_EQ((*source)->scene()->document["bodies"].size(), 3U) << "a body per shape";
  EXPECT_EQ((*source)->scene()->document["bodies"][2]["name"], "body 1");
  (*source)->follow();
  ASSERT_EQ((*source)->frame().poses.size(), 3U);
  EXPECT_LT(((*source)->frame().poses[2].position_m - Eigen::Vector3d(1.0, 0.2, 0.0)).norm(), 1e-9);
}

TEST_F(Recorded, WithoutItsSessionFileShowsTheHandAndSaysSo) {
  record({});
  auto source = view::RecordingSource::open(file_);
  ASSERT_TRUE(source) << source.error();
  EXPECT_THAT((*source)->scene()->document["notes"].dump(), testing::HasSubstr("it holds no session file"));
  (*source)->follow();
  EXPECT_EQ((*source)->frame().hands.size(), 1U);
}

TEST_F(Recorded, OneWithoutHandsIsRefused) {
  auto writer = rec::Writer::create(file_, {});
  ASSERT_TRUE(writer && writer->close());
  const auto source = view::RecordingSource::open(file_);
  ASSERT_FALSE(source);
  EXPECT_THAT(source.error(), testing::HasSubstr("no hand was recorded"));
}

}  // namespace
#endif
