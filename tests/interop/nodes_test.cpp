/// The nodes as processes: what they map, and what they leave behind.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/support/nodes.hpp"

namespace {

using namespace tests;

TEST_F(Nodes, MapNeitherBulletNorLibusbForTheWall) {
  start_physics();
  start_haptic();
  auto ticks = reader<Telemetry>("haptic0.telemetry");
  ASSERT_TRUE(ticks);
  for (const pid_t pid : {physics_->pid(), haptic_->pid()}) {
    std::ifstream maps("/proc/" + std::to_string(pid) + "/maps");
    std::string line;
    int lines = 0;
    while (std::getline(maps, line)) {
      ++lines;
      EXPECT_EQ(line.find("Bullet"), std::string::npos) << line;
      EXPECT_EQ(line.find("physics_bullet"), std::string::npos) << line;
      EXPECT_EQ(line.find("libusb"), std::string::npos) << line;
      EXPECT_EQ(line.find("drivers_usb"), std::string::npos) << line;
    }
    EXPECT_GT(lines, 10);
  }
}

TEST(Devices, AreListedAlsoWhereThereIsNoUsb) {
  const std::string out = testing::TempDir() + "devices" + std::to_string(getpid()) + ".json";
  Child devices({std::string(RTBUS_BINARY_DIR) + "/rtbus", "devices", "--json"}, out);
  EXPECT_EQ(devices.wait(), 0);
  std::ifstream file(out);
  const std::string text((std::istreambuf_iterator<char>(file)), {});
  unlink(out.c_str());
  EXPECT_NE(text.find("\"schema\": \"rtbus-devices/1\""), std::string::npos) << text;
}

TEST_F(Nodes, LeaveNothingInSharedMemoryAfterSigintAndSigterm) {
  for (const int signal : {SIGINT, SIGTERM}) {
    start_physics();
    start_haptic();
    ASSERT_TRUE(reader<Telemetry>("haptic0.telemetry"));
    ASSERT_TRUE(reader<rtbus::Heartbeat>("physics.heartbeat"));
    EXPECT_FALSE(tests::segments_of(bus_.name).empty());
    EXPECT_EQ(haptic_->end(signal), 0);
    EXPECT_EQ(physics_->end(signal), 0);
    EXPECT_EQ(tests::segments_of(bus_.name), std::vector<std::string>{});
  }
}

TEST_F(Nodes, AreCleanedUpAfterEverythingWasKilled) {
  start_physics();
  start_haptic();
  ASSERT_TRUE(reader<Telemetry>("haptic0.telemetry"));
  haptic_->end(SIGKILL);
  physics_->end(SIGKILL);
  EXPECT_FALSE(tests::segments_of(bus_.name).empty());
  Child clean({binary("rtbus"), "clean", "--session", bus_.name}, "/dev/null");
  EXPECT_EQ(clean.wait(), 0);
  EXPECT_EQ(tests::segments_of(bus_.name), std::vector<std::string>{});
}

TEST_F(Nodes, AreEndedByCtrlCOfTheRunCommandWithNothingLeft) {
  const std::string folder = testing::TempDir() + bus_.name, report = folder + "/report.json";
  std::filesystem::create_directory(folder);
  Child run({binary("rtbus"), "run", std::string(RTBUS_SOURCE_DIR) + "/config/wall.yaml", "--set",
             "session=" + bus_.name, "--report", report, "--plots", folder},
            "/dev/null");
  ASSERT_TRUE(reader<Telemetry>("haptic0.telemetry"));
  usleep(700'000);
  EXPECT_EQ(run.end(SIGINT), 0) << "Ctrl-C is a good end";
  EXPECT_EQ(tests::segments_of(bus_.name), std::vector<std::string>{});
  std::ifstream file(report);
  std::string text((std::istreambuf_iterator<char>(file)), {});
  std::filesystem::remove_all(folder);
  EXPECT_NE(text.find("rtbus-report/1"), std::string::npos);
}

}  // namespace
