// The loop's link to physics by `link: pipe`: what it refuses counts as what the bus refuses does.
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <limits>
#include <string>
#include <thread>

#include "haptic_node/bus_link.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/topic_directory.hpp"

namespace haptic {
namespace {

TEST(PipeLink, CountsWhatWasNotSaneAmongTheRefusedSamplesOfPhysics) {
  rtbus::Session session;
  session.name = "pipelink" + std::to_string(::getpid());
  auto server = rtbus::PacketPipe::serve(session, "haptic0");
  ASSERT_TRUE(server) << server.error();
  auto topic = rtbus::Publication<rtbus::DeviceState>::create(session, "haptic0.device_state", {.capacity = 4});
  ASSERT_TRUE(topic);
  rtbus::config::LinkConfig wire;
  wire.pipe = true;
  wire.rate_hz = 500.0;
  {
    BusLink link(std::move(*topic), session, "haptic0", true, false, wire, {});
    std::atomic<bool> stop{false};
    std::thread work([&] { link.pipe()->run(stop); });
    rtbus::Stamped<rtbus::ProxyState> wrong;
    wrong.value.position_m[0] = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(server->send(wrong));
    const std::uint64_t end_ns = rtbus::monotonic_ns() + 10 * rtbus::kNsPerS;
    while (link.refused() == 0 && rtbus::monotonic_ns() < end_ns) std::this_thread::yield();
    EXPECT_EQ(link.refused(), 1u);
    stop = true;
    work.join();
  }
  (void)rtbus::remove_dead(session.name);
}

}  // namespace
}  // namespace haptic
