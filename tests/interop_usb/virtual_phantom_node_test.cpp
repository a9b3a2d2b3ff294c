// haptic_node as a process on a virtual Vintage PHANToM: loop, I/O thread, libusb, the shim in front of the C library.
// It holds the wall: the force is the wall's, the tip rests, and the end is clean.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <string>

#include "rtbus/messages.hpp"
#include "rtbus/topic.hpp"
#include "tests/support/bare_loops.hpp"
#include "tests/support/process.hpp"

namespace {

using rtbus::Reader;
using rtbus::ReadStatus;
using rtbus::Stamped;
using rtbus::Telemetry;
using tests::Child;
using tests::eventually;

TEST(VirtualPhantomNode, HoldsTheWallThroughLibusb) {
  if (!RTBUS_WITH_USB) GTEST_SKIP() << "built without USB";
  rtbus::Session bus;
  bus.name = "phantomwall" + std::to_string(getpid());
  const std::string bin = RTBUS_BINARY_DIR;
  // A sanitizer's run-time has to stay the first library.
  const char* const before = std::getenv("LD_PRELOAD");
  const std::string preload = (before == nullptr ? "" : std::string(before) + ":") + bin + "/libvirtual_usb.so";
  Child node({"env", "LD_PRELOAD=" + preload, bin + "/haptic_node", "--config",
              std::string(RTBUS_SOURCE_DIR) + "/config/wall_virtual_phantom.yaml", "--set", "session=" + bus.name},
             "/dev/null");
  std::optional<Reader<Telemetry>> ticks;
  ASSERT_TRUE(eventually(20.0, [&] {
    auto opened = Reader<Telemetry>::open(bus, "haptic0.telemetry", {.presence = true});
    if (opened) ticks.emplace(std::move(*opened));
    return ticks.has_value() && ticks->writer_alive();
  }));

  // A second in a row in which the tip rests in the wall. Pauses of the machine interrupt it: the device lets go after
  // 20 ms, and the tip swings in anew.
  constexpr double kStiffness = 400.0;
  constexpr int kWanted = 1000;
  int resting = 0;
  int seen = 0;
  double last_n = 0.0;
  double last_m = 0.0;
  constexpr double kLate_ms = 5.0, kSwingsIn_s = 2.0;
  const tests::BareLoops machine(tests::BareScheduling::kRealtime, kLate_ms);
  const bool rested = eventually(60.0, [&] {
    Stamped<Telemetry> tick;
    while (resting < kWanted && ticks->read_next(tick) == ReadStatus::kFresh) {
      ++seen;
      const Telemetry& t = tick.value;
      const double depth_m = -t.position_m[1];
      const double wall_n = kStiffness * depth_m;
      const bool rests = depth_m > 1e-3 && std::hypot(t.velocity_m_s[0], t.velocity_m_s[1], t.velocity_m_s[2]) < 5e-3 &&
                         std::abs(t.force_n[1] - wall_n) < 0.02 * wall_n;
      resting = rests ? resting + 1 : 0;
      last_n = t.force_n[1];
      last_m = t.position_m[1];
    }
    return resting >= kWanted;
  });
  if (!rested && machine.longest_quiet_s() < kSwingsIn_s + 1e-3 * kWanted) GTEST_SKIP() << machine.text();
  ASSERT_TRUE(rested) << seen << " ticks seen, " << resting << " resting; last " << last_n << " N at " << last_m
                      << " m";
  // 300 N/m of hand, 6 mm into 400 N/m of wall: 3.43 mm of the way is the hand's, 1.03 N, within the dry friction.
  EXPECT_NEAR(last_n, 300.0 * 0.006 * kStiffness / (300.0 + kStiffness), 0.1);

  const int status = node.end(SIGINT);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
  EXPECT_EQ(tests::segments_of(bus.name), std::vector<std::string>{});
}

}  // namespace
