// What the next writer and the readers find when a writer dies, at any point of a publish.
#include "rtbus/detail/layout.hpp"
#include "rtbus/topic.hpp"
#include "tests/unit/rtbus/scratch_session.hpp"

namespace rtbus {
namespace {

using test::Child;
using test::OtherProbe;
using test::Probe;
using test::RawFile;
using test::ScratchSession;

Probe probe(std::uint64_t n) {
  const auto value = static_cast<double>(n);
  return {n, value, {value, 2 * value, 3 * value}};
}

/// Publishes 1…count in a child and leaves the writer alive there.
std::function<bool()> publisher(const Session& session, std::uint64_t count, WriterOptions options = {}) {
  return [&session, count, options] {
    auto* writer = new auto(Writer<Probe>::create(session, "x", options));
    if (!*writer) return false;
    for (std::uint64_t n = 1; n <= count; ++n) (*writer)->publish(probe(n), n);
    return true;
  };
}

TEST(TakeOver, DeadWriterIsSeenAndSucceededInPlace) {
  ScratchSession session;
  Child child(publisher(session, 5));
  ASSERT_TRUE(child.succeeded());
  auto reader = Reader<Probe>::open(session, "x");
  ASSERT_TRUE(reader);
  Stamped<Probe> got;
  ASSERT_EQ(reader->read_latest(got), ReadStatus::kFresh);
  EXPECT_EQ(got.sequence, 5u);
  EXPECT_TRUE(reader->writer_alive());
  auto too_early = Writer<Probe>::create(session, "x");
  ASSERT_FALSE(too_early);
  EXPECT_EQ(too_early.error(), TopicError::kAlreadyOwned);

  child.kill();
  EXPECT_FALSE(reader->writer_alive());
  EXPECT_FALSE(reader->replaced());
  auto successor = Writer<Probe>::create(session, "x");
  ASSERT_TRUE(successor);
  EXPECT_EQ(successor->published(), 5u);
  EXPECT_TRUE(reader->writer_alive());
  EXPECT_FALSE(reader->replaced());
  successor->publish(probe(60), 6);
  ASSERT_EQ(reader->read_latest(got), ReadStatus::kFresh);
  EXPECT_EQ(got.sequence, 6u);
  EXPECT_EQ(got.value.number, 60u);

  auto segment = Segment::open(session, "x", nullptr, OwnerTrust::kSelfOrRoot, false);
  ASSERT_TRUE(segment);
  EXPECT_EQ(segment->epoch(), 2u);
  EXPECT_EQ(segment->writer_pid(), static_cast<std::uint32_t>(::getpid()));
}

/// Where in the publishing of sample 5 the writer dies (rtbus/detail/seqlock.hpp: W1…W4).
enum class DeathAt { kBeforeWords, kHalfWay, kBeforeComplete, kBeforeAnnounced };

class TakeOverMidPublish : public ::testing::TestWithParam<std::tuple<DeathAt, std::uint32_t>> {};

TEST_P(TakeOverMidPublish, IsNeverSeenByReaders) {
  const auto [death, capacity] = GetParam();
  ScratchSession session;
  Child child([&, death = death, capacity = capacity] {
    const SampleDescription description = describe<Probe>();
    auto* segment = new auto(Segment::create(session, "x", description, capacity, false));
    if (!*segment) return false;
    const detail::RingView ring = (*segment)->ring();
    detail::RingWriter writer(ring);
    for (std::uint64_t n = 1; n <= 4; ++n) {
      const Probe value = probe(n);
      writer.publish<5>(&value, n);
    }
    detail::SharedU64* const slot = ring.slot(5);
    slot[0].store(9);
    if (death == DeathAt::kBeforeWords) return true;
    for (int word = 1; word <= (death == DeathAt::kHalfWay ? 3 : 6); ++word) slot[word].store(0xdead);
    if (death == DeathAt::kBeforeAnnounced) slot[0].store(10);
    return true;
  });
  ASSERT_TRUE(child.succeeded());
  auto reader = Reader<Probe>::open(session, "x");
  auto follower = Reader<Probe>::open(session, "x", {.from_oldest = true});
  ASSERT_TRUE(reader);
  ASSERT_TRUE(follower);
  child.kill();

  Stamped<Probe> got;
  ASSERT_EQ(reader->read_latest(got), ReadStatus::kFresh);
  EXPECT_EQ(got.sequence, 4u);
  EXPECT_EQ(got.value.number, 4u);
  EXPECT_EQ(reader->read_latest(got), ReadStatus::kSame);
  while (follower->read_next(got) == ReadStatus::kFresh) EXPECT_EQ(got.value.number, got.sequence);
  EXPECT_EQ(got.sequence, 4u);

  auto successor = Writer<Probe>::create(session, "x", {.capacity = capacity});
  ASSERT_TRUE(successor);
  EXPECT_EQ(reader->read_latest(got), ReadStatus::kSame) << "taking over announces nothing";
  successor->publish(probe(5), 55);
  ASSERT_EQ(reader->read_latest(got), ReadStatus::kFresh);
  EXPECT_EQ(got.sequence, 5u);
  EXPECT_EQ(got.stamp_ns, 55u);
  EXPECT_EQ(got.value.number, 5u);
  EXPECT_EQ(got.value.vector[2], 15.0);
  ASSERT_EQ(follower->read_next(got), ReadStatus::kFresh);
  EXPECT_EQ(got.stamp_ns, 55u);
}

INSTANTIATE_TEST_SUITE_P(Deaths, TakeOverMidPublish,
                         ::testing::Combine(::testing::Values(DeathAt::kBeforeWords, DeathAt::kHalfWay,
                                                              DeathAt::kBeforeComplete, DeathAt::kBeforeAnnounced),
                                            ::testing::Values(2u, 4u, 64u)));

TEST(TakeOver, AnotherLayoutMakesANewSegmentUnderTheSameName) {
  ScratchSession session;
  Child child(publisher(session, 3));
  ASSERT_TRUE(child.succeeded());
  auto reader = Reader<Probe>::open(session, "x");
  ASSERT_TRUE(reader);
  child.kill();
  auto successor = Writer<OtherProbe>::create(session, "x");
  ASSERT_TRUE(successor);
  EXPECT_EQ(successor->published(), 0u);
  EXPECT_TRUE(reader->replaced());
  EXPECT_FALSE(reader->writer_alive());
  Stamped<Probe> got;
  EXPECT_EQ(reader->read_latest(got), ReadStatus::kFresh) << "the old mapping stays readable";
  EXPECT_TRUE(Reader<OtherProbe>::open(session, "x"));
}

TEST(TakeOver, AnotherCapacityOrDoorbellIsAnotherLayout) {
  ScratchSession session;
  for (const WriterOptions options : {WriterOptions{.capacity = 8}, WriterOptions{.capacity = 64, .doorbell = true}}) {
    Child child(publisher(session, 3));
    ASSERT_TRUE(child.succeeded());
    child.kill();
    auto successor = Writer<Probe>::create(session, "x", options);
    ASSERT_TRUE(successor);
    EXPECT_EQ(successor->published(), 0u);
  }
}

TEST(TakeOver, DamagedRemainsAreReplaced) {
  ScratchSession session;
  for (const std::size_t offset : {std::size_t{0}, std::size_t{12}, offsetof(detail::SegmentHeader, capacity),
                                   offsetof(detail::SegmentHeader, newest) + 7}) {
    Child child(publisher(session, 3));
    ASSERT_TRUE(child.succeeded());
    child.kill();
    RawFile(session.path("x")).at<std::uint8_t>(offset) ^= 0xff;
    auto successor = Writer<Probe>::create(session, "x");
    ASSERT_TRUE(successor) << offset;
    EXPECT_EQ(successor->published(), 0u);
    EXPECT_TRUE(Reader<Probe>::open(session, "x")) << offset;
  }
}

TEST(TakeOver, CreatorThatDiedHalfWayIsNoObstacle) {
  ScratchSession session;
  for (const off_t size : {off_t{0}, off_t{100}, off_t{4096}, off_t{12288}}) {
    const int fd = ::open(session.path("x").c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0600);
    ASSERT_GE(fd, 0);
    ASSERT_EQ(::ftruncate(fd, size), 0);
    ::close(fd);
    auto early = Reader<Probe>::open(session, "x");
    ASSERT_FALSE(early);
    EXPECT_EQ(early.error(), size == 100 ? TopicError::kCorrupt : TopicError::kNotFound);
    EXPECT_TRUE(Writer<Probe>::create(session, "x")) << size;
  }
}

TEST(TakeOver, ModeIsAppliedAgain) {
  ScratchSession session;
  Child child(publisher(session, 1));
  ASSERT_TRUE(child.succeeded());
  child.kill();
  session->mode = 0640;
  auto successor = Writer<Probe>::create(session, "x");
  ASSERT_TRUE(successor);
  EXPECT_EQ(successor->published(), 1u);
  struct stat status {};
  ASSERT_EQ(::stat(session.path("x").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 07777, 0640u);
}

TEST(TakeOver, OnlyOneOfManyStartingWritersWins) {
  ScratchSession session;
  for (int round = 0; round < 10; ++round) {
    Child corpse(publisher(session, 1));
    ASSERT_TRUE(corpse.succeeded());
    corpse.kill();
    auto* const winners = static_cast<std::atomic<int>*>(
        ::mmap(nullptr, 4096, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0));
    std::vector<std::unique_ptr<Child>> children;
    for (int i = 0; i < 4; ++i) {
      children.push_back(std::make_unique<Child>([&] {
        if ((new auto(Writer<Probe>::create(session, "x")))->has_value()) winners->fetch_add(1);
        return true;
      }));
    }
    EXPECT_EQ(winners->load(), 1);
    ::munmap(winners, 4096);
  }
}

}  // namespace
}  // namespace rtbus
