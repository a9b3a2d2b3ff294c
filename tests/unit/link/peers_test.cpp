// Who is taken for the other end, what counts of what comes, and what is known of the other's clock.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "rtbus/clock.hpp"
#include "tools/link/peers.hpp"

namespace {

using namespace link_dds;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr std::uint64_t kS = rtbus::kNsPerS, kMs = rtbus::kNsPerMs;

const std::vector<std::string> kNodes{"physics", "haptic0", "haptic1"};

PeerHello self() { return {kVersion, 11, 1, 1, "lab", {"haptic0"}, false}; }
PeerHello physics(std::uint64_t life, std::uint64_t supervisor) {
  return {kVersion, 11, life, supervisor, "lab", {"physics"}, false};
}

TEST(LinkPeers, TheFirstThatFitsSpeaks) {
  Peers peers(self(), kNodes, kS);
  EXPECT_FALSE(peers.accepts("physics", 7, 0));
  EXPECT_THAT(peers.hear(physics(7, 70), 0), ElementsAre(HasSubstr("physics is there")));
  EXPECT_THAT(peers.hear(physics(7, 70), kMs), IsEmpty());
  EXPECT_TRUE(peers.accepts("physics", 7, kMs));
  EXPECT_FALSE(peers.accepts("haptic1", 7, kMs));
  EXPECT_EQ(peers.life_of("physics"), 7u);
}

TEST(LinkPeers, WhoDoesNotFitIsRefusedOnceWithItsReason) {
  Peers peers(self(), kNodes, kS);
  (void)peers.hear(physics(7, 70), 0);
  PeerHello other = physics(8, 80);
  other.version = kVersion + 1;
  EXPECT_THAT(peers.hear(other, 0), ElementsAre(HasSubstr("same release")));
  EXPECT_THAT(peers.hear(other, 0), IsEmpty()) << "told once";
  other = physics(9, 90);
  other.layout = 12;
  EXPECT_THAT(peers.hear(other, 0), ElementsAre(HasSubstr("another layout")));
  other = physics(10, 100);
  other.session = "elsewhere\n";
  EXPECT_THAT(peers.hear(other, 0),
              ElementsAre(testing::AllOf(HasSubstr("session 'elsewhere?'"), HasSubstr("network.domain"))));
  other = physics(11, 110);
  other.nodes = {"haptic0"};
  EXPECT_THAT(peers.hear(other, 0), ElementsAre(HasSubstr("runs here")));
  EXPECT_EQ(peers.refused_peers(), 4u);
  EXPECT_TRUE(peers.accepts("physics", 7, 1)) << "the first goes on";
  for (const std::uint64_t life : {8, 9, 10, 11}) EXPECT_FALSE(peers.accepts("physics", life, 1));
  EXPECT_EQ(peers.refused_packets(), 4u);
}

TEST(LinkPeers, ANodeThatTheSessionHasNotIsRefusedAndNotRemembered) {
  Peers peers(self(), kNodes, kS);
  PeerHello other = physics(8, 80);
  other.nodes = {"physics", "haptic7"};
  EXPECT_THAT(peers.hear(other, 0), ElementsAre(testing::AllOf(HasSubstr("haptic7"), HasSubstr("session file"))));
  EXPECT_EQ(peers.life_of("haptic7"), 0u);
  EXPECT_FALSE(peers.accepts("physics", 8, 0));
}

TEST(LinkPeers, ASecondOneWaitsUntilTheFirstHasBeenSilent) {
  Peers peers(self(), kNodes, kS);
  (void)peers.hear(physics(7, 70), 0);
  EXPECT_THAT(peers.hear(physics(8, 80), kMs), ElementsAre(HasSubstr("another peer")));
  EXPECT_TRUE(peers.accepts("physics", 7, 900 * kMs));  // a packet is a sign of life too
  EXPECT_THAT(peers.hear(physics(8, 80), 1500 * kMs), IsEmpty());
  EXPECT_EQ(peers.life_of("physics"), 7u);
  EXPECT_THAT(peers.hear(physics(8, 80), 1901 * kMs), ElementsAre(HasSubstr("physics is there")));
  EXPECT_TRUE(peers.accepts("physics", 8, 2 * kS));
  EXPECT_FALSE(peers.accepts("physics", 7, 2 * kS));
}

TEST(LinkPeers, ASuccessorOfTheSameSupervisorIsTakenAtOnceAndOneThatLeavesMakesRoom) {
  Peers peers(self(), kNodes, kS);
  (void)peers.hear(physics(7, 70), 0);
  (void)peers.hear(physics(8, 70), kMs);
  EXPECT_EQ(peers.life_of("physics"), 8u);
  PeerHello leaving = physics(8, 70);
  leaving.leaving = true;
  EXPECT_THAT(peers.hear(leaving, 2 * kMs), ElementsAre("physics has left"));
  (void)peers.hear(physics(9, 90), 3 * kMs);
  EXPECT_EQ(peers.life_of("physics"), 9u);
}

TEST(LinkPeers, AFloodOfStrangersIsNotToldWithoutEnd) {
  Peers peers(self(), kNodes, kS);
  std::size_t told = 0;
  for (std::uint64_t life = 100; life < 5100; ++life) {
    PeerHello other = physics(life, life);
    other.session = "x";
    told += peers.hear(other, 0).size();
  }
  EXPECT_LE(told, 64u);
  EXPECT_EQ(peers.refused_peers(), 5000u);
}

TEST(LinkNewestWins, OlderAndDuplicateOnesAreDropped) {
  NewestWins newest;
  EXPECT_TRUE(newest.takes(1, 5));  // it came into a stream that was under way
  EXPECT_FALSE(newest.takes(1, 5));
  EXPECT_TRUE(newest.takes(1, 8));
  EXPECT_EQ(newest.lost(), 2u - 0u);
  EXPECT_FALSE(newest.takes(1, 7));  // late, not lost
  EXPECT_EQ(newest.lost(), 1u);
  EXPECT_EQ(newest.late(), 2u);
  EXPECT_TRUE(newest.takes(2, 1)) << "another life numbers anew";
  EXPECT_EQ(newest.received(), 3u);
}

TEST(LinkClock, OffsetIsWithinItsBoundWhateverTheJitter) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> jitter(0.0, 1.0);
  constexpr std::int64_t kOffset_ns = -5'000'000'000;
  ClockOffset clock;
  std::uint64_t here_ns = 100 * kS;
  double worst = 0.0;
  for (int i = 0; i < 5000; ++i) {
    here_ns += kMs;
    const auto forth_ns = static_cast<std::uint64_t>(20e6 * (1.0 + 0.3 * jitter(random)));
    const auto back_ns = static_cast<std::uint64_t>(30e6 * (1.0 + 0.3 * jitter(random)));
    const std::uint64_t came_ns = here_ns + forth_ns + kOffset_ns, left_ns = came_ns + 2 * kMs;
    const std::uint64_t now_ns = here_ns + forth_ns + 2 * kMs + back_ns;
    clock.add(here_ns, came_ns, left_ns, now_ns);
    const auto estimate = clock.estimate(now_ns);
    ASSERT_TRUE(estimate);
    EXPECT_LE(std::abs(estimate->offset_s + 5.0), estimate->error_s);
    if (i > 500) worst = std::max(worst, estimate->error_s);
    EXPECT_GE(estimate->round_trip_s, 0.050);
  }
  EXPECT_LT(worst, 0.028);  // near half the least delay, and not half the mean one (28.75 ms)
  EXPECT_FALSE(clock.estimate(here_ns + 10 * kS)) << "of long ago";
  ClockOffset none;
  none.add(here_ns, 5, 4, here_ns + 1);  // answered before it came
  none.add(here_ns + 5, 1, 2, here_ns);  // here before it left
  EXPECT_FALSE(none.estimate(here_ns));
}

