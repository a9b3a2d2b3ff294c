/// The realtime path allocates nothing: ten thousand cycles of the real loop, with the real device simulation and the
/// real bus, physics answering on the other end.
#include "tests/support/no_alloc.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <ostream>
#include <string>
#include <vector>

#include "haptic_node/bus_link.hpp"
#include "haptic_node/loop.hpp"
#include "haptic_node/rendering/registry.hpp"
#include "physics_node/engine_registry.hpp"
#include "physics_node/stepper.hpp"
#include "rtbus/event_log.hpp"
#include "rtbus/pacer.hpp"

#if !defined(RTBUS_SANITIZED)
namespace {

TEST(AllocationTrap, CatchesWhatItShouldCatch) {
  void* (*volatile allocate)(std::size_t) = &::operator new;  // volatile: the compiler may not pair and drop them
  void (*volatile release)(void*) = &::operator delete;
  tests::AllocationTrap trap;
  release(allocate(24));
  std::vector<int> growing;
  growing.reserve(100);
  EXPECT_GE(trap.count(), 3u);
}

/// A session, and the method it is run with; none: the file's own.
struct Run {
  const char* file;
  const char* method;
};
void PrintTo(const Run& run, std::ostream* out) { *out << run.file << ' ' << run.method; }

class LoopOnTheBus : public testing::TestWithParam<Run> {};

TEST_P(LoopOnTheBus, AllocatesNothingInTenThousandCycles) {
  const std::string file = std::string(RTBUS_SOURCE_DIR) + "/config/" + GetParam().file;
  std::vector<rtbus::config::Override> overrides{
      rtbus::config::parse_override("session=noalloc" + std::to_string(getpid()))};
  const std::string method = GetParam().method;
  if (!method.empty()) overrides.push_back(rtbus::config::parse_override("haptic.0.method=" + method));
  auto settings = rtbus::config::load_session(file, overrides);
  const haptic::HapticConfig config = haptic::read_haptic_config(settings, 0);
  const bool loop_needs_physics = haptic::find_renderer(config.method)->needs_physics;
  const bool loop_needs_contacts = haptic::find_renderer(config.method)->needs_contacts;
  auto device = config.device->open({.session = settings.session, .node_name = config.name});
  ASSERT_TRUE(device) << device.error().message;

  auto device_state = rtbus::Publication<rtbus::DeviceState>::create(settings.session, "haptic0.device_state");
  auto telemetry = rtbus::Publication<rtbus::Telemetry>::create(settings.session, "haptic0.telemetry");
  ASSERT_TRUE(device_state && telemetry);
  haptic::BusLink link(std::move(*device_state), settings.session, "haptic0", loop_needs_physics, loop_needs_contacts,
                       config.wire);
  haptic::Loop loop(config, **device, link, true);
  rtbus::EventLog events;

  // The other end, in this thread: one physics step per haptic tick.
  std::unique_ptr<physics::Stepper> stepper;
  std::optional<rtbus::Reader<rtbus::DeviceState>> hand;
  std::optional<rtbus::Writer<rtbus::ProxyState>> proxy;
  std::optional<rtbus::Writer<rtbus::ProxyContacts>> contacts;
  std::optional<rtbus::Writer<rtbus::Heartbeat>> beat;
  if (loop_needs_physics) {
    stepper = std::make_unique<physics::Stepper>(
        physics::make_world("analytic", settings.scene),
        std::vector<physics::ProxyConfig>{physics::read_proxy_config(settings.haptic[0])}, 1);
    hand.emplace(*rtbus::Reader<rtbus::DeviceState>::open(settings.session, "haptic0.device_state"));
    proxy.emplace(*rtbus::Writer<rtbus::ProxyState>::create(settings.session, "physics.proxy_state.haptic0"));
    beat.emplace(*rtbus::Writer<rtbus::Heartbeat>::create(settings.session, "physics.heartbeat"));
  }
  if (loop_needs_contacts) {
    contacts.emplace(*rtbus::Writer<rtbus::ProxyContacts>::create(settings.session, "physics.contacts.haptic0"));
  }
  link.maintain();

  std::uint64_t now_ns = rtbus::monotonic_ns();
  ASSERT_TRUE((*device)->start(now_ns));
  rtbus::Stamped<rtbus::DeviceState> seen;
  double peak_n = 0.0;
  std::uint64_t allocations = 0;
  rtbus::Pacer pacer(now_ns, config.period_ns());
  for (int tick = 0; tick < 10'000; ++tick) {
    now_ns = pacer.due_ns();
    if (stepper) {
      if (hand->read_latest(seen) == rtbus::ReadStatus::kFresh) stepper->set_device(0, seen.value, seen.sequence);
      stepper->step(1e-3);
      proxy->publish(stepper->answer(0), now_ns);
      if (contacts) {
        rtbus::ProxyContacts around;
        stepper->contacts(0, 0.0, around);
        contacts->publish(around, now_ns);
      }
      rtbus::Heartbeat alive;
      alive.state = static_cast<std::uint32_t>(rtbus::NodeState::kRunning);
      beat->publish(alive, now_ns);
    }
    // Somebody deletes the topics: housekeeping makes them anew, the loop writes old and new ones, then lets go.
    if (tick == 4000) {
      for (const char* subject : {"device_state", "telemetry"}) {
        const std::string name = rtbus::segment_name(settings.session.name, std::string("haptic0.") + subject);
        ASSERT_EQ(unlink(("/dev/shm/" + name).c_str()), 0);
      }
    }
    if (tick > 3000 && tick % 20 == 0) {
      link.maintain();
      telemetry->maintain();
      rtbus::sleep_until(rtbus::monotonic_ns() + 2 * rtbus::kNsPerMs);  // a hand-over lasts by the real clock
    }
    tests::AllocationTrap trap;
    loop.cycle(now_ns, now_ns);
    telemetry->publish(loop.telemetry(), now_ns);
    while (loop.take_event() != haptic::LoopEvent::kNone) events.push(now_ns, 1);
    pacer.advance(now_ns);
    loop.count_schedule(pacer.due(), pacer.overruns());
    allocations += trap.count();
    peak_n = std::max(peak_n, std::abs(loop.telemetry().force_n[1]));
  }
  EXPECT_EQ(allocations, 0u);
  EXPECT_EQ(telemetry->renewals(), 1u);
  EXPECT_EQ(link.device_state().renewals(), 1u);
  EXPECT_TRUE(rtbus::Reader<rtbus::Telemetry>::open(settings.session, "haptic0.telemetry"));
  EXPECT_GT(peak_n, 0.5) << "the run must have touched the wall, else it proves little";
  (*device)->stop();
}

INSTANTIATE_TEST_SUITE_P(Sessions, LoopOnTheBus,
                         testing::Values(Run{"wall.yaml", ""}, Run{"drop.yaml", ""},
                                         Run{"drop.yaml", "virtual_coupling"}, Run{"wall.yaml", "local_contact"},
                                         Run{"wall.yaml", "interpolation"}, Run{"wall.yaml", "interpolation_predicted"},
                                         Run{"drop_paper.yaml", "interpolation"},
                                         Run{"drop_paper.yaml", "interpolation_predicted"},
                                         Run{"drop_paper.yaml", "remote_virtual_coupling"},
                                         Run{"drop_paper.yaml", "virtual_coupling"}));

}  // namespace
#endif
