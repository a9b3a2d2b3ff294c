// A realtime reader whose writer comes and goes.
#include "rtbus/subscription.hpp"

#include <atomic>
#include <thread>

#include "rtbus/clock.hpp"
#include "tests/unit/rtbus/scratch_session.hpp"

namespace rtbus {
namespace {

using test::Child;
using test::OtherProbe;
using test::Probe;
using test::ScratchSession;

TEST(Subscription, IsDetachedUntilAWriterIsFound) {
  ScratchSession session;
  Subscription<Probe> subscription(session, "x");
  Stamped<Probe> got;
  got.value.number = 9;
  subscription.maintain();
  EXPECT_EQ(subscription.read_latest(got), ReadStatus::kDetached);
  EXPECT_EQ(subscription.read_next(got), ReadStatus::kDetached);
  EXPECT_FALSE(subscription.attached());
  EXPECT_EQ(subscription.last_error(), TopicError::kNotFound);
  EXPECT_EQ(got.value.number, 9u);

  auto writer = Writer<Probe>::create(session, "x");
  writer->publish({.number = 1}, 1);
  EXPECT_EQ(subscription.read_latest(got), ReadStatus::kDetached) << "only maintain() looks for writers";
  subscription.maintain();
  EXPECT_TRUE(subscription.attached());
  ASSERT_EQ(subscription.read_latest(got), ReadStatus::kFresh);
  EXPECT_EQ(got.value.number, 1u);
  EXPECT_EQ(subscription.read_latest(got), ReadStatus::kSame);
}

TEST(Subscription, SaysWhyItCannotAttach) {
  ScratchSession session;
  auto writer = Writer<OtherProbe>::create(session, "x");
  Subscription<Probe> subscription(session, "x");
  subscription.maintain();
  EXPECT_EQ(subscription.last_error(), TopicError::kLayoutMismatch);
}

TEST(Subscription, ReattachesToANewSegmentWhoseNumbersBeginAnew) {
  ScratchSession session;
  Subscription<Probe> subscription(session, "x");
  Stamped<Probe> got;
  {
    auto writer = Writer<Probe>::create(session, "x");
    for (std::uint64_t n = 1; n <= 50; ++n) writer->publish({.number = n}, n);
    subscription.maintain();
    ASSERT_EQ(subscription.read_latest(got), ReadStatus::kFresh);
    EXPECT_EQ(got.sequence, 50u);
  }
  subscription.maintain();
  EXPECT_FALSE(subscription.attached());
  EXPECT_EQ(subscription.read_latest(got), ReadStatus::kSame) << "the last sample stays the last";

  auto writer = Writer<Probe>::create(session, "x");
  writer->publish({.number = 1000}, 1);
  subscription.maintain();
  EXPECT_TRUE(subscription.attached());
  EXPECT_EQ(subscription.attachments(), 2u);
  ASSERT_EQ(subscription.read_latest(got), ReadStatus::kFresh);
  EXPECT_EQ(got.sequence, 1u);
  EXPECT_EQ(got.value.number, 1000u);
}

TEST(Subscription, TakeOverInPlaceNeedsNoNewAttachment) {
  ScratchSession session;
  Child child([&] {
    auto* writer = new auto(Writer<Probe>::create(session, "x"));
    if (*writer) (*writer)->publish({.number = 1}, 1);
    return writer->has_value();
  });
  Subscription<Probe> subscription(session, "x");
  subscription.maintain();
  Stamped<Probe> got;
  ASSERT_EQ(subscription.read_latest(got), ReadStatus::kFresh);
  child.kill();
  subscription.maintain();
  EXPECT_FALSE(subscription.attached());
  auto writer = Writer<Probe>::create(session, "x");
  writer->publish({.number = 2}, 2);
  ASSERT_EQ(subscription.read_latest(got), ReadStatus::kFresh);
  EXPECT_EQ(got.sequence, 2u);
  subscription.maintain();
  EXPECT_TRUE(subscription.attached());
  EXPECT_EQ(subscription.attachments(), 1u);
}

TEST(Subscription, AReaderNobodyTookIsReplacedByTheNextOne) {
  ScratchSession session;
  Subscription<Probe> subscription(session, "x");
  for (std::uint64_t n = 1; n <= 5; ++n) {
    auto writer = Writer<Probe>::create(session, "x");
    writer->publish({.number = n}, n);
    subscription.maintain();
  }
  auto writer = Writer<Probe>::create(session, "x");
  writer->publish({.number = 6}, 6);
  subscription.maintain();
  Stamped<Probe> got;
  ASSERT_EQ(subscription.read_latest(got), ReadStatus::kFresh);
  EXPECT_EQ(got.value.number, 6u);
}

TEST(Subscription, HandsOverBetweenTwoThreadsWithoutARace) {
  // For ThreadSanitizer: one thread reads as fast as it can while writers come and go under maintain().
  ScratchSession session;
  Subscription<Probe> subscription(session, "x");
  std::atomic<bool> stop{false};
  std::uint64_t fresh = 0;
  bool whole = true;
  std::thread realtime([&] {
    Stamped<Probe> got;
    while (!stop) {
      if (subscription.read_latest(got) != ReadStatus::kFresh) continue;
      ++fresh;
      whole = whole && got.value.value == static_cast<double>(got.value.number);
    }
  });
  for (int generation = 0; generation < 50; ++generation) {
    auto writer = Writer<Probe>::create(session, "x");
    for (std::uint64_t n = 1; n <= 20; ++n) {
      writer->publish({.number = n, .value = static_cast<double>(n)}, n);
      subscription.maintain();
      std::this_thread::yield();
    }
    // Give the reader its turn, so that each generation is really adopted.
    sleep_until(monotonic_ns() + kNsPerMs);
  }
  stop = true;
  realtime.join();
  EXPECT_TRUE(whole);
  EXPECT_GE(fresh, 1u);
  EXPECT_EQ(subscription.attachments(), 50u);
}

}  // namespace
}  // namespace rtbus
