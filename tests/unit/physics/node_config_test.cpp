#include "physics_node/node_config.hpp"

#include <unistd.h>

#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace {

using physics::NodeConfig;
using rtbus::config::Error;
using testing::AllOf;
using testing::HasSubstr;

/// A session file in a folder of its own that goes with the test.
class PhysicsNodeConfig : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("rtbus_physics_" + std::to_string(getpid()) + "_" +
                                                        testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  NodeConfig read(const std::string& physics, const std::string& haptic = "coupling: {stiffness_n_per_m: 300}") {
    const std::string file = (folder_ / "session.yaml").string();
    std::ofstream(file) << "schema: session/1\n"
                           "session: test\n"
                           "scene: {schema: scene/1, bodies: [{name: wall, type: static, shape: {plane: {}}}]}\n"
                        << physics << "\nhaptic:\n  - {name: haptic0, device: {model: x}, " << haptic << "}\n";
    rtbus::config::SessionConfig session = rtbus::config::load_session(file);
    return physics::read_node_config(session);
  }
  std::string error_of(const std::string& physics, const std::string& haptic = "coupling: {stiffness_n_per_m: 300}") {
    try {
      (void)read(physics, haptic);
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }

 private:
  std::filesystem::path folder_;
};

TEST_F(PhysicsNodeConfig, HasADefaultForEverything) {
  const NodeConfig config = read("physics: {}");
  EXPECT_EQ(config.physics.engine, "analytic");
  EXPECT_EQ(config.physics.rate_hz, 1000.0);
  EXPECT_FALSE(config.physics.throttle_hz.has_value());
  EXPECT_EQ(config.physics.substeps, 1);
  EXPECT_EQ(config.session.name, "test");
  ASSERT_EQ(config.proxies.size(), 1U);
  EXPECT_EQ(config.proxies[0].device, "haptic0");
  EXPECT_EQ(config.proxies[0].mass_kg, 0.1);
  EXPECT_EQ(config.proxies[0].friction, 1.0);
  EXPECT_FALSE(config.proxies[0].damping_n_s_per_m.has_value());
}

TEST_F(PhysicsNodeConfig, KnowsItsPaceAndTheCoresOfTheHapticLoops) {
  EXPECT_STREQ(read("physics: {}").physics.clock(), "fixed");
  EXPECT_STREQ(read("physics: {throttle_hz: 18}").physics.clock(), "throttled");
  const NodeConfig config = read("physics: {pace: free, rate_hz: 500}",
                                 "coupling: {stiffness_n_per_m: 300}, realtime: {core: 3}, proxy: {lead_steps: 0.5}");
  EXPECT_STREQ(config.physics.clock(), "free");
  EXPECT_EQ(config.physics.step_s(), 2e-3) << "the longest step";
  EXPECT_EQ(config.haptic_cores, std::vector<int>{3});
  EXPECT_EQ(config.proxies[0].lead_steps, 0.5);
  EXPECT_EQ(read("physics: {}").haptic_cores, std::vector<int>{-1});
}

TEST_F(PhysicsNodeConfig, TakesTheProxysStiffnessFromTheCouplingUnlessItHasItsOwn) {
  EXPECT_EQ(read("physics: {}").proxies[0].stiffness_n_per_m, 300.0);
  EXPECT_EQ(read("physics: {}", "coupling: {stiffness_n_per_m: 300}, proxy: {stiffness_n_per_m: 50}")
                .proxies[0]
                .stiffness_n_per_m,
            50.0);
}

TEST_F(PhysicsNodeConfig, ReadsAllOfTheProxy) {
  const auto proxy = read("physics: {}",
                          "coupling: {stiffness_n_per_m: 1}, proxy: {mass_kg: 0.2, radius_m: 0.01, friction: 0.3, "
                          "stiffness_n_per_m: 5, damping_n_s_per_m: 7, position_m: [1, 2, 3]}")
                         .proxies[0];
  EXPECT_EQ(proxy.mass_kg, 0.2);
  EXPECT_EQ(proxy.radius_m, 0.01);
  EXPECT_EQ(proxy.friction, 0.3);
  EXPECT_EQ(proxy.damping_n_s_per_m, 7.0);
  EXPECT_EQ(proxy.position_m, Eigen::Vector3d(1, 2, 3));
}

TEST_F(PhysicsNodeConfig, LeavesTheHapticNodesKeysToItsReader) {
  // `anything` belongs to the other node; this reader neither knows it nor complains.
  EXPECT_EQ(error_of("physics: {}", "coupling: {stiffness_n_per_m: 300, anything: 1}, anything: 2"), "no error");
}

TEST_F(PhysicsNodeConfig, CutsThrottledStepsIntoPartsNoLongerThanAPeriod) {
  EXPECT_EQ(read("physics: {rate_hz: 1000, substeps: 4}").physics.parts_per_step(), 4);
  EXPECT_EQ(read("physics: {rate_hz: 1000, throttle_hz: 50}").physics.parts_per_step(), 20);
  EXPECT_EQ(read("physics: {rate_hz: 1000, throttle_hz: 18, substeps: 2}").physics.parts_per_step(), 112);
  EXPECT_DOUBLE_EQ(read("physics: {throttle_hz: 5}").physics.step_s(), 0.2);
}

TEST_F(PhysicsNodeConfig, RefusesWhatContradictsItself) {
  EXPECT_THAT(
      error_of("physics: {rate_hz: 100, throttle_hz: 200}"),
      AllOf(HasSubstr("session.yaml:4"), HasSubstr("physics.throttle_hz = 200"), HasSubstr("above physics.rate_hz")));
  EXPECT_THAT(error_of("physics: {rate_hz: 20000, throttle_hz: 0.5, substeps: 1000}"), HasSubstr("physics.substeps"));
  EXPECT_THAT(error_of("physics: {}", "coupling: {stiffness_n_per_m: 0}"), HasSubstr("coupling.stiffness_n_per_m"));
}

TEST_F(PhysicsNodeConfig, RefusesValuesOutOfRangeAndUnknownNames) {
  EXPECT_THAT(error_of("physics: {rate_hz: 0.5}"), AllOf(HasSubstr("physics.rate_hz = 0.5"), HasSubstr("below 1")));
  EXPECT_THAT(error_of("physics: {substeps: 0}"), HasSubstr("physics.substeps = 0"));
  EXPECT_THAT(error_of("physics: {engine: analitic}"), AllOf(HasSubstr("analitic"), HasSubstr("analytic")));
  EXPECT_THAT(error_of("physics: {rate: 3}"), HasSubstr("rate"));
  EXPECT_THAT(error_of("physics: {}", "coupling: {stiffness_n_per_m: 9}, proxy: {mass_kg: 0}"),
              HasSubstr("haptic.0.proxy.mass_kg = 0"));
  EXPECT_THAT(error_of("physics: {}", "coupling: {stiffness_n_per_m: 9}, proxy: {mas_kg: 1}"), HasSubstr("mass_kg"));
  EXPECT_THAT(error_of("physics: {}", "proxy: {mass_kg: 1}"), HasSubstr("coupling"));
}

TEST_F(PhysicsNodeConfig, SaysSoWhenTheSessionHasNoPhysics) {
  EXPECT_THAT(error_of(""), HasSubstr("has no physics map"));
}

}  // namespace
