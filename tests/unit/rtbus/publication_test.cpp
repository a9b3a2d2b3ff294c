// A realtime writer whose segment is deleted under it.
#include "rtbus/publication.hpp"

#include <atomic>
#include <set>
#include <thread>

#include "rtbus/subscription.hpp"
#include "tests/unit/rtbus/scratch_session.hpp"

namespace rtbus {
namespace {

using test::Child;
using test::Probe;
using test::ScratchSession;

/// What `rm` and systemd-logind do.
void remove(const ScratchSession& session, const std::string& topic) {
  ASSERT_EQ(::unlink(session.path(topic).c_str()), 0);
}

ino_t inode(const ScratchSession& session, const std::string& topic) {
  struct stat status {};
  return ::lstat(session.path(topic).c_str(), &status) == 0 ? status.st_ino : 0;
}

/// Publishes and maintains in one thread until the last hand-over is over.
void finish_hand_over(Publication<Probe>& publication) {
  const std::uint64_t end_ns = monotonic_ns() + Publication<Probe>::kHandOver_ns + 50 * kNsPerMs;
  while (monotonic_ns() < end_ns) {
    publication.publish({.number = 77}, monotonic_ns());
    publication.maintain();
    sleep_until(monotonic_ns() + kNsPerMs);
  }
}

TEST(Publication, LeavesATopicAloneThatIsThere) {
  ScratchSession session;
  auto publication = Publication<Probe>::create(session, "x");
  ASSERT_TRUE(publication);
  const ino_t before = inode(session, "x");
  for (int i = 0; i < 5; ++i) publication->maintain();
  EXPECT_EQ(publication->renewals(), 0u);
  EXPECT_EQ(inode(session, "x"), before);
}

TEST(Publication, MakesADeletedTopicAnewUnderItsName) {
  ScratchSession session;
  session->mode = 0640;
  auto publication = Publication<Probe>::create(session, "x");
  publication->publish({.number = 1}, 1);
  remove(session, "x");
  EXPECT_FALSE(session.exists("x"));
  publication->maintain();
  EXPECT_EQ(publication->renewals(), 1u);
  EXPECT_EQ(publication->last_error(), std::nullopt);
  struct stat status {};
  ASSERT_EQ(::lstat(session.path("x").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777u, 0640u) << "the session's mode, as at the first time";

  publication->publish({.number = 2}, 2);
  auto newcomer = Reader<Probe>::open(session, "x");
  ASSERT_TRUE(newcomer);
  EXPECT_TRUE(newcomer->writer_alive());
  Stamped<Probe> got;
  ASSERT_EQ(newcomer->read_latest(got), ReadStatus::kFresh);
  EXPECT_EQ(got.value.number, 2u);
  EXPECT_EQ(got.sequence, 1u) << "numbers begin anew";
}

TEST(Publication, OwnsTheNewTopicAndOnlyThat) {
  ScratchSession session;
  {
    auto publication = Publication<Probe>::create(session, "x");
    remove(session, "x");
    publication->maintain();
    auto rival = Writer<Probe>::create(session, "x");
    ASSERT_FALSE(rival);
    EXPECT_EQ(rival.error(), TopicError::kAlreadyOwned);
    finish_hand_over(*publication);
    EXPECT_TRUE(session.exists("x")) << "the retired writer unlinks nothing";
  }
  EXPECT_FALSE(session.exists("x")) << "a clean end leaves nothing";
}

TEST(Publication, WritesBothRingsUntilReadersHadTimeToChange) {
  ScratchSession session;
  auto publication = Publication<Probe>::create(session, "x");
  auto old_reader = Reader<Probe>::open(session, "x");
  remove(session, "x");
  publication->maintain();
  auto new_reader = Reader<Probe>::open(session, "x");
  publication->publish({.number = 5}, 5);
  Stamped<Probe> got;
  ASSERT_EQ(old_reader->read_latest(got), ReadStatus::kFresh);
  EXPECT_EQ(got.value.number, 5u);
  ASSERT_EQ(new_reader->read_latest(got), ReadStatus::kFresh);
  EXPECT_EQ(got.value.number, 5u);

  finish_hand_over(*publication);
  (void)old_reader->read_latest(got);
  publication->publish({.number = 6}, 6);
  EXPECT_EQ(old_reader->read_latest(got), ReadStatus::kSame) << "the old ring is written no more";
  EXPECT_FALSE(old_reader->writer_alive()) << "and its lock is gone with it";
  ASSERT_EQ(new_reader->read_latest(got), ReadStatus::kFresh);
  EXPECT_EQ(got.value.number, 6u);
}

TEST(Publication, KeepsTheOldRingUntilTheRealtimeThreadHasTakenTheNewOne) {
  ScratchSession session;
  auto publication = Publication<Probe>::create(session, "x");
  remove(session, "x");
  publication->maintain();
  // Nothing is published: a slow engine, or a debugger. However long that lasts, the old memory is still in use.
  for (int i = 0; i < 40; ++i) {
    publication->maintain();
    sleep_until(monotonic_ns() + 10 * kNsPerMs);
  }
  auto reader = Reader<Probe>::open(session, "x");
  publication->publish({.number = 3, .value = 3.0}, 3);
  Stamped<Probe> got;
  ASSERT_EQ(reader->read_latest(got), ReadStatus::kFresh);
  EXPECT_EQ(got.value.number, 3u);
}

TEST(Publication, NoticesItsObserversThroughAHandOver) {
  ScratchSession session;
  auto publication = Publication<Probe>::create(session, "x");
  auto observer = std::make_unique<Reader<Probe>>(*Reader<Probe>::open(session, "x", {.presence = true}));
  ASSERT_TRUE(publication->observed());
  remove(session, "x");
  publication->maintain();
  EXPECT_TRUE(publication->observed()) << "it still holds the old ring";
  auto changed = Reader<Probe>::open(session, "x", {.presence = true});
  observer.reset();
  EXPECT_TRUE(publication->observed()) << "it holds the new one";
}

TEST(Publication, SurvivesBeingDeletedAgainAndAgain) {
  ScratchSession session;
  auto publication = Publication<Probe>::create(session, "x");
  Subscription<Probe> subscription(session, "x");
  Stamped<Probe> got;
  for (std::uint64_t round = 1; round <= 3; ++round) {
    remove(session, "x");
    publication->maintain();
    EXPECT_EQ(publication->renewals(), round);
    finish_hand_over(*publication);
    subscription.maintain();
    publication->publish({.number = round}, round);
    ASSERT_EQ(subscription.read_latest(got), ReadStatus::kFresh);
    EXPECT_EQ(got.value.number, round);
  }
}

// A topic that is published for observers alone: its writer is silent as long as nobody looks.
TEST(Publication, OfASilentWriterSurvivesBeingDeletedAgainAndAgain) {
  ScratchSession session;
  auto publication = Publication<Probe>::create(session, "x");
  for (unsigned i = 1; i <= 3; ++i) {
    remove(session, "x");
    publication->maintain();
    EXPECT_TRUE(session.exists("x"));
    EXPECT_EQ(publication->renewals(), i);
  }
  auto reader = Reader<Probe>::open(session, "x");
  ASSERT_TRUE(reader);
  publication->publish({.number = 5}, 1);
  Stamped<Probe> sample;
  ASSERT_EQ(reader->read_latest(sample), ReadStatus::kFresh);
  EXPECT_EQ(sample.value.number, 5u);
}

TEST(Publication, LeavesTheNameToAnotherOwnerAndSaysSo) {
  ScratchSession session;
  auto publication = Publication<Probe>::create(session, "x");
  remove(session, "x");
  auto usurper = Writer<Probe>::create(session, "x");
  ASSERT_TRUE(usurper) << "its own inode has a lock of its own";
  publication->maintain();
  EXPECT_EQ(publication->renewals(), 0u);
  EXPECT_EQ(publication->last_error(), TopicError::kAlreadyOwned);
  const RenewalCount count = count_renewals(*publication);
  EXPECT_EQ(count.failing, 1u);
  EXPECT_NE(count.text().find("live writer"), std::string::npos) << count.text();
  publication->publish({.number = 1}, 1);  // into the old ring: harmless
}

TEST(Subscription, FollowsALiveWriterIntoItsNewSegmentWithoutLosingASample) {
  ScratchSession session;
  auto publication = Publication<Probe>::create(session, "x");
  Subscription<Probe> subscription(session, "x");
  subscription.maintain();
  Stamped<Probe> got;
  std::uint64_t next = 0;
  const auto exchange = [&] {
    ++next;
    publication->publish({.number = next}, next);
    ASSERT_EQ(subscription.read_latest(got), ReadStatus::kFresh);
    EXPECT_EQ(got.value.number, next);
  };
  exchange();
  remove(session, "x");
  subscription.maintain();
  EXPECT_TRUE(subscription.attached()) << "its writer lives: it stays until there is something to change to";
  exchange();
  publication->maintain();
  exchange();
  subscription.maintain();
  EXPECT_EQ(subscription.attachments(), 2u);
  exchange();
  finish_hand_over(*publication);
  exchange();
  EXPECT_TRUE(subscription.attached());
}

TEST(Subscription, StaysWithALiveWriterWhenADeadOnesSegmentHasTheName) {
  ScratchSession session;
  auto publication = Publication<Probe>::create(session, "x");
  Subscription<Probe> subscription(session, "x");
  subscription.maintain();
  remove(session, "x");
  Child other([&] {
    auto* writer = new auto(Writer<Probe>::create(session, "x"));
    return writer->has_value();
  });
  ASSERT_TRUE(other.succeeded());
  other.kill();
  subscription.maintain();
  EXPECT_EQ(subscription.attachments(), 1u);
  publication->publish({.number = 4}, 4);
  Stamped<Probe> got;
  ASSERT_EQ(subscription.read_latest(got), ReadStatus::kFresh);
  EXPECT_EQ(got.value.number, 4u);
}

TEST(Publication, HandsOverBetweenThreadsWithoutARaceOrATornSample) {
  // For ThreadSanitizer, and for whoever unmaps too early: one thread publishes as fast as it can, one reads, and this
  // one deletes, maintains and renews.
  ScratchSession session;
  auto publication = Publication<Probe>::create(session, "x");
  Subscription<Probe> subscription(session, "x");
  std::atomic<bool> stop{false};
  std::atomic<std::uint64_t> last_read{0};
  std::uint64_t torn = 0, backwards = 0;
  std::thread realtime([&] {
    for (std::uint64_t n = 1; !stop; ++n) {
      publication->publish({.number = n, .value = static_cast<double>(n)}, n);
      if (n % 64 == 0) std::this_thread::yield();
    }
  });
  std::thread reading([&] {
    Stamped<Probe> got;
    while (!stop) {
      if (subscription.read_latest(got) != ReadStatus::kFresh) continue;
      torn += got.value.value != static_cast<double>(got.value.number);
      backwards += got.value.number < last_read;
      last_read = got.value.number;
    }
  });
  for (int generation = 0; generation < 4; ++generation) {
    (void)::unlink(session.path("x").c_str());
    const std::uint64_t end_ns = monotonic_ns() + Publication<Probe>::kHandOver_ns + 150 * kNsPerMs;
    while (monotonic_ns() < end_ns) {
      publication->maintain();
      subscription.maintain();
      sleep_until(monotonic_ns() + 5 * kNsPerMs);
    }
  }
  const std::uint64_t seen = last_read;
  const std::uint64_t give_up_ns = monotonic_ns() + 10 * kNsPerS;
  while (last_read == seen && monotonic_ns() < give_up_ns) sleep_until(monotonic_ns() + kNsPerMs);
  EXPECT_GT(last_read, seen) << "samples still come through";
  stop = true;
  realtime.join();
  reading.join();
  EXPECT_EQ(torn, 0u);
  EXPECT_EQ(backwards, 0u) << "a reader that changes over never goes back in time";
  EXPECT_GE(publication->renewals(), 2u);
}

}  // namespace
}  // namespace rtbus
