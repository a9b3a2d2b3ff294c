// A segment whose file is shortened, holed or overwritten while it is in use: nobody ends, and the topic comes back.
#include <thread>

#include "rtbus/detail/mapping_guard.hpp"
#include "rtbus/publication.hpp"
#include "rtbus/subscription.hpp"
#include "tests/unit/rtbus/scratch_session.hpp"

namespace rtbus {
namespace {

using test::Probe;
using test::RawFile;
using test::ScratchSession;

class LostPages : public testing::TestWithParam<off_t> {
 protected:
  void cut(const std::string& topic) { ASSERT_EQ(::truncate(session_.path(topic).c_str(), GetParam()), 0); }
  ScratchSession session_;
};

TEST_P(LostPages, AReaderFindsNothingNewAndSaysThatTheTopicIsGone) {
  auto writer = Writer<Probe>::create(session_, "x", {.capacity = 256});
  auto reader = Reader<Probe>::open(session_, "x");
  ASSERT_TRUE(writer && reader);
  writer->publish({.number = 1}, 1);
  Stamped<Probe> got;
  ASSERT_EQ(reader->read_latest(got), ReadStatus::kFresh);
  EXPECT_FALSE(reader->replaced());
  cut("x");
  EXPECT_TRUE(reader->replaced());
  for (int i = 0; i < 1000; ++i) ASSERT_NE(reader->read_latest(got), ReadStatus::kFresh);
  EXPECT_EQ(got.value.number, 1u);
  EXPECT_FALSE(reader->wait(monotonic_ns() + kNsPerMs));
}

TEST_P(LostPages, AWriterGoesOnWhereNobodyLooks) {
  auto writer = Writer<Probe>::create(session_, "x", {.capacity = 256, .doorbell = true});
  ASSERT_TRUE(writer);
  cut("x");
  for (std::uint64_t n = 1; n <= 1000; ++n) writer->publish({.number = n}, n);
  writer->ring_doorbell();
  EXPECT_TRUE(writer->replaced());
}

TEST_P(LostPages, APublicationMakesItsTopicAnewAndSubscriptionsFollow) {
  auto publication = Publication<Probe>::create(session_, "x", {.capacity = 256});
  ASSERT_TRUE(publication);
  Subscription<Probe> subscription(session_, "x");
  Stamped<Probe> got;
  for (std::uint64_t round = 1; round <= 3; ++round) {
    publication->publish({.number = round}, round);
    subscription.maintain();
    (void)subscription.read_latest(got);
    ASSERT_EQ(got.value.number, round);
    cut("x");
    EXPECT_NE(subscription.read_latest(got), ReadStatus::kFresh);
    publication->publish({.number = 77}, round);
    publication->maintain();
    EXPECT_EQ(publication->renewals(), round);
    EXPECT_EQ(publication->last_error(), std::nullopt);
    const std::uint64_t end_ns = monotonic_ns() + Publication<Probe>::kHandOver_ns + 50 * kNsPerMs;
    while (monotonic_ns() < end_ns) {
      publication->publish({.number = 100 + round}, round);
      publication->maintain();
      subscription.maintain();
      (void)subscription.read_latest(got);
      sleep_until(monotonic_ns() + kNsPerMs);
    }
    EXPECT_EQ(got.value.number, 100 + round);
  }
}

TEST_P(LostPages, AnOpenedTopicIsNotFoundOrDamagedButNeverACrash) {
  auto writer = Writer<Probe>::create(session_, "x", {.capacity = 256});
  ASSERT_TRUE(writer);
  cut("x");
  EXPECT_FALSE(Reader<Probe>::open(session_, "x"));
  (void)list_topics(session_->name);
}

INSTANTIATE_TEST_SUITE_P(To, LostPages, testing::Values(0, 100, 4096, 8192),
                         [](const auto& value) { return std::to_string(value.param) + "Bytes"; });

TEST(LostPages, WhileAnotherThreadReadsAndWrites) {
  ScratchSession session;
  auto publication = Publication<Probe>::create(session, "x", {.capacity = 64});
  ASSERT_TRUE(publication);
  Subscription<Probe> subscription(session, "x");
  std::atomic<bool> stop{false};
  std::atomic<std::uint64_t> fresh{0};
  std::thread writes([&] {
    for (std::uint64_t n = 1; !stop.load(); ++n) publication->publish({.number = n}, n);
  });
  std::thread reads([&] {
    Stamped<Probe> got;
    while (!stop.load()) {
      if (subscription.read_latest(got) == ReadStatus::kFresh) fresh.fetch_add(1);
    }
  });
  std::uint64_t before = 0;
  bool came_back = true;
  const auto housekeeping = [&](std::uint64_t ns) {
    for (const std::uint64_t end_ns = monotonic_ns() + ns; monotonic_ns() < end_ns;) {
      publication->maintain();
      subscription.maintain();
      sleep_until(monotonic_ns() + kNsPerMs);
    }
  };
  for (int round = 0; round < 4; ++round) {
    housekeeping(Publication<Probe>::kHandOver_ns + 50 * kNsPerMs);
    came_back = came_back && fresh.load() > before;
    before = fresh.load();
    (void)::truncate(session.path("x").c_str(), 0);
  }
  housekeeping(Publication<Probe>::kHandOver_ns + 50 * kNsPerMs);
  stop.store(true);
  writes.join();
  reads.join();
  EXPECT_TRUE(came_back);
  EXPECT_GT(fresh.load(), before);
  EXPECT_EQ(publication->renewals(), 4u);
}

TEST(LostPages, AFileWithHolesIsGoneToo) {
  ScratchSession session;
  auto publication = Publication<Probe>::create(session, "x", {.capacity = 1024});
  ASSERT_TRUE(publication);
  ASSERT_EQ(::truncate(session.path("x").c_str(), 0), 0);
  ASSERT_EQ(::truncate(session.path("x").c_str(), 4096 + 1024 * 64), 0);  // its length again, without a page
  publication->maintain();
  EXPECT_EQ(publication->renewals(), 1u);
  EXPECT_TRUE(Reader<Probe>::open(session, "x"));
}

TEST(LostPages, ABusErrorElsewhereStillEndsTheProcess) {
  const auto elsewhere = [] {
    detail::MappingGuard guard;  // installs the handler
    alignas(64) static std::byte watched[64];
    (void)guard.watch(watched, sizeof watched);
    const int fd = ::memfd_create("elsewhere", 0);
    (void)::ftruncate(fd, 4096);
    auto* const mapped = static_cast<volatile char*>(::mmap(nullptr, 4096, PROT_READ, MAP_SHARED, fd, 0));
    (void)::ftruncate(fd, 0);
    (void)mapped[0];
  };
#if defined(RTBUS_SANITIZED)
  // The sanitizer's handler was there before: it reports and exits.
  EXPECT_EXIT(
      elsewhere(), [](int status) { return status != 0; }, "SIGBUS|BUS");
#else
  EXPECT_EXIT(elsewhere(), testing::KilledBySignal(SIGBUS), "");
#endif
}

TEST(LostPages, AGuardForgetsItsMapping) {
  detail::MappingGuard guard;
  EXPECT_FALSE(guard.lost());
  for (int i = 0; i < 3 * static_cast<int>(detail::MappingGuard::kMost); ++i) {
    alignas(64) static std::byte watched[64];
    ASSERT_TRUE(guard.watch(watched, sizeof watched)) << i;
  }
}

TEST(DamagedHeader, IsPutBackByTheWriter) {
  ScratchSession session;
  auto publication = Publication<Probe>::create(session, "x");
  auto reader = Reader<Probe>::open(session, "x");
  ASSERT_TRUE(publication && reader);
  publication->publish({.number = 1}, 1);
  const std::uint32_t epoch = list_topics(session->name).at(0).epoch;
  const std::size_t end = detail::header_end(static_cast<std::uint32_t>(SampleTraits<Probe>::kFields.size()));
  for (std::size_t offset = 0; offset < end; offset += 8) {
    RawFile file(session.path("x"));
    file.at<std::uint64_t>(offset) = 0x4141414141414141;
    publication->maintain();
    auto anew = Reader<Probe>::open(session, "x");
    if (offset == offsetof(detail::SegmentHeader, newest)) {
      EXPECT_FALSE(anew) << "the ring's, and put right by the next publish";
    } else {
      ASSERT_TRUE(anew) << offset << ": " << to_string(anew.error());
    }
    publication->publish({.number = offset}, 2 + offset);
  }
  EXPECT_EQ(publication->renewals(), 0u) << "in place: readers notice nothing";
  EXPECT_FALSE(reader->replaced());
  Stamped<Probe> got;
  EXPECT_EQ(reader->read_latest(got), ReadStatus::kFresh);
  const TopicInfo info = list_topics(session->name).at(0);
  EXPECT_EQ(info.epoch, epoch);
  EXPECT_EQ(info.writer_pid, static_cast<std::uint32_t>(::getpid()));
}

TEST(DamagedHeader, ACounterAtItsEndIsNotTakenOver) {
  ScratchSession session;
  {
    test::Child child([&] {
      auto* writer = new auto(Writer<Probe>::create(session, "x"));
      return writer->has_value();
    });
    RawFile file(session.path("x"));
    file.at<std::uint64_t>(offsetof(detail::SegmentHeader, newest)) = detail::kMaxSequence;
  }
  auto writer = Writer<Probe>::create(session, "x");
  ASSERT_TRUE(writer);
  EXPECT_EQ(writer->published(), 0u) << "a new segment: its numbers would have ended at once";
}

}  // namespace
}  // namespace rtbus
