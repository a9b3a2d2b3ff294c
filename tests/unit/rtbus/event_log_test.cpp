#include "rtbus/event_log.hpp"

#include <gtest/gtest.h>

#include <thread>
#include <vector>

namespace rtbus {
namespace {

TEST(EventLog, HandsOverInOrderWithAllFigures) {
  EventLog log(8);
  EXPECT_TRUE(log.push(10, 1, 0.5, 1.5, 2.5));
  EXPECT_TRUE(log.push(20, 2));
  std::vector<Event> got;
  EXPECT_EQ(log.drain([&](const Event& event) { got.push_back(event); }), 2u);
  ASSERT_EQ(got.size(), 2u);
  EXPECT_EQ(got[0].stamp_ns, 10u);
  EXPECT_EQ(got[0].code, 1);
  EXPECT_EQ(got[0].values[2], 2.5);
  EXPECT_EQ(got[1].code, 2);
  EXPECT_EQ(log.drain([](const Event&) { FAIL(); }), 0u);
}

TEST(EventLog, DropsTheNewestWhenFullAndCounts) {
  EventLog log(4);
  for (int i = 0; i < 7; ++i) EXPECT_EQ(log.push(0, i), i < 4);
  EXPECT_EQ(log.dropped(), 3u);
  std::vector<int> codes;
  log.drain([&](const Event& event) { codes.push_back(event.code); });
  EXPECT_EQ(codes, (std::vector<int>{0, 1, 2, 3}));
  EXPECT_TRUE(log.push(0, 8));
}

TEST(EventLog, NothingIsLostOrMixedBetweenTwoThreads) {
  EventLog log(64);
  constexpr int kEvents = 100'000;
  std::thread producer([&] {
    for (int i = 0; i < kEvents; ++i) log.push(static_cast<std::uint64_t>(i), i, i, -i, 2.0 * i);
  });
  std::uint64_t received = 0;
  int last = -1;
  bool whole = true;
  const auto take = [&](const Event& event) {
    ++received;
    whole = whole && event.code > last && event.stamp_ns == static_cast<std::uint64_t>(event.code) &&
            event.values[1] == -event.code && event.values[2] == 2.0 * event.code;
    last = event.code;
  };
  while (received + log.dropped() < kEvents) log.drain(take);
  producer.join();
  log.drain(take);
  EXPECT_TRUE(whole);
  EXPECT_EQ(received + log.dropped(), static_cast<std::uint64_t>(kEvents));
}

}  // namespace
}  // namespace rtbus
