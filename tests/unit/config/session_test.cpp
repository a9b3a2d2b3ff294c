#include "rtbus/config/session.hpp"

#include <gmock/gmock.h>
#include <grp.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <string>

#include "tests/support/temporary_file.hpp"

namespace rtbus::config {
namespace {

using testing::HasSubstr;

constexpr const char* kMinimal = R"(schema: session/1
scene: {schema: scene/1, bodies: [{name: wall, type: static, shape: {plane: {}}}]}
haptic: [{name: haptic0, device: {driver: simulated}}]
)";

SessionConfig read(const std::string& text, const std::vector<Override>& overrides = {}) {
  const tests::TemporaryFolder folder;
  return load_session(folder.write("x.yaml", text), overrides);
}

TEST(Session, NeedsASceneAndOneHapticNodeOnly) {
  const SessionConfig config = read(kMinimal);
  EXPECT_EQ(config.session.name, "default");
  EXPECT_EQ(config.session.mode, 0600U);
  EXPECT_FALSE(config.session.group.has_value());
  EXPECT_FALSE(config.physics.has_value());
  EXPECT_EQ(config.scene.bodies.size(), 1U);
  ASSERT_EQ(config.haptic.size(), 1U);
  EXPECT_EQ(config.haptic[0].name, "haptic0");
}

TEST(Session, LeavesTheNodesKeysToTheirOwnReaders) {
  SessionConfig config = read(std::string(kMinimal) + "physics: {engine: analytic, rat_hz: 5}\n");
  ASSERT_TRUE(config.physics.has_value());
  EXPECT_EQ(config.physics->text("engine"), "analytic");
  EXPECT_THROW(config.physics->finish(), Error);
  Map& haptic = config.haptic[0].map;
  EXPECT_EQ(haptic.file_or_map("device").text("driver"), "simulated");
  EXPECT_NO_THROW(haptic.finish());  // `name` has been read by the session already
}

TEST(Session, FindsNodesByName) {
  SessionConfig config = read(kMinimal, {parse_override("haptic.0.name=left")});
  ASSERT_NE(config.find_haptic("left"), nullptr);
  EXPECT_EQ(config.find_haptic("left")->map.path(), "haptic.0");
  EXPECT_EQ(config.find_haptic("haptic0"), nullptr);
}

TEST(Session, OpensItsSegmentsToAGroupThatExists) {
  const group* entry = getgrgid(getegid());
  if (entry == nullptr) {
    GTEST_SKIP() << "the group of this process has no name here";
  }
  const SessionConfig config = read(std::string(kMinimal) + "bus: {mode: 0660, group: " + entry->gr_name + "}\n");
  EXPECT_EQ(config.session.mode, 0660U);
  EXPECT_EQ(config.session.group, getegid());
}

TEST(Session, ReachesTheSceneFileWithOverrides) {
  const std::string wall = std::string(RTBUS_SOURCE_DIR) + "/config/wall.yaml";
  const SessionConfig config = load_session(wall, {parse_override("scene.bodies.wall.friction=0.7")});
  EXPECT_EQ(config.scene.bodies.at(0).friction, 0.7);
  const SessionConfig other =
      load_session(wall, {parse_override("scene.bodies.0.name=lump"), parse_override("scene=scenes/sphere.yaml")});
  EXPECT_EQ(other.scene.name, "sphere");
  EXPECT_EQ(other.scene.bodies.at(0).name, "lump");
}

/// The files that are delivered.
TEST(DeliveredConfigurations, AllLoad) {
  int sessions = 0;
  for (const auto& entry : std::filesystem::directory_iterator(std::string(RTBUS_SOURCE_DIR) + "/config")) {
    if (entry.path().extension() == ".yaml") {
      SCOPED_TRACE(entry.path());
      SessionConfig config = load_session(entry.path().string());
      EXPECT_FALSE(config.scene.static_shapes().empty());
      for (HapticEntry& haptic : config.haptic) {
        EXPECT_NO_THROW((void)haptic.map.file_or_map("device"));
      }
      ++sessions;
    }
  }
  EXPECT_GE(sessions, 5);
}

TEST(DeliveredConfigurations, IncludeScenesThatAllLoad) {
  int scenes = 0;
  for (const auto& entry : std::filesystem::directory_iterator(std::string(RTBUS_SOURCE_DIR) + "/config/scenes")) {
    if (entry.path().extension() != ".yaml") continue;  // what scenes refer to
    SCOPED_TRACE(entry.path());
    Map map = load(entry.path().string());
    EXPECT_EQ(read_scene(map).name, entry.path().stem());
    ++scenes;
  }
  EXPECT_GE(scenes, 3);
}

}  // namespace
}  // namespace rtbus::config
