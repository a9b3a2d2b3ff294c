// No reader ever accepts a torn sample from a writer at full speed, and the newest value is never starved.
//
// RTBUS_STRESS_READS sets the number of reads that copy a sample; without it 10^8, or 2·10^6 in a sanitized build.
// Reads that find nothing new copy nothing, so they prove nothing and are not counted.
#include <gtest/gtest.h>
#include <sched.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cinttypes>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <thread>

#include "rtbus/clock.hpp"
#include "rtbus/topic.hpp"
#include "rtbus/topic_directory.hpp"

namespace rtbus {
namespace {

constexpr std::uint32_t kRows = 15;

/// 256 bytes that all follow from the number of the sample: a head and a table of which any part may be used.
struct Flood {
  std::uint64_t first = 0;
  std::uint32_t used = 0, second = 0;
  std::array<std::uint64_t, kRows> left{}, right{};
};

/// Word i of sample n. Differs from sample to sample in every word, so that any mixture shows.
constexpr std::uint64_t word_of(std::uint64_t n, std::size_t i) {
  return (n + 0x9e3779b97f4a7c15ULL * (i + 1)) * (2 * i + 1);
}

Flood flood_of(std::uint64_t n) {
  Flood out;
  out.first = word_of(n, 0);
  out.used = static_cast<std::uint32_t>(n % (kRows + 1));
  out.second = static_cast<std::uint32_t>(word_of(n, 1));
  for (std::size_t row = 0; row < kRows; ++row) {
    out.left[row] = word_of(n, 2 + row);
    out.right[row] = word_of(n, 2 + kRows + row);
  }
  return out;
}

/// How a reader reads; one that leaves rows out looks at those that it was given.
enum class Way { kLatest, kLatestRows, kNext };

bool is_whole(const Flood& got, std::uint64_t n, Way way) {
  const Flood sent = flood_of(n);
  bool same = got.first == sent.first && got.used == sent.used && got.second == sent.second;
  const std::size_t rows = way == Way::kLatestRows ? std::min(got.used, kRows) : kRows;
  for (std::size_t row = 0; row < rows; ++row) {
    same &= got.left[row] == sent.left[row] && got.right[row] == sent.right[row];
  }
  return same;
}

}  // namespace

template <>
struct SampleTraits<Flood> {
  static constexpr std::string_view kName = "test/Flood";
  static constexpr std::array kFields{RTBUS_FIELD(Flood, first, "1"), RTBUS_FIELD(Flood, used, "1"),
                                      RTBUS_FIELD(Flood, second, "1"), RTBUS_FIELD(Flood, left, "1"),
                                      RTBUS_FIELD(Flood, right, "1")};
  static constexpr std::array kTables{RTBUS_TABLE(Flood, used, left, right, kRows)};
};

namespace {

std::uint64_t reads_wanted() {
  if (const char* const text = std::getenv("RTBUS_STRESS_READS")) return std::strtoull(text, nullptr, 10);
#ifdef RTBUS_SANITIZED
  return 2'000'000;
#else
  return 100'000'000;
#endif
}

/// All of a test's reading ends by then, on however busy a machine. A read that copies needs the writer to have run in
/// between, so where the two share a core there are few of them.
#ifdef RTBUS_SANITIZED
constexpr bool kAllReadsAreDue = false;
constexpr std::uint64_t kTimeLimitNs = 20 * kNsPerS;
#else
constexpr bool kAllReadsAreDue = true;
constexpr std::uint64_t kTimeLimitNs = 220 * kNsPerS;
#endif
/// With a smaller share of a CPU for reader or writer, too few reads are no defect.
constexpr double kOwnShare = 0.9;
constexpr std::uint64_t kThreadsTimeLimitNs = 4 * kNsPerS;

void flood(Writer<Flood>& writer, const std::atomic<bool>& stop) {
  for (std::uint64_t n = writer.published() + 1; !stop.load(std::memory_order_relaxed); ++n) {
    writer.publish(flood_of(n), n);
  }
}

struct Tally {
  std::uint64_t fresh = 0, same = 0, lapped = 0, missed = 0, torn = 0, backwards = 0;
  double seconds = 0.0;

