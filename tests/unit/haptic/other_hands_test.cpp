/// What another hand of the session does to a body that this one touches.
#include "haptic_node/rendering/other_hands.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "haptic_node/rendering/local_world.hpp"
#include "rtbus/clock.hpp"

namespace other_hands_test {

using haptic::Impulse;
using haptic::LocalWorld;
using haptic::OtherHand;
using haptic::OtherHands;
using rtbus::DeviceState;
using rtbus::ProxyContacts;

constexpr std::uint64_t kTick_ns = rtbus::kNsPerMs;
constexpr std::uint32_t kBody = 7;

/// The second hand of the session, which pushes one body along x.
struct Pusher {
  std::vector<OtherHand> hands{1};
  std::uint64_t now_ns = 1000 * kTick_ns;

  Pusher() {
    hands[0].number = 1;
    DeviceState& state = hands[0].state.value;
    state.wants = rtbus::kWantsContacts | rtbus::kOwnsProxy;
    state.enabled = 1;
    state.mapping_epoch = 5;
    state.hand_impulse_body[0] = kBody;
    state.hand_impulse_generation[0] = 1;
  }
  /// @param repeats Its device has no newer sample.
  void tick(double impulse_n_s, bool repeats = false) {
    now_ns += kTick_ns;
    DeviceState& state = hands[0].state.value;
    state.hand_impulse_n_s[0][0] += impulse_n_s;
    if (!repeats) state.sample_time_ns = now_ns;
    hands[0].fresh = true;
  }
};

/// Physics had that of the second hand by `told_ns`.
ProxyContacts answer(std::uint64_t told_ns) {
  ProxyContacts out;
  out.hands = 2;
  out.hand_time_ns[1] = told_ns;
  return out;
}

struct OtherHandsTest : testing::Test {
  Pusher pusher;
  OtherHands others{1};
  double heard_n_s = 0.0;

