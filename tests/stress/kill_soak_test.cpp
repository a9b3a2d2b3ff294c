// kill -9 on both sides, again and again, at whatever instruction it hits: nothing hangs, nothing leaks, numbers go on.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cinttypes>
#include <cstdio>
#include <random>
#include <string>

#include "rtbus/clock.hpp"
#include "rtbus/topic.hpp"
#include "rtbus/topic_directory.hpp"

namespace rtbus {
namespace {

struct Pulse {
  std::array<std::uint64_t, 8> words{};
};

}  // namespace

template <>
struct SampleTraits<Pulse> {
  static constexpr std::string_view kName = "test/Pulse";
  static constexpr std::array kFields{RTBUS_FIELD(Pulse, words, "1")};
};

namespace {

constexpr std::uint64_t kSoakNs = 8 * kNsPerS;
constexpr int kKills = 400;

/// Word 0 is the sample's number, the others follow from it and from the generation that wrote it.
Pulse pulse(std::uint64_t number, std::uint64_t generation) {
  Pulse p;
  for (std::size_t i = 0; i < p.words.size(); ++i) p.words[i] = (number << 16) + generation + 1'000'003 * i;
  return p;
}
bool whole(const Stamped<Pulse>& got) {
  const std::uint64_t number = got.value.words[0] >> 16, generation = got.value.words[0] & 0xffff;
  if (number != got.sequence || got.stamp_ns != generation) return false;
  const Pulse expected = pulse(number, generation);
  return expected.words == got.value.words;
}

pid_t fork_bound_to_parent() {
  const pid_t pid = ::fork();
  if (pid == 0) ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  return pid;
}

pid_t start_writer(const Session& session, std::uint64_t generation) {
  const pid_t pid = fork_bound_to_parent();
  if (pid != 0) return pid;
  auto writer = Writer<Pulse>::create(session, "pulse", {.capacity = 4, .doorbell = true});
  if (!writer) ::_exit(2);
  for (std::uint64_t n = writer->published() + 1;; ++n) {
    writer->publish(pulse(n, generation), generation);
    if (n % 64 == 0) writer->ring_doorbell();
  }
}

/// Reads in every way until it is killed; exits with 3 when it sees a torn sample.
pid_t start_reader(const Session& session) {
  const pid_t pid = fork_bound_to_parent();
  if (pid != 0) return pid;
  for (;;) {
    auto reader = Reader<Pulse>::open(session, "pulse", {.presence = true, .from_oldest = true});
    if (!reader) continue;
    Stamped<Pulse> got;
    for (int i = 0; i < 20'000; ++i) {
      if (reader->read_next(got) == ReadStatus::kFresh && !whole(got)) ::_exit(3);
      if (reader->read_latest(got) == ReadStatus::kFresh && !whole(got)) ::_exit(3);
      if (i % 1000 == 0) (void)reader->wait(monotonic_ns() + kNsPerMs);
    }
  }
}

bool killed_by_us(pid_t pid) {
  ::kill(pid, SIGKILL);
  int status = 0;
  ::waitpid(pid, &status, 0);
  return WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL;
}

TEST(KillSoak, NothingHangsTearsOrLeaks) {
  Session session;
  session.name = "soak-" + std::to_string(::getpid());
  std::mt19937 random(1);
  std::uniform_int_distribution<std::uint64_t> life_ns(100 * kNsPerUs, 25 * kNsPerMs);
  pid_t reader_pid = start_reader(session);
  ASSERT_GT(reader_pid, 0);
  const std::uint64_t begin_ns = monotonic_ns();
  std::uint64_t highest = 0, longest_recovery_ns = 0;
  int writers = 0, readers = 0, segments = 0;
  Result<Reader<Pulse>, TopicError> watcher = Failure{TopicError::kNotFound};
  for (; writers < kKills && monotonic_ns() - begin_ns < kSoakNs; ++writers) {
    const pid_t writer_pid = start_writer(session, static_cast<std::uint64_t>(writers));
    if (writers % 4 == 3) {
      // Killed while it starts, wherever that hits it: what it leaves is the next one's to clear up.
      sleep_until(monotonic_ns() + life_ns(random) / 25);
      ASSERT_TRUE(killed_by_us(writer_pid));
      continue;
    }
    const std::uint64_t started_ns = monotonic_ns();
    if (!watcher || watcher->replaced()) {
      // Only a creator that was killed before it was ready makes the numbers begin anew.
      while (!(watcher = Reader<Pulse>::open(session, "pulse")) && monotonic_ns() - started_ns < kNsPerS) {
      }
      highest = 0;
      ++segments;
    }
    // The new generation is heard on the mapping that the watcher has had all along.
    Stamped<Pulse> got;
    bool heard = false;
    while (watcher && !heard && monotonic_ns() - started_ns < 10 * kNsPerS) {
      if (watcher->read_latest(got) != ReadStatus::kFresh) continue;
      ASSERT_TRUE(whole(got));
      ASSERT_GT(got.sequence, highest) << "numbers must go on";
      highest = got.sequence;
      heard = got.stamp_ns == static_cast<std::uint64_t>(writers);
    }
    ASSERT_TRUE(heard) << "writer " << writers << " was never heard";
    longest_recovery_ns = std::max(longest_recovery_ns, monotonic_ns() - started_ns);
    sleep_until(monotonic_ns() + life_ns(random));
    ASSERT_TRUE(killed_by_us(writer_pid)) << "a writer ended by itself";
    ASSERT_FALSE(watcher->writer_alive());
    if (writers % 3 == 0) {
      ASSERT_TRUE(killed_by_us(reader_pid)) << "a reader ended by itself: torn sample";
      reader_pid = start_reader(session);
      ++readers;
    }
  }
  ASSERT_TRUE(killed_by_us(reader_pid));
  std::printf("%d writers and %d readers killed in %.1f s; %" PRIu64
              " samples, %d segments; longest start to heard %.1f ms\n",
              writers, readers, seconds_between(begin_ns, monotonic_ns()), highest, segments,
              1e-6 * static_cast<double>(longest_recovery_ns));
  EXPECT_GT(writers, 20);
  EXPECT_EQ(list_topics(session.name).size(), 1u) << "one topic is one segment, however often its writer died";
  EXPECT_EQ(remove_dead(session.name).names.size(), 1u);
  EXPECT_TRUE(list_topics(session.name).empty());
}

}  // namespace
}  // namespace rtbus