  [[nodiscard]] std::uint64_t reads() const { return fresh + lapped; }
  /// Share of the reads that got a sample: how far the newest value is from being starved.
  [[nodiscard]] double served() const { return static_cast<double>(fresh) / static_cast<double>(reads()); }
  void print(const char* what) const {
    std::printf("%s: %" PRIu64 " reads in %.1f s, %.2f M/s; fresh %.4f %%, lapped %" PRIu64 ", torn %" PRIu64
                "; besides, nothing new %" PRIu64 ", jumped over %" PRIu64 "\n",
                what, reads(), seconds, 1e-6 * static_cast<double>(reads()) / seconds, 100.0 * served(), lapped, torn,
                same, missed);
    std::fflush(stdout);
  }
};

const char* name_of(Way way) {
  return way == Way::kLatest ? "read_latest     " : way == Way::kNext ? "read_next       " : "read_latest_rows";
}

ReadStatus read(Reader<Flood>& reader, Way way, Stamped<Flood>& got) {
  switch (way) {
    case Way::kLatest:
      return reader.read_latest(got);
    case Way::kLatestRows:
      return reader.read_latest_rows(got);
    case Way::kNext:
      break;
  }
  return reader.read_next(got);
}

Tally read_many(Reader<Flood>& reader, Way way, std::uint64_t wanted, std::uint64_t deadline_ns) {
  Tally tally;
  Stamped<Flood> got;
  std::uint64_t last = 0;
  const std::uint64_t begin_ns = monotonic_ns();
  std::uint64_t idle = 0;
  for (std::uint64_t i = 0; tally.reads() < wanted; ++i) {
    if (i % 4096 == 0 && monotonic_ns() > deadline_ns) break;
    if (idle == 1000) std::this_thread::yield();  // with fewer free cores than threads the writer needs this one
    idle = idle == 1000 ? 0 : idle;
    switch (read(reader, way, got)) {
      case ReadStatus::kSame:
      case ReadStatus::kDetached:
        ++tally.same, ++idle;
        continue;
      case ReadStatus::kLapped:
        ++tally.lapped;
        continue;
      case ReadStatus::kRefused:  // no sample here is insane: only a torn one could be refused
        ++tally.torn;
        continue;
      case ReadStatus::kFresh:
        break;
    }
    ++tally.fresh;
    idle = 0;
    const bool whole = got.stamp_ns == got.sequence && is_whole(got.value, got.sequence, way);
    tally.torn += whole ? 0 : 1;
    tally.backwards += got.sequence > last ? 0 : 1;
    last = got.sequence;
  }
  tally.seconds = seconds_between(begin_ns, monotonic_ns());
  tally.missed = reader.missed();
  return tally;
}

Session stress_session() {
  Session session;
  session.name = "stress-" + std::to_string(::getpid());
  return session;
}

void pin_to(int core) {
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(core, &set);
  (void)::sched_setaffinity(0, sizeof set, &set);  // on one core it just takes longer
}

/// A child that publishes at full speed until it is killed; it dies with its parent.
pid_t start_flooding_process(const Session& session, std::uint32_t capacity) {
  const pid_t pid = ::fork();
  if (pid != 0) return pid;
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  pin_to(0);
  auto writer = Writer<Flood>::create(session, "flood", {.capacity = capacity});
  if (!writer) ::_exit(1);
  const std::atomic<bool> never{false};
  flood(*writer, never);
  ::_exit(0);
}

Result<Reader<Flood>, TopicError> open_soon(const Session& session) {
  for (int i = 0; i < 5000; ++i) {
    auto reader = Reader<Flood>::open(session, "flood");
    if (reader || reader.error() != TopicError::kNotFound) return reader;
    sleep_until(monotonic_ns() + kNsPerMs);
  }
  return Failure{TopicError::kNotFound};
}

double cpu_time_s(clockid_t clock) {
  timespec used{};
  return ::clock_gettime(clock, &used) == 0
             ? static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec)
             : 0.0;
}

/// The CPU time that a reader and its writer got. A machine that is busy with something else gives them less than the
/// time that passes; a slow read does not.
class CpuShare {
 public:
  explicit CpuShare(pid_t writer) {
    if (::clock_getcpuclockid(writer, &writer_) != 0) writer_ = CLOCK_THREAD_CPUTIME_ID;
    reader_begin_s_ = cpu_time_s(CLOCK_THREAD_CPUTIME_ID);
    writer_begin_s_ = cpu_time_s(writer_);
  }
  /// The smaller one, over `seconds` since the beginning.
  [[nodiscard]] double smallest(double seconds) const {
    return std::min(cpu_time_s(CLOCK_THREAD_CPUTIME_ID) - reader_begin_s_, cpu_time_s(writer_) - writer_begin_s_) /
           seconds;
  }