  /// @param own_ns Of the own sample; 0: that of the other hand.
  void hear(std::uint64_t own_ns = 0) {
    others.hear(pusher.hands, own_ns > 0 ? own_ns : pusher.now_ns, [this](std::uint32_t body, const Impulse& more) {
      EXPECT_EQ(body, kBody);
      heard_n_s += more.linear_n_s.x();
    });
    pusher.hands[0].fresh = false;
  }
  [[nodiscard]] double since(std::uint64_t told_ns, std::uint64_t until_ns) const {
    const ProxyContacts told = answer(told_ns);
    return OtherHands::Since(others, told, kBody).until(until_ns).linear_n_s.x();
  }
};

TEST_F(OtherHandsTest, EachImpulseIsHeardOnceAndWhatPhysicsHadIsNotReplayed) {
  pusher.tick(0.5);
  hear();
  EXPECT_EQ(heard_n_s, 0.0) << "of before nothing is known";
  const std::uint64_t began_ns = pusher.now_ns;
  for (int i = 0; i < 10; ++i) {
    pusher.tick(1e-3);
    hear();
    hear();  // nothing new
  }
  EXPECT_NEAR(heard_n_s, 10e-3, 1e-12);
  EXPECT_NEAR(since(began_ns, pusher.now_ns), 10e-3, 1e-12);
  EXPECT_NEAR(since(began_ns + 4 * kTick_ns, pusher.now_ns), 6e-3, 1e-12);
  EXPECT_NEAR(since(began_ns + 4 * kTick_ns, began_ns + 7 * kTick_ns), 3e-3, 1e-12);
  EXPECT_EQ(since(began_ns + 4 * kTick_ns, began_ns), 0.0) << "earlier than what physics had";
  EXPECT_EQ(since(0, pusher.now_ns), 0.0) << "physics has nothing of that hand";
  const ProxyContacts told = answer(began_ns);
  EXPECT_TRUE(OtherHands::Since(others, told, kBody + 1).until(pusher.now_ns).is_zero());
}

// Until it is heard again it is taken to push as in its last tick; one that ends does not.
TEST_F(OtherHandsTest, TheRunningTickIsTakenFromTheLastOneAndPutRight) {
  pusher.tick(0.0);
  hear();
  pusher.tick(2e-3);
  const std::uint64_t told_ns = pusher.now_ns - kTick_ns;
  hear(pusher.now_ns + kTick_ns);
  EXPECT_NEAR(heard_n_s, 4e-3, 1e-12);
  pusher.tick(3e-3);
  hear(pusher.now_ns + kTick_ns);
  EXPECT_NEAR(heard_n_s, 8e-3, 1e-12) << "2 and 3, and 3 more for the tick that is running";
  const ProxyContacts told = answer(told_ns);
  EXPECT_NEAR(OtherHands::Since(others, told, kBody).until_now().linear_n_s.x(), 4e-3, 1e-12)
      << "what the tick before this one had";
}

// Its device repeats a sample: the hand pushes on in each tick, and no tick counts twice.
TEST_F(OtherHandsTest, ASampleThatItsDeviceRepeatsIsNoPauseInItsPush) {
  constexpr double kPush_n_s = 2e-3;
  pusher.tick(0.0);
  hear();
  for (int tick = 1; tick <= 12; ++tick) {
    pusher.tick(kPush_n_s, tick % 4 == 2);
    hear(pusher.now_ns + kTick_ns);
    EXPECT_NEAR(heard_n_s, (tick + 1) * kPush_n_s, 1e-12) << tick;
  }
  EXPECT_NEAR(since(pusher.now_ns - 8 * kTick_ns, pusher.now_ns), 8 * kPush_n_s, 1e-12);
}

// A lost message is no pause in its push; one that has been killed stops after two ticks, and has ended after six.
TEST_F(OtherHandsTest, AHandThatIsNotHeardGoesOnForTwoTicks) {
  pusher.tick(0.0);
  hear();
  pusher.tick(2e-3);
  const std::uint64_t told_ns = pusher.now_ns;
  for (int lag = 1; lag <= 2; ++lag) {
    hear(pusher.now_ns + lag * kTick_ns);
    EXPECT_NEAR(heard_n_s, 2e-3 * (1 + lag), 1e-12);
  }
  const ProxyContacts told = answer(told_ns);
  EXPECT_NEAR(OtherHands::Since(others, told, kBody).until_now().linear_n_s.x(), 2e-3, 1e-12);
  for (int lag = 3; lag <= 6; ++lag) hear(pusher.now_ns + lag * kTick_ns);
  EXPECT_NEAR(heard_n_s, 6e-3, 1e-12);
  hear(pusher.now_ns + 7 * kTick_ns);
  EXPECT_NEAR(heard_n_s, 2e-3, 1e-12) << "it has ended";
  pusher.tick(2e-3);
  hear();
  EXPECT_NEAR(heard_n_s, 4e-3, 1e-12) << "it was only late: what it gave, and no more";
}

// Where three messages in a row were lost before, three that are lost again are no pause in its push either.
TEST_F(OtherHandsTest, AHandWhoseMessagesGetLostGoesOnForLonger) {
  const auto push_for = [&](int ticks, int lost) {
    for (int i = 0; i < ticks; ++i) {
      pusher.tick(2e-3);
      if (i < ticks - lost) hear(pusher.now_ns + kTick_ns);
    }
  };
  pusher.tick(0.0);
  hear();
  push_for(10, 3);
  push_for(200, 0);
  const double before_n_s = heard_n_s;
  const std::uint64_t last_ns = pusher.now_ns;
  for (int lag = 2; lag <= 4; ++lag) {
    hear(last_ns + lag * kTick_ns);
    EXPECT_NEAR(heard_n_s - before_n_s, 2e-3 * (lag - 1), 1e-12);
  }
  hear(last_ns + 16 * kTick_ns);
  EXPECT_NEAR(heard_n_s - before_n_s, -2e-3, 1e-12) << "it has ended: what the running tick was taken to give is back";
}

// A loop that paused for long is no reason to push on for as long.
TEST_F(OtherHandsTest, AHandNeverGoesOnForMoreThanSixTicks) {
  pusher.tick(0.0);
  hear();
  pusher.now_ns += 50 * kTick_ns;
  pusher.tick(2e-3);
  hear();
  pusher.tick(2e-3);
  const double before_n_s = heard_n_s;
  for (int lag = 1; lag <= 17; ++lag) hear(pusher.now_ns + lag * kTick_ns);
  EXPECT_LE(heard_n_s - before_n_s, 2e-3 * (1 + 6));
  EXPECT_GT(heard_n_s - before_n_s, 2e-3 * (1 + 5.99));
}

// One message after a long silence, and then nothing: the push that it tells of is the mean over that silence.
TEST_F(OtherHandsTest, ASilenceIsNotHowLongAHandGoesOn) {
  pusher.tick(0.0);
  hear();
  pusher.now_ns += 299 * kTick_ns;
  pusher.tick(0.3);
  hear();
  const double before_n_s = heard_n_s;
  for (int lag = 1; lag <= 29; ++lag) hear(pusher.now_ns + lag * kTick_ns);
  EXPECT_NEAR(heard_n_s - before_n_s, 10 * 1e-3, 1e-9) << "twice the longest gap, of 5 ms";
  hear(pusher.now_ns + 31 * kTick_ns);
  EXPECT_NEAR(heard_n_s - before_n_s, 0.0, 1e-9) << "it has ended";
}

// Physics drops what lies between two mapping epochs, and what a hand without forces does.
TEST_F(OtherHandsTest, ANewStartIsNoImpulse) {
  pusher.tick(0.0);
  hear();
  pusher.tick(1e-3);
  hear();
  pusher.hands[0].state.value.mapping_epoch = 6;
  pusher.hands[0].state.value.hand_impulse_n_s[0][0] = 0.0;  // another process
  pusher.tick(0.0);
  hear();
  EXPECT_NEAR(heard_n_s, 1e-3, 1e-12);
  pusher.hands[0].state.value.enabled = 0;
  pusher.tick(1e-3);
  hear();
  EXPECT_NEAR(heard_n_s, 1e-3, 1e-12);
  pusher.hands[0].state.value.enabled = 1;
  pusher.tick(1e-3);
  hear();
  EXPECT_NEAR(heard_n_s, 2e-3, 1e-12);
}

TEST_F(OtherHandsTest, ARowThatAnotherBodyTookBeginsAtZero) {
  pusher.tick(0.0);
  hear();
  pusher.tick(3e-3);
  hear();
  pusher.hands[0].state.value.hand_impulse_generation[0] = 2;
  pusher.hands[0].state.value.hand_impulse_n_s[0][0] = 0.0;
  const std::uint64_t then_ns = pusher.now_ns;
  pusher.tick(1e-3);
  hear();
  EXPECT_NEAR(heard_n_s, 4e-3, 1e-12);
  EXPECT_NEAR(since(then_ns, pusher.now_ns), 1e-3, 1e-12);
}

// A free ball of 0.1 kg that another hand pushes: told as of a period ago, it is where those pushes have brought it.
TEST(OtherHandsInTheLocalWorld, ABodyIsReplayedWithThem) {
  Pusher pusher;
  LocalWorld world({}, 1);
  world.reset({0.1, 0, 0}, pusher.now_ns);
  const auto told = [&](double x_m, double speed_m_s, std::uint64_t time_ns) {
    ProxyContacts out = answer(time_ns);
    out.device_sequence = 1;
    out.device_time_ns = time_ns;
    out.step_s = 0.05;
    out.contacts = out.bodies = 1;
    out.proxy_position_m = {0.1, 0, 0};
    out.contact_normal[0] = {1, 0, 0};
    out.contact_point_m[0] = {x_m + 0.02, 0, 0};
    out.contact_gap_m[0] = 0.08 - x_m;
    out.body_kind[0] = 2;
    out.body_index[0] = kBody;
    out.body_centre_m[0] = {x_m, 0, 0};
    out.body_velocity_m_s[0] = {speed_m_s, 0, 0};
    out.body_inverse_mass_per_kg[0] = 10.0;
    return out;
  };
  pusher.tick(0.0);
  world.hear(pusher.hands, pusher.now_ns);
  const std::uint64_t then_ns = pusher.now_ns;
  constexpr double kForce_n = 0.2, kTick_s = 1e-3;
  for (int i = 0; i < 50; ++i) {
    pusher.tick(kForce_n * kTick_s);
    world.hear(pusher.hands, pusher.now_ns);
    world.advance({{0.1, 0, 0}, {0, 0, 0}, 300.0, 0.5}, pusher.now_ns, kTick_s);
  }
  // At rest at x = 75 mm then; 2 m/s² for 50 ms make 2.5 mm: 2.5 mm before the proxy.
  world.take(told(0.075, 0.0, then_ns), pusher.now_ns);
  double first_n = 0.0;
  int ticks = 0;
  for (; ticks < 100 && first_n == 0.0; ++ticks) {
    pusher.tick(0.0);
    world.hear(pusher.hands, pusher.now_ns);
    world.advance({{0.1, 0, 0}, {0, 0, 0}, 300.0, 0.5}, pusher.now_ns, kTick_s);
    first_n = world.impulse_n_s().x();
  }
  // At 0.1 m/s it comes to the proxy 25 ms later.
  EXPECT_NEAR(ticks, 25, 3);
}

}  // namespace other_hands_test
