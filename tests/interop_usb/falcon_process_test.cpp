/// haptic_node as a process on a virtual Falcon: firmware, homing, wall, end. Everything between loop and device is
/// what a real Falcon would meet; the device stands behind the preloaded library.
#include <gtest/gtest.h>

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "rtbus/link_messages.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/topic.hpp"
#include "tests/support/process.hpp"

namespace {

using rtbus::Reader;
using rtbus::ReadStatus;
using rtbus::Stamped;
using rtbus::Telemetry;
using tests::Child;
using tests::eventually;

constexpr double kWall = 400.0;  // of config/wall_virtual_falcon.yaml

class FalconNode : public testing::Test {
 protected:
  void start(const std::vector<std::string>& assignments = {}) {
    bus_.name = "falconnode" + std::to_string(getpid());
    log_ = "/tmp/rtbus_" + bus_.name + ".log";
    const std::string library = binary("libvirtual_usb.so");
    // A sanitizer's run-time has to stay the first library.
    const char* const before = std::getenv("LD_PRELOAD");
    std::vector<std::string> command{"/usr/bin/env",
                                     "LD_PRELOAD=" + (before == nullptr ? "" : std::string(before) + ":") + library,
                                     binary("haptic_node"),
                                     "--config",
                                     std::string(RTBUS_SOURCE_DIR) + "/config/wall_virtual_falcon.yaml",
                                     "--set",
                                     "session=" + bus_.name};
    for (const std::string& each : assignments) command.insert(command.end(), {"--set", each});
    node_.emplace(command, log_);
    eventually(10.0, [&] {
      auto opened = Reader<Telemetry>::open(bus_, "haptic0.telemetry", {.presence = true});
      if (opened) ticks_.emplace(std::move(*opened));
      return ticks_.has_value() && ticks_->writer_alive();
    });
  }
  void TearDown() override {
    node_.reset();
    Child clean({binary("rtbus"), "clean", "--session", bus_.name}, "/dev/null");
    clean.wait();
    ::unlink(log_.c_str());
  }
  static std::string binary(const std::string& name) { return std::string(RTBUS_BINARY_DIR) + "/" + name; }
  std::string log() const {
    std::ostringstream text;
    text << std::ifstream(log_).rdbuf();
    return text.str();
  }

  rtbus::Session bus_;
  std::string log_;
  std::optional<Child> node_;
  std::optional<Reader<Telemetry>> ticks_;
};

TEST_F(FalconNode, HoldsTheWallAndEndsCleanly) {
  start();
  ASSERT_TRUE(ticks_) << log();
  Stamped<Telemetry> tick;
  // Pushed 5 mm beyond the surface by a hand of 700 N/m: at rest some 3 mm inside, less what dry friction holds.
  bool rests = false;
  double low_m = 0.0;
  double high_m = 0.0;
  double worst = 0.0;
  int quiet = 0;
  EXPECT_TRUE(eventually(40.0,
                         [&] {
                           while (!rests && ticks_->read_next(tick) == ReadStatus::kFresh) {
                             const double depth_m = -tick.value.position_m[1];
                             const bool inside = tick.value.gate >= 1.0 && depth_m > 0.002;
                             if (!inside || std::abs(depth_m - low_m) > 150e-6 || std::abs(depth_m - high_m) > 150e-6) {
                               quiet = 0;
                               worst = 0.0;
                               low_m = high_m = depth_m;
                               continue;
                             }
                             low_m = std::min(low_m, depth_m);
                             high_m = std::max(high_m, depth_m);
                             // What left for the device is what `direct` gives at this very sample.
                             worst =
                                 std::max(worst, std::abs(tick.value.force_n[1] - kWall * depth_m) / (kWall * depth_m));
                             rests = ++quiet >= 1000;
                           }
                           return rests;
                         }))
      << "deepest " << high_m << " m\n"
      << log();
  EXPECT_LE(worst, 0.02);
  EXPECT_NEAR(high_m, 0.005 * 700.0 / 1100.0, 0.15 / 1100.0 + 150e-6);
  // How the link does is on the bus, for monitors and recordings.
  auto link = Reader<rtbus::LinkStats>::open(bus_, "haptic0.link_stats");
  ASSERT_TRUE(link);
  Stamped<rtbus::LinkStats> stats;
  EXPECT_TRUE(eventually(5.0, [&] {
    return link->read_latest(stats) == ReadStatus::kFresh && stats.value.exchanges > 1000 &&
           stats.value.state == static_cast<std::uint32_t>(rtbus::LinkState::kRunning);
  }));
  EXPECT_EQ(stats.value.bad_frames, 0u);
  EXPECT_GT(stats.value.sample_to_wire_p50_us, 0.0);
  EXPECT_NE(log().find("home the Falcon"), std::string::npos);
  EXPECT_NE(log().find("the device is ready"), std::string::npos);
  const int status = node_->end(SIGTERM);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status << "\n" << log();
  EXPECT_NE(log().find("ended at zero force"), std::string::npos) << log();
}

// A device that never answers keeps start() busy for four seconds; Ctrl-C does not wait for the verdict.
TEST_F(FalconNode, EndsWhileTheDeviceIsBroughtUp) {
  start({"haptic.0.device.usb.virtual.faults.mute=true"});
  ASSERT_TRUE(ticks_) << log();  // topics come before the device
  const int status = node_->end(SIGTERM);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status << "\n" << log();
  EXPECT_NE(log().find("ended before the device was ready"), std::string::npos) << log();
  EXPECT_EQ(log().find("wall power"), std::string::npos) << "it waited for the verdict\n" << log();
  EXPECT_EQ(tests::segments_of(bus_.name), std::vector<std::string>{});
}

}  // namespace
