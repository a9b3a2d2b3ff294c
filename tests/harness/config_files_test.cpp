/// The session files that are shipped, read by every reader of every node; and sessions that the nodes must refuse.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "haptic_node/node_config.hpp"
#include "physics_node/engine_registry.hpp"
#include "physics_node/node_config.hpp"
#include "tests/support/bad_config.hpp"
#include "tests/support/temporary_file.hpp"
#if RTBUS_WITH_HDF5
#include "tests/support/recording.hpp"
#endif

namespace {

using rtbus::config::Override;
using tests::BadConfig;

/// What `rtbus run` checks before it starts anything.
void read_everything(const std::string& file, const std::vector<Override>& overrides) {
  auto session = rtbus::config::load_session(file, overrides);
  for (std::size_t i = 0; i < session.haptic.size(); ++i) (void)haptic::read_haptic_config(session, i);
  if (session.physics) {
    const auto config = physics::read_node_config(session);
    // Without its module an engine cannot judge the scene; EngineRegistry.BuildsWhatItPromises notices a lost one.
    if (!physics::engine_present(*physics::find_engine(config.physics.engine))) return;
    (void)physics::make_world(config.physics.engine, config.scene, config.physics.engine_settings());
  }
}

std::vector<std::string> shipped_sessions() {
  std::vector<std::string> out;
  for (const auto& entry : std::filesystem::directory_iterator(std::string(RTBUS_SOURCE_DIR) + "/config")) {
    if (entry.path().extension() == ".yaml") out.push_back(entry.path().string());
  }
  return out;
}

/// Names a driver that a build without USB does not have.
bool needs_usb(const std::filesystem::path& file) {
  std::ifstream in(file);
  const std::string text(std::istreambuf_iterator<char>(in), {});
  for (const char* mark : {"driver: falcon", "driver: phantom", "devices/virtual_"}) {
    if (text.find(mark) != text.npos) return true;
  }
  return false;
}

TEST(ShippedSessions, AreAcceptedByEveryReader) {
  const auto files = shipped_sessions();
  EXPECT_GE(files.size(), 11u);
  for (const std::string& file : files) {
    if (!RTBUS_WITH_USB && needs_usb(file)) continue;
    EXPECT_NO_THROW(read_everything(file, {})) << file;
  }
}

TEST(ShippedDevices, AreAcceptedInASession) {
  const tests::TemporaryFolder folder;
  const std::string config = std::string(RTBUS_SOURCE_DIR) + "/config/";
  int devices = 0;
  for (const auto& entry : std::filesystem::directory_iterator(config + "devices")) {
    if (entry.path().extension() != ".yaml") continue;
    ++devices;
    std::vector<Override> overrides{rtbus::config::parse_override("haptic.0.device=" + entry.path().string())};
    if (entry.path().stem() == "replay") {  // names a recording that the user makes
#if RTBUS_WITH_HDF5
      const std::string recording = folder.path() / "trial1.h5";
      tests::record_stillness(recording, 0.1);
      overrides.push_back(rtbus::config::parse_override("haptic.0.device.file=" + recording));
#else
      continue;
#endif
    }
    if (!RTBUS_WITH_USB && needs_usb(entry.path())) continue;
    EXPECT_NO_THROW(read_everything(config + "wall.yaml", overrides)) << entry.path();
  }
  EXPECT_GE(devices, 5);
}

TEST(ShippedScenes, AreAcceptedInASession) {
  const std::string config = std::string(RTBUS_SOURCE_DIR) + "/config/";
  for (const auto& entry : std::filesystem::directory_iterator(config + "scenes")) {
    if (entry.path().extension() != ".yaml") continue;
    EXPECT_NO_THROW(
        read_everything(config + "wall.yaml", {rtbus::config::parse_override("scene=" + entry.path().string()),
                                               rtbus::config::parse_override("physics.engine=bullet")}))
        << entry.path();
  }
  // What stands still and is a plane, a sphere or a box needs no Bullet.
  for (const char* scene : {"wall", "sphere", "box"}) {
    EXPECT_NO_THROW(read_everything(config + "wall.yaml",
                                    {rtbus::config::parse_override("scene=scenes/" + std::string(scene) + ".yaml")}))
        << scene;
  }
}

TEST(HapticConfig, LowersAStiffnessThatTheDeviceDoesNotAllowAndKeepsBoth) {
  auto session =
      rtbus::config::load_session(std::string(RTBUS_SOURCE_DIR) + "/config/wall.yaml",
                                  {rtbus::config::parse_override("haptic.0.coupling.stiffness_n_per_m=50000")});
  const auto config = haptic::read_haptic_config(session, 0);
  EXPECT_EQ(config.stiffness_requested_n_per_m, 50000.0);
  EXPECT_EQ(config.stiffness_n_per_m, config.device->info().max_stiffness_n_per_m);
  // The slew limit follows the stiffness that is rendered: never below 2·K·v.
  EXPECT_GE(config.safety.slew_n_per_ms, 2.0 * config.stiffness_n_per_m * 0.6e-3 - 1e-12);
}

// Where physics is slower than 1.5 times the tip's own frequency on the spring, a coupling without damping would ring.
TEST(HapticConfig, RaisesTheDampingOfACouplingToSlowPhysicsAndKeepsBoth) {
  const auto rendered = [](std::vector<std::string> settings) {
    settings.insert(settings.begin(), "haptic.0.coupling={stiffness_n_per_m: 1000, damping_n_s_per_m: 0.1}");
    std::vector<rtbus::config::Override> overrides;
    for (const std::string& text : settings) overrides.push_back(rtbus::config::parse_override(text));
    auto session = rtbus::config::load_session(std::string(RTBUS_SOURCE_DIR) + "/config/wall.yaml", overrides);
    const auto config = haptic::read_haptic_config(session, 0);
    EXPECT_EQ(config.damping_requested_n_s_per_m, 0.1);
    return config.damping_n_s_per_m / std::sqrt(1000.0 * config.device->info().apparent_mass_kg);
  };
  EXPECT_NEAR(rendered({"physics.throttle_hz=18"}), 0.4, 1e-12);
  EXPECT_LT(rendered({}), 0.1);  // 1 kHz: as requested
  EXPECT_LT(rendered({"physics.throttle_hz=18", "haptic.0.form=paper"}), 0.1);
  EXPECT_LT(rendered({"physics.throttle_hz=18", "haptic.0.method=local_contact"}), 0.1);
}

// Without `method` a session gets the most exact one that its link and scene allow.
TEST(HapticConfig, ChoosesTheMethodThatTheSessionAllows) {
  const auto chosen = [](const char* file, const std::vector<std::string>& settings, std::size_t hand = 0) {
    std::vector<Override> overrides{rtbus::config::parse_override("haptic." + std::to_string(hand) + ".method=null")};
    for (const std::string& text : settings) overrides.push_back(rtbus::config::parse_override(text));
    auto session = rtbus::config::load_session(std::string(RTBUS_SOURCE_DIR) + "/config/" + file, overrides);
    return haptic::read_haptic_config(session, hand).method;
  };
  EXPECT_EQ(chosen("wall.yaml", {}), "local_contact");
  EXPECT_EQ(chosen("stack_125.yaml", {}), "local_contact");
  EXPECT_EQ(chosen("soft.yaml", {}), "remote_virtual_coupling");
  EXPECT_EQ(chosen("wall.yaml", {"physics=null"}), "direct");
  EXPECT_EQ(chosen("wall.yaml", {"haptic.0.form=paper"}), "remote_virtual_coupling");
  EXPECT_EQ(chosen("wall.yaml", {"haptic.0.link=pipe", "haptic.0.link_rate_hz=50", "physics.step_on=packet"}),
            "remote_virtual_coupling");
  EXPECT_EQ(chosen("two_hands.yaml", {}), "remote_virtual_coupling") << "each would have to know the other's spring";
  EXPECT_EQ(chosen("beads_mm.yaml", {}), "remote_virtual_coupling") << "10 mg before a tip of 10 g";
  EXPECT_EQ(chosen("beads_mm.yaml", {"scene.bodies.5.mass_kg=0.001"}), "local_contact");
}

class BadNode : public testing::TestWithParam<BadConfig> {};
TEST_P(BadNode, IsRefusedWithItsReason) { EXPECT_TRUE(tests::fails_as_expected(GetParam(), read_everything)); }
INSTANTIATE_TEST_SUITE_P(Files, BadNode, testing::ValuesIn(tests::bad_configs("node")), tests::bad_config_name);

}  // namespace
