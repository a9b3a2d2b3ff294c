#include "rtbus/pacer.hpp"

#include <gtest/gtest.h>

#include <random>

namespace {

using rtbus::Pacer;

TEST(Pacer, KeepsItsDeadlinesWhenCyclesAreShort) {
  Pacer pacer(1000, 100);
  for (std::uint64_t k = 1; k <= 50; ++k) {
    EXPECT_EQ(pacer.due_ns(), 1000 + 100 * k);
    EXPECT_EQ(pacer.advance(pacer.due_ns() + 99), 0u);
  }
  EXPECT_EQ(pacer.served(), 50u);
  EXPECT_EQ(pacer.overruns(), 0u);
}

TEST(Pacer, SkipsWhatHasPassedInsteadOfCatchingUp) {
  Pacer pacer(0, 100);
  EXPECT_EQ(pacer.advance(450), 3u) << "200, 300 and 400 have passed";
  EXPECT_EQ(pacer.due_ns(), 500u);
  EXPECT_EQ(pacer.advance(600), 1u) << "a deadline that is just now counts as missed";
  EXPECT_EQ(pacer.due_ns(), 700u);
}

TEST(Pacer, AccountsForEveryPeriodOnce) {
  std::mt19937 random(3);
  Pacer pacer(0, 1000);
  for (int k = 0; k < 10'000; ++k) {
    const std::uint64_t begun = pacer.due_ns();
    pacer.advance(begun + random() % 5000);
    EXPECT_EQ(pacer.due_ns() % 1000, 0u);
    ASSERT_EQ(pacer.due() * 1000 + 1000, pacer.due_ns());
    ASSERT_EQ(pacer.served() + pacer.overruns(), pacer.due());
  }
}

}  // namespace