 private:
  clockid_t writer_ = CLOCK_THREAD_CPUTIME_ID;
  double reader_begin_s_ = 0.0, writer_begin_s_ = 0.0;
};

class TwoProcesses : public ::testing::TestWithParam<std::uint32_t> {};

TEST_P(TwoProcesses, NeverSeeATornSample) {
  const Session session = stress_session();
  const pid_t writer = start_flooding_process(session, GetParam());
  ASSERT_GT(writer, 0);
  cpu_set_t before;
  ::sched_getaffinity(0, sizeof before, &before);
  pin_to(1);
  // The default ring carries most of the reads; the smallest one has the most collisions per read.
  const std::uint64_t wanted = GetParam() == 64 ? reads_wanted() * 4 / 15 : reads_wanted() / 15;
  const std::uint64_t begin_ns = monotonic_ns();
  std::uint64_t turn = 0;
  double busy_share = 1.0;
  for (const Way way : {Way::kLatest, Way::kLatestRows, Way::kNext}) {
    const std::uint64_t deadline_ns = begin_ns + ++turn * kTimeLimitNs / 3;
    auto reader = open_soon(session);
    ASSERT_TRUE(reader) << to_string(reader.error());
    const CpuShare share(writer);
    const Tally tally = read_many(*reader, way, wanted, deadline_ns);
    const double had = share.smallest(tally.seconds);
    tally.print(name_of(way));
    EXPECT_EQ(tally.torn, 0u);
    EXPECT_EQ(tally.backwards, 0u);
    if (tally.reads() < wanted && had < kOwnShare) {
      busy_share = std::min(busy_share, had);
    } else if (kAllReadsAreDue) {
      EXPECT_GE(tally.reads(), wanted) << "reader and writer had " << 100.0 * had << " % of a CPU or more each";
    }
    ASSERT_GT(tally.fresh, 0u);
    // A single slot starves its reader; from a ring of 64 the newest is nearly always to be had.
    if (GetParam() == 64 && way != Way::kNext) {
      EXPECT_GT(tally.served(), 0.95);
    }
  }
  ::sched_setaffinity(0, sizeof before, &before);
  ::kill(writer, SIGKILL);
  ::waitpid(writer, nullptr, 0);
  (void)remove_dead(session.name);
  if (kAllReadsAreDue && busy_share < kOwnShare) {
    GTEST_SKIP() << "machine too busy: no sample was torn, but reader or writer had " << 100.0 * busy_share
                 << " % of a CPU, too little for so many reads in time; see RTBUS_STRESS_READS";
  }
}

INSTANTIATE_TEST_SUITE_P(Rings, TwoProcesses, ::testing::Values(64u, 2u),
                         [](const auto& parameter) { return "Of" + std::to_string(parameter.param); });

TEST(TwoReaderThreads, NeverSeeATornSample) {
  // Within one process, where ThreadSanitizer sees both sides.
  const Session session = stress_session();
  const std::uint64_t wanted = std::min<std::uint64_t>(reads_wanted(), 1'000'000);
  for (const std::uint32_t capacity : {2u, 64u}) {
    const std::uint64_t deadline_ns = monotonic_ns() + kThreadsTimeLimitNs;
    auto writer = Writer<Flood>::create(session, "flood", {.capacity = capacity});
    ASSERT_TRUE(writer);
    auto latest = Reader<Flood>::open(session, "flood");
    auto rows = Reader<Flood>::open(session, "flood");
    auto next = Reader<Flood>::open(session, "flood");
    ASSERT_TRUE(latest);
    ASSERT_TRUE(rows);
    ASSERT_TRUE(next);
    std::atomic<bool> stop{false};
    std::thread writing([&] { flood(*writer, stop); });
    Tally from_next;
    std::thread following([&] { from_next = read_many(*next, Way::kNext, wanted / 4, deadline_ns); });
    const std::uint64_t halfway_ns = monotonic_ns() + kThreadsTimeLimitNs / 2;
    const Tally from_latest = read_many(*latest, Way::kLatest, wanted / 8, halfway_ns);
    const Tally from_rows = read_many(*rows, Way::kLatestRows, wanted / 8, deadline_ns);
    following.join();
    stop = true;
    writing.join();
    from_latest.print(name_of(Way::kLatest));
    from_rows.print(name_of(Way::kLatestRows));
    from_next.print(name_of(Way::kNext));
    EXPECT_EQ(from_latest.torn + from_rows.torn + from_next.torn, 0u);
    EXPECT_EQ(from_latest.backwards + from_rows.backwards + from_next.backwards, 0u);
    EXPECT_GT(from_latest.fresh, 0u);
    EXPECT_GT(from_rows.fresh, 0u);
  }
}

}  // namespace
}  // namespace rtbus
