// Order, counting and the bounds of the copying protocol.
#include "rtbus/detail/seqlock.hpp"

#include "rtbus/copy_rows.hpp"
#include "rtbus/topic.hpp"
#include "tests/unit/rtbus/scratch_session.hpp"

namespace rtbus {
namespace {

/// Two tables, one of whose columns ends in the middle of a word for an odd number of rows.
struct Tables {
  std::uint64_t number = 0;
  std::uint32_t points = 0, names = 0;
  std::array<double, 12> point_m{};  ///< Four rows of three.
  std::array<std::uint32_t, 4> colour{};
  std::array<std::uint64_t, 5> name{};
};

}  // namespace

template <>
struct SampleTraits<Tables> {
  static constexpr std::string_view kName = "test/Tables";
  using T = Tables;
  static constexpr std::array kFields{RTBUS_FIELD(T, number, "1"), RTBUS_FIELD(T, points, "1"),
                                      RTBUS_FIELD(T, names, "1"),  RTBUS_FIELD(T, point_m, "m"),
                                      RTBUS_FIELD(T, colour, "1"), RTBUS_FIELD(T, name, "1")};
  static constexpr std::array kTables{RTBUS_TABLE(T, points, point_m, colour, 4), RTBUS_TABLE(T, names, name, name, 5)};
};

namespace {

static_assert(TabularSample<Tables>);

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

/// A sample in which nothing is zero, with so many rows used.
Tables filled(std::uint32_t points, std::uint32_t names) {
  Tables out{.number = 9, .points = points, .names = names};
  out.point_m.fill(1.5);
  out.colour.fill(7);
  out.name.fill(11);
  return out;
}

TEST(Reader, RowsThatAreNotCountedKeepWhatTheyHad) {
  ScratchSession session;
  auto writer = Writer<Tables>::create(session, "x");
  auto reader = Reader<Tables>::open(session, "x");
  ASSERT_TRUE(reader);
  Stamped<Tables> got;
  writer->publish(filled(3, 0), 5);
  ASSERT_EQ(reader->read_latest_rows(got), ReadStatus::kFresh);
  EXPECT_EQ(got.sequence, 1u);
  EXPECT_EQ(got.stamp_ns, 5u);
  EXPECT_EQ(got.value.number, 9u);
  EXPECT_EQ(got.value.points, 3u);
  for (std::size_t i = 0; i < 12; ++i) EXPECT_EQ(got.value.point_m[i], i < 9 ? 1.5 : 0.0) << i;
  EXPECT_EQ(got.value.colour, (std::array<std::uint32_t, 4>{7, 7, 7, 7})) << "whole words: the fourth comes along";
  EXPECT_EQ(got.value.name, (std::array<std::uint64_t, 5>{}));
  EXPECT_EQ(reader->read_latest_rows(got), ReadStatus::kSame);
  writer->publish(filled(0, 2), 6);
  ASSERT_EQ(reader->read_latest_rows(got), ReadStatus::kFresh);
  EXPECT_EQ(got.value.point_m[8], 1.5) << "from the sample before";
  EXPECT_EQ(got.value.name, (std::array<std::uint64_t, 5>{11, 11, 0, 0, 0}));
}

TEST(CopyRows, CopiesWhatAReaderOfRowsCopies) {
  ScratchSession session;
  auto writer = Writer<Tables>::create(session, "x");
  auto reader = Reader<Tables>::open(session, "x");
  ASSERT_TRUE(reader);
  for (const std::uint32_t points : {0U, 3U, 4U, 0xffffffffU}) {
    for (const std::uint32_t names : {0U, 2U, 5U, 6U}) {
      Stamped<Tables> read;
      Tables copied;
      writer->publish(filled(points, names), 5);
      ASSERT_EQ(reader->read_latest_rows(read), ReadStatus::kFresh);
      copy_rows(filled(points, names), copied);
      EXPECT_EQ(std::memcmp(&copied, &read.value, sizeof copied), 0) << points << ' ' << names;
    }
  }
}

TEST(Reader, CountsThatMakeNoSenseDoNotLeadOutOfTheTable) {
  ScratchSession session;
  auto writer = Writer<Tables>::create(session, "x");
  auto reader = Reader<Tables>::open(session, "x");
  ASSERT_TRUE(reader);
  struct {
    Stamped<Tables> got;
    std::array<std::uint64_t, 64> behind{};
  } room;
  writer->publish(filled(0xffffffff, 6), 5);
  ASSERT_EQ(reader->read_latest_rows(room.got), ReadStatus::kFresh);
  EXPECT_EQ(room.got.value.points, 0xffffffff) << "as published: whoever uses it must bound it";
  EXPECT_EQ(room.got.value.point_m, filled(4, 5).point_m);
  EXPECT_EQ(room.got.value.name, filled(4, 5).name);
  EXPECT_EQ(room.behind, (std::array<std::uint64_t, 64>{}));
}

}  // namespace
}  // namespace rtbus
