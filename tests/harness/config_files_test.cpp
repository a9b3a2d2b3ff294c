/// The session files that are shipped, read by every reader of every node; and sessions that the nodes must refuse.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "haptic_node/config_warnings.hpp"
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
    const physics::EngineEntry& engine = *physics::find_engine(config.physics.engine);
    const bool own_program = engine.name == physics::kExternalEngine || !engine.program.empty();
    if (own_program || !physics::engine_present(engine)) return;
    (void)physics::make_world(config.physics.engine, config.scene, config.physics.engine_settings());
  }
}

/// What the nodes of a session warn of.
std::vector<std::string> warnings_of(const std::string& file, const std::vector<Override>& overrides) {
  auto session = rtbus::config::load_session(file, overrides);
  std::vector<std::string> out;
  if (session.physics) out = physics::read_node_config(session).warnings;
  for (std::size_t i = 0; i < session.haptic.size(); ++i) {
    const auto more = haptic::read_haptic_config(session, i).warnings;
    out.insert(out.end(), more.begin(), more.end());
  }
  return out;
}

std::vector<std::string> shipped_sessions() {
  std::vector<std::string> out;
  for (const auto& entry : std::filesystem::directory_iterator(std::string(RTBUS_SOURCE_DIR) + "/config")) {
    if (entry.path().extension() == ".yaml") out.push_back(entry.path().string());
  }
  return out;
}

/// Names a driver that this build does not have.
bool lacks_driver(const std::filesystem::path& file) {
  std::ifstream in(file);
  const std::string text(std::istreambuf_iterator<char>(in), {});
  const auto names = [&](const char* mark) { return text.find(mark) != text.npos; };
  if (!RTBUS_WITH_HAPLY && (names("driver: haply") || names("devices/virtual_inverse3"))) return true;
  return !RTBUS_WITH_USB && (names("driver: falcon") || names("driver: phantom") || names("devices/virtual_falcon") ||
                             names("devices/virtual_phantom"));
}