TEST(LinkClock, TimesOfAnotherMachineAreNeverInTheFutureAndKeepTheirDistances) {
  for (const std::int64_t offset_ns : {std::int64_t{-90'000'000'000}, std::int64_t{700'000'000'000}}) {
    std::mt19937 random(9);
    TimeShift shift;
    std::uint64_t before_ns = 0, now_ns = 0;
    for (std::uint64_t i = 0; i < 3000; ++i) {
      const std::uint64_t measured_ns = 1000 * kS + i * kMs;
      now_ns = std::max(now_ns, measured_ns + 20 * kMs + random() % (6 * kMs));
      const std::uint64_t here_ns = shift.here(measured_ns + static_cast<std::uint64_t>(offset_ns), now_ns);
      EXPECT_LE(here_ns, now_ns);
      if (i > 200) {
        EXPECT_NEAR(static_cast<double>(here_ns - before_ns), 1e6, 0.5e6);
      }
      before_ns = here_ns;
    }
  }
}

// What a peer says of its clock may be anything. It was later than now, by centuries.
TEST(LinkClock, NoTimeOfAPeerIsLaterThanNow) {
  const std::uint64_t now_ns = 1000 * kS, far_ns = std::uint64_t{1} << 62;
  for (const std::uint64_t first_ns : {std::uint64_t{0}, now_ns, far_ns, 2 * far_ns + now_ns, ~std::uint64_t{0}}) {
    for (const std::uint64_t then_ns : {std::uint64_t{0}, now_ns, far_ns, 2 * far_ns + now_ns, ~std::uint64_t{0}}) {
      TimeShift shift;
      EXPECT_EQ(shift.here(first_ns, now_ns), now_ns) << first_ns;
      EXPECT_LE(shift.here(then_ns, now_ns + kS), now_ns + kS) << first_ns << ", " << then_ns;
      EXPECT_LE(shift.here(first_ns, far_ns), far_ns) << first_ns << ", " << then_ns << ", and a drift of centuries";
    }
  }
}

TEST(LinkClock, EchoesAreThoseOfTheHand) {
  Echoes echoes;
  EXPECT_FALSE(echoes.find(5));
  for (std::uint64_t i = 1; i <= 20000; ++i) echoes.remember(i, {i + 7, i + 9});
  const auto newest = echoes.find(20000);
  ASSERT_TRUE(newest);
  EXPECT_EQ(newest->device_time_ns, 20007u);
  EXPECT_EQ(newest->device_sequence, 20009u);
  EXPECT_TRUE(echoes.find(4000));
  EXPECT_FALSE(echoes.find(3000)) << "too old";
}

}  // namespace
