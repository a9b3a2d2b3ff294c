// Order, counting and the bounds of the copying protocol.
#include "rtbus/detail/seqlock.hpp"

#include "rtbus/topic.hpp"
#include "tests/unit/rtbus/scratch_session.hpp"

namespace rtbus {
namespace {

using test::Probe;
using test::ScratchSession;

TEST(Reader, NothingPublishedIsTheSame) {
  ScratchSession session;
  auto writer = Writer<Probe>::create(session, "x");
  auto reader = Reader<Probe>::open(session, "x");
  ASSERT_TRUE(reader);
  Stamped<Probe> got;
  got.value.number = 77;
  EXPECT_EQ(reader->read_latest(got), ReadStatus::kSame);
  EXPECT_EQ(reader->read_next(got), ReadStatus::kSame);
  EXPECT_EQ(got.value.number, 77u);
}

TEST(Reader, LatestSkipsToTheNewestAndThenIsTheSame) {
  ScratchSession session;
  auto writer = Writer<Probe>::create(session, "x", {.capacity = 4});
  auto reader = Reader<Probe>::open(session, "x");
  ASSERT_TRUE(reader);
  Stamped<Probe> got;
  for (std::uint64_t n = 1; n <= 23; ++n) writer->publish({n, 0.5, {1, 2, 3}}, 1000 + n);
  ASSERT_EQ(reader->read_latest(got), ReadStatus::kFresh);
  EXPECT_EQ(got.sequence, 23u);
  EXPECT_EQ(got.stamp_ns, 1023u);
  EXPECT_EQ(got.value.number, 23u);
  EXPECT_EQ(got.value.vector[2], 3.0);
  EXPECT_EQ(reader->read_latest(got), ReadStatus::kSame);
}

TEST(Reader, LateReaderGetsTheNewestSampleAtOnce) {
  ScratchSession session;
  auto writer = Writer<Probe>::create(session, "x");
  writer->publish({.number = 1}, 1);
  auto reader = Reader<Probe>::open(session, "x");
  ASSERT_TRUE(reader);
  Stamped<Probe> got;
  EXPECT_EQ(reader->read_next(got), ReadStatus::kSame) << "in order means from now on";
  EXPECT_EQ(reader->read_latest(got), ReadStatus::kFresh);
}

TEST(Reader, NextKeepsTheOrderAndMissesNothingWhileItKeepsUp) {
  ScratchSession session;
  auto writer = Writer<Probe>::create(session, "x", {.capacity = 8});
  auto reader = Reader<Probe>::open(session, "x");
  ASSERT_TRUE(reader);
  Stamped<Probe> got;
  std::uint64_t expected = 0;
  for (std::uint64_t n = 1; n <= 1000; ++n) {
    writer->publish({.number = n}, n);
    if (n % 7 != 0) continue;
    while (reader->read_next(got) == ReadStatus::kFresh) EXPECT_EQ(got.value.number, ++expected);
    EXPECT_EQ(expected, n);
  }
  EXPECT_EQ(reader->missed(), 0u);
}

TEST(Reader, OvertakenNextJumpsToTheOldestSafeSampleAndCountsTheRest) {
  for (const std::uint32_t capacity : {2u, 4u, 64u, 1024u}) {
    ScratchSession session;
    auto writer = Writer<Probe>::create(session, "x", {.capacity = capacity});
    auto reader = Reader<Probe>::open(session, "x");
    ASSERT_TRUE(reader);
    const std::uint64_t last = 5ull * capacity + 3;
    for (std::uint64_t n = 1; n <= last; ++n) writer->publish({.number = n}, n);
    Stamped<Probe> got;
    std::uint64_t read = 0;
    ASSERT_EQ(reader->read_next(got), ReadStatus::kFresh);
    EXPECT_GT(got.sequence, last - capacity);
    EXPECT_EQ(reader->missed(), got.sequence - 1);
    std::uint64_t previous = got.sequence - 1;
    do {
      ++read;
      EXPECT_EQ(got.sequence, previous + 1);
      EXPECT_EQ(got.value.number, got.sequence);
      previous = got.sequence;
    } while (reader->read_next(got) == ReadStatus::kFresh);
    EXPECT_EQ(previous, last);
    EXPECT_EQ(read + reader->missed(), last) << "every sample is either read or counted as missed";
  }
}

TEST(Reader, FromOldestReadsWhatIsStillHeld) {
  ScratchSession session;
  auto writer = Writer<Probe>::create(session, "x", {.capacity = 16});
  for (std::uint64_t n = 1; n <= 5; ++n) writer->publish({.number = n}, n);
  auto reader = Reader<Probe>::open(session, "x", {.from_oldest = true});
  ASSERT_TRUE(reader);
  Stamped<Probe> got;
  for (std::uint64_t n = 1; n <= 5; ++n) {
    ASSERT_EQ(reader->read_next(got), ReadStatus::kFresh);
    EXPECT_EQ(got.value.number, n);
  }
  EXPECT_EQ(reader->missed(), 0u);
}

/// A ring in ordinary memory, to stop the clock at any point of a publish.
struct LocalRing {
  explicit LocalRing(std::uint32_t capacity) : bytes(std::size_t{capacity} * 64) {
    view.newest = &newest;
    view.slots = reinterpret_cast<std::byte*>(bytes.data());
    view.capacity = capacity;
    view.slot_stride = 64;
    view.words = 2;
  }
  void publish(std::uint64_t n) {
    const std::uint64_t words[2] = {n, ~n};
    detail::RingWriter writer(view);
    writer.publish<2>(words, n);
  }
  struct alignas(64) Byte64 {
    std::byte raw[64];
  };
  detail::SharedU64 newest{0};
  std::vector<std::byte> bytes;
  detail::RingView view;
};

TEST(Reader, KeepsLastGoodSampleWhenLapped) {
  LocalRing ring(4);
  ring.publish(1);
  detail::RingReader reader(ring.view);
  reader.start(false);
  std::uint64_t words[2] = {}, sequence = 0, stamp_ns = 0;
  ASSERT_EQ(reader.read_latest<2>(words, sequence, stamp_ns), detail::RingRead::kFresh);
  ring.publish(2);
  ring.view.slot(2)[0].store(2 * 6 - 1);  // the writer is a whole round further on already
  EXPECT_EQ(reader.read_latest<2>(words, sequence, stamp_ns), detail::RingRead::kLapped);
  EXPECT_EQ(reader.read_next<2>(words, sequence, stamp_ns), detail::RingRead::kSame)
      << "the one lost slot is stepped over, and nothing follows it";
  EXPECT_EQ(words[0], 1u);
  EXPECT_EQ(sequence, 1u);
  EXPECT_EQ(stamp_ns, 1u);
  ring.view.slot(2)[0].store(4);
  EXPECT_EQ(reader.read_latest<2>(words, sequence, stamp_ns), detail::RingRead::kFresh);
  EXPECT_EQ(words[0], 2u);
}

TEST(Reader, SlotOfTheRoundBeforeIsNotTakenForTheNewest) {
  LocalRing ring(2);
  for (std::uint64_t n = 1; n <= 4; ++n) ring.publish(n);
  ring.newest.store(6);  // announces a sample that its slot does not hold
  detail::RingReader reader(ring.view);
  std::uint64_t words[2] = {}, sequence = 0, stamp_ns = 0;
  EXPECT_EQ(reader.read_latest<2>(words, sequence, stamp_ns), detail::RingRead::kLapped);
}

TEST(Reader, CounterAtTheLimitDoesNotWrapIntoAnEmptySlot) {
  LocalRing ring(2);
  ring.newest.store(std::uint64_t{1} << 63);  // 2n wraps to 0, which an unused slot holds
  detail::RingReader reader(ring.view);
  std::uint64_t words[2] = {}, sequence = 0, stamp_ns = 0;
  EXPECT_EQ(reader.read_latest<2>(words, sequence, stamp_ns), detail::RingRead::kLapped);
  EXPECT_EQ(reader.read_next<2>(words, sequence, stamp_ns), detail::RingRead::kLapped);
}

TEST(Reader, SizeKnownAtRunTimeReadsTheSame) {
  LocalRing ring(4);
  detail::RingReader typed(ring.view), untyped(ring.view);
  for (std::uint64_t n = 1; n <= 3; ++n) {
    ring.publish(n);
    std::uint64_t a[2] = {}, b[2] = {}, sequence = 0, stamp_ns = 0;
    ASSERT_EQ(typed.read_next<2>(a, sequence, stamp_ns), detail::RingRead::kFresh);
    ASSERT_EQ(untyped.read_next(b, sequence, stamp_ns), detail::RingRead::kFresh);
    EXPECT_EQ(a[0], b[0]);
    EXPECT_EQ(a[1], b[1]);
    EXPECT_EQ(a[0], n);
  }
}

}  // namespace
}  // namespace rtbus
