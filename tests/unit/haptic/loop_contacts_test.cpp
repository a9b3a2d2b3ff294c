// When the loop works on what physics says about the surroundings of the proxy.
#include <gtest/gtest.h>

#include <string>

#include "haptic_node/loop.hpp"
#include "rtbus/config/session.hpp"
#include "tests/unit/haptic/resting_device.hpp"

namespace {

using haptic::test::RestingDevice;

constexpr std::uint64_t kPeriod_ns = 1'000'000;

/// The proxy is at the hand; a floor is there from one answer on, 2 mm above it. While none is due, `out` is scribbled
/// on, as a copy that failed would.
class OneFloor final : public haptic::PhysicsLink {
 public:
  explicit OneFloor(double step_s) : step_s_(step_s) {}
  void send(const rtbus::DeviceState& state, std::uint64_t now_ns) noexcept RTBUS_NONBLOCKING override {
    if (proxy_.sequence == 0) hand_m_ = state.target_position_m;
    proxy_.stamp_ns = now_ns;
    ++proxy_.sequence;
    proxy_.value.device_sequence = proxy_.sequence;
    proxy_.value.device_time_ns = state.sample_time_ns;
    proxy_.value.mapping_epoch = state.mapping_epoch;
    proxy_.value.position_m = hand_m_;
    proxy_.value.step_s = step_s_;
    ++proxy_.value.step_index;
  }
  [[nodiscard]] bool receive(rtbus::Stamped<rtbus::ProxyState>& out) noexcept RTBUS_NONBLOCKING override {
    out = proxy_;
    return proxy_.sequence != 0;
  }
  [[nodiscard]] bool receive(rtbus::Stamped<rtbus::ProxyContacts>& out) noexcept RTBUS_NONBLOCKING override {
    out.value = {};
    if (!due) return false;
    due = false;
    out.value.device_sequence = proxy_.value.device_sequence;
    out.value.device_time_ns = proxy_.value.device_time_ns;
    out.value.mapping_epoch = proxy_.value.mapping_epoch;
    out.value.step_s = step_s_;
    out.value.contacts = out.value.bodies = 1;
    out.value.contact_normal[0] = {0, 1, 0};
    out.value.contact_point_m[0] = {hand_m_[0], hand_m_[1] + 0.002, hand_m_[2]};
    out.value.body_centre_m[0] = out.value.contact_point_m[0];
    return true;
  }
  [[nodiscard]] bool receive(rtbus::Stamped<rtbus::Heartbeat>& out) noexcept RTBUS_NONBLOCKING override {
    out.stamp_ns = proxy_.stamp_ns;
    out.value.state = static_cast<std::uint32_t>(rtbus::NodeState::kRunning);
    out.value.work_period_ns = kPeriod_ns;
    return proxy_.sequence != 0;
  }

  bool due = false;

 private:
  double step_s_;
  rtbus::Vec3 hand_m_{};
  rtbus::Stamped<rtbus::ProxyState> proxy_{};
};

/// In how many ticks after the one in which the answer was there its floor pushes.
int ticks_until_felt(double step_s) {
  rtbus::config::SessionConfig session =
      rtbus::config::load_session(std::string(RTBUS_SOURCE_DIR) + "/config/wall.yaml",
                                  {rtbus::config::parse_override("haptic.0.method=local_contact")});
  const haptic::HapticConfig config = haptic::read_haptic_config(session, 0);
  RestingDevice device(config.device->info());
  OneFloor link(step_s);
  haptic::Loop loop(config, device, link, false);
  std::uint64_t now_ns = 1'000'000'000;
  const auto push_n = [&] {
    now_ns += kPeriod_ns;
    loop.cycle(now_ns, now_ns);
    return loop.telemetry().rendered_force_n[1];
  };
  for (int tick = 0; tick < 100; ++tick) EXPECT_EQ(push_n(), 0.0);
  link.due = true;
  for (int tick = 0; tick < 5; ++tick) {
    if (push_n() > 0.0) return tick;
  }
  return -1;
}

TEST(LoopContacts, AreWorkedOnATickAfterTheyWereFetchedWhereAnswersAreFarApart) {
  EXPECT_EQ(ticks_until_felt(0.008), 1);
  EXPECT_EQ(ticks_until_felt(0.2), 1);
}

TEST(LoopContacts, AreWorkedOnAtOnceWhereTheNextAnswerIsNear) {
  EXPECT_EQ(ticks_until_felt(0.001), 0);
  EXPECT_EQ(ticks_until_felt(0.007), 0);
}

}  // namespace