TEST(ShippedSessions, AreAcceptedByEveryReader) {
  const auto files = shipped_sessions();
  EXPECT_GE(files.size(), 11u);
  for (const std::string& file : files) {
    if (lacks_driver(file)) continue;
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
    if (lacks_driver(entry.path())) continue;
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

TEST(ShippedSessions, GiveNoWarning) {
  for (const std::string& file : shipped_sessions()) {
    if (lacks_driver(file)) continue;
    EXPECT_THAT(warnings_of(file, {}), testing::IsEmpty()) << file;
  }
}

class WarnedSession : public testing::TestWithParam<BadConfig> {};
TEST_P(WarnedSession, GivesOneWarningWithPlaceCauseAndRemedy) {
  const auto warnings = warnings_of(GetParam().file, GetParam().overrides);
  ASSERT_THAT(warnings, testing::ElementsAre(testing::ContainsRegex(GetParam().expect)));
  EXPECT_THAT(warnings.front(), testing::StartsWith("/")) << "begins with the place";
  EXPECT_THAT(warnings.front(), testing::Not(testing::HasSubstr("\n")));
}
INSTANTIATE_TEST_SUITE_P(Files, WarnedSession, testing::ValuesIn(tests::bad_configs("warned")), tests::bad_config_name);

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
    overrides.reserve(settings.size());
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

TEST(HapticConfig, SaysHowFarTheDampingWasRaised) {
  const auto said = [](const std::string& throttle) {
    auto session = rtbus::config::load_session(
        std::string(RTBUS_SOURCE_DIR) + "/config/wall.yaml",
        {rtbus::config::parse_override("haptic.0.coupling={stiffness_n_per_m: 1000, damping_n_s_per_m: 0.1}"),
         rtbus::config::parse_override("physics.throttle_hz=" + throttle)});
    return haptic::damping_raised(haptic::read_haptic_config(session, 0));
  };
  EXPECT_THAT(said("18"), testing::HasSubstr(", 20 % of critical: "));
  EXPECT_EQ(said("null"), "");
}

// No alarm at each start: a wall that only the passivity controller makes passive is the usual case.
TEST(HapticConfig, SaysWithFiguresWhatTheOwnDampingMakesPassive) {
  const auto said = [](const std::string& coupling) {
    auto session = rtbus::config::load_session(std::string(RTBUS_SOURCE_DIR) + "/config/drop.yaml",
                                               {rtbus::config::parse_override("haptic.0.coupling=" + coupling)});
    return haptic::beyond_passive(haptic::read_haptic_config(session, 0));
  };
  EXPECT_EQ(said("{stiffness_n_per_m: 300, damping_n_s_per_m: 0.55}"),
            "the device's own damping alone makes no sampled wall passive (2(b - |B|)/T = 2(0.04 - 0.55 N s/m)/1 ms = "
            "-1020 N/m); the passivity controller covers the 300 N/m of this session");
  EXPECT_THAT(said("{stiffness_n_per_m: 300, damping_n_s_per_m: 0.02}"),
              testing::HasSubstr("makes a sampled wall passive only up to 2(b - |B|)/T"));
  EXPECT_EQ(said("{stiffness_n_per_m: 30, damping_n_s_per_m: 0.02}"), "");
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
  EXPECT_EQ(chosen("soft.yaml", {}), "local_contact");
  EXPECT_EQ(chosen("wall.yaml", {"physics=null"}), "direct");
  EXPECT_EQ(chosen("wall.yaml", {"haptic.0.form=paper"}), "remote_virtual_coupling");
  EXPECT_EQ(chosen("wall.yaml", {"haptic.0.link=pipe", "haptic.0.link_rate_hz=50", "physics.step_on=packet"}),
            "remote_virtual_coupling");
  EXPECT_EQ(chosen("two_hands.yaml", {}), "local_contact") << "each knows what the other does";
  EXPECT_EQ(chosen("beads_mm.yaml", {}), "local_contact") << "they yield to the tool";
  EXPECT_EQ(chosen("beads_mm.yaml", {"physics.engine=mujoco"}), "remote_virtual_coupling")
      << "10 mg before a tip of 10 g";
  EXPECT_EQ(chosen("beads_mm.yaml", {"physics.engine=mujoco", "scene.bodies.5.mass_kg=0.001"}), "local_contact");
}

// A program of the user's has bodies of its own: what the file says of a static one need not be there.
TEST(HapticConfig, HearsTheOtherHandsOfThisMachineAlone) {
  const auto hand = [](const std::vector<std::string>& assignments) {
    std::vector<Override> overrides;
    for (const std::string& text : assignments) overrides.push_back(rtbus::config::parse_override(text));
    auto session = rtbus::config::load_session(std::string(RTBUS_SOURCE_DIR) + "/config/two_hands.yaml", overrides);
    return haptic::read_haptic_config(session, 0);
  };
  EXPECT_EQ(hand({}).method, "local_contact");
  EXPECT_EQ(hand({}).other_hands.size(), 1U);
  EXPECT_EQ(hand({"haptic.0.method=remote_virtual_coupling"}).other_hands.size(), 0U);
  EXPECT_EQ(hand({"haptic.1.link=dds"}).other_hands.size(), 0U);
  EXPECT_EQ(hand({"haptic.0.link=dds"}).method, "remote_virtual_coupling");
  EXPECT_THROW((void)hand({"haptic.0.link=dds", "haptic.0.method=local_contact"}), rtbus::config::Error);
}

TEST(HapticConfig, KnowsTheShapesOfTheFileOnlyWherePhysicsHasThem) {
  const auto known = [](const std::string& engine) {
    auto session = rtbus::config::load_session(std::string(RTBUS_SOURCE_DIR) + "/tests/data/sessions/ridge.yaml",
                                               {rtbus::config::parse_override("physics.engine=" + engine),
                                                rtbus::config::parse_override("haptic.0.method=local_contact")});
    return haptic::read_haptic_config(session, 0).known.size();
  };
  EXPECT_EQ(known("analytic"), 1U);
  EXPECT_EQ(known("external"), 0U);
  const auto hull = [](const std::string& engine, const std::string& type) {
    auto session = rtbus::config::load_session(
        std::string(RTBUS_SOURCE_DIR) + "/config/free_block.yaml",
        {rtbus::config::parse_override("physics.engine=" + engine),
         rtbus::config::parse_override("scene={schema: scene/1, bodies: [{name: wedge, " + type +
                                       ", shape: {convex_hull: "
                                       "{file: " +
                                       std::string(RTBUS_SOURCE_DIR) +
                                       "/config/scenes/meshes/wedge.obj, metres_per_unit: 1}}}]}")});
    return haptic::read_haptic_config(session, 0).known.size();
  };
  EXPECT_EQ(hull("bullet", "type: dynamic, mass_kg: 0.1"), 1U);
  EXPECT_EQ(hull("mujoco", "type: static"), 1U);
  EXPECT_EQ(hull("mujoco", "type: dynamic, mass_kg: 0.1"), 0U) << "it is told in other axes than the file's";
}

class BadNode : public testing::TestWithParam<BadConfig> {};
TEST_P(BadNode, IsRefusedWithItsReason) { EXPECT_TRUE(tests::fails_as_expected(GetParam(), read_everything)); }
INSTANTIATE_TEST_SUITE_P(Files, BadNode, testing::ValuesIn(tests::bad_configs("node")), tests::bad_config_name);

}  // namespace
