/// A haptic process and a physics process that read two scenes: the loop would find contacts that are not there.
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/messages.hpp"
#include "rtbus/topic.hpp"
#include "tests/support/process.hpp"
#include "tests/support/temporary_file.hpp"

namespace {

using rtbus::Reader;
using rtbus::Stamped;
using rtbus::Telemetry;
using tests::Child;
using tests::eventually;

class OtherScene : public testing::Test {
 protected:
  void SetUp() override { bus_.name = "other_scene" + std::to_string(getpid()); }
  void TearDown() override {
    haptic_.reset();
    physics_.reset();
    Child clean({binary("rtbus"), "clean", "--session", bus_.name}, "/dev/null");
    clean.wait();
  }
  static std::string binary(const std::string& name) { return std::string(RTBUS_BINARY_DIR) + "/" + name; }
  [[nodiscard]] std::vector<std::string> command(const std::string& program, const std::string& wall_m) const {
    return {binary(program),
            "--config",
            std::string(RTBUS_SOURCE_DIR) + "/config/wall.yaml",
            "--set",
            "session=" + bus_.name,
            "--set",
            "haptic.0.method=local_contact",
            "--set",
            "scene.bodies.0.position_m=" + wall_m};
  }
  [[nodiscard]] std::size_t said(const std::string& what) const {
    std::ifstream stream(log_);
    const std::string text{std::istreambuf_iterator<char>(stream), {}};
    std::size_t count = 0;
    for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++count;
    return count;
  }

  const tests::TemporaryFolder folder_;
  const std::string log_ = (folder_.path() / "haptic.log").string();
  rtbus::Session bus_;
  std::optional<Child> physics_, haptic_;
};

TEST_F(OtherScene, IsSaidAndNothingIsFeltUntilPhysicsHasTheSame) {
  physics_.emplace(command("physics_node", "[0, 0.001, 0]"), "/dev/null");
  haptic_.emplace(command("haptic_node", "[0, 0, 0]"), log_);
  ASSERT_TRUE(eventually(10.0, [&] { return said("physics has another scene: no force; restart this node") > 0; }));
  std::optional<Reader<Telemetry>> ticks;
  ASSERT_TRUE(eventually(10.0, [&] {
    auto opened = Reader<Telemetry>::open(bus_, "haptic0.telemetry", {.presence = true});
    if (opened) ticks.emplace(std::move(*opened));
    return ticks.has_value();
  }));
  Stamped<Telemetry> tick;
  const auto newest = [&] {
    (void)ticks->read_latest(tick);
    return tick.value;
  };
  // The tip has fallen through the wall: physics answers, and no force comes of it.
  ASSERT_TRUE(eventually(10.0, [&] { return newest().proxy_sequence > 0 && newest().position_m[1] < -0.005; }));
  EXPECT_EQ(newest().force_n, rtbus::Vec3{});
  EXPECT_EQ(said("another scene"), 1U) << "once";

  physics_.emplace(command("physics_node", "[0, 0, 0]"), "/dev/null");
  EXPECT_TRUE(eventually(10.0, [&] { return newest().force_n[1] > 0.1; })) << newest().force_n[1];
}

}  // namespace
