// Sleeping readers.
#include <atomic>
#include <thread>

#include "rtbus/clock.hpp"
#include "rtbus/topic.hpp"
#include "tests/support/users.hpp"
#include "tests/unit/rtbus/scratch_session.hpp"

namespace rtbus {
namespace {

using test::Child;
using test::Probe;
using test::ScratchSession;

class WaitingReader : public ::testing::TestWithParam<bool> {};

TEST_P(WaitingReader, ReturnsAtOnceWhenSomethingIsThere) {
  ScratchSession session;
  auto writer = Writer<Probe>::create(session, "x", {.doorbell = GetParam()});
  auto reader = Reader<Probe>::open(session, "x");
  ASSERT_TRUE(reader);
  writer->publish({.number = 1}, 1);
  EXPECT_TRUE(reader->wait(0));
}

TEST_P(WaitingReader, ReturnsFalseAtTheDeadline) {
  ScratchSession session;
  auto writer = Writer<Probe>::create(session, "x", {.doorbell = GetParam()});
  auto reader = Reader<Probe>::open(session, "x");
  ASSERT_TRUE(reader);
  const std::uint64_t deadline_ns = monotonic_ns() + 5 * kNsPerMs;
  EXPECT_FALSE(reader->wait(deadline_ns));
  EXPECT_GE(monotonic_ns(), deadline_ns);
}

TEST_P(WaitingReader, WaitingIsOverAfterReading) {
  ScratchSession session;
  auto writer = Writer<Probe>::create(session, "x", {.doorbell = GetParam()});
  writer->publish({.number = 1}, 1);
  auto reader = Reader<Probe>::open(session, "x", {.from_oldest = true});
  ASSERT_TRUE(reader);
  Stamped<Probe> got;
  EXPECT_TRUE(reader->wait(0));
  ASSERT_EQ(reader->read_next(got), ReadStatus::kFresh);
  EXPECT_FALSE(reader->wait(0));
}

TEST_P(WaitingReader, ReturnsAlsoWhenTheWriterIsKilled) {
  ScratchSession session;
  Child child([&] { return (new auto(Writer<Probe>::create(session, "x", {.doorbell = GetParam()})))->has_value(); });
  ASSERT_TRUE(child.succeeded());
  auto reader = Reader<Probe>::open(session, "x");
  ASSERT_TRUE(reader);
  std::thread killer([&] {
    sleep_until(monotonic_ns() + 5 * kNsPerMs);
    child.kill();
  });
  EXPECT_FALSE(reader->wait(monotonic_ns() + 20 * kNsPerMs));
  killer.join();
  EXPECT_FALSE(reader->writer_alive());
}

TEST_P(WaitingReader, NoWakeUpIsLost) {
  // Each sample is published only after the one before was read: a lost wake-up costs a whole time-out and shows.
  ScratchSession session;
  auto writer = Writer<Probe>::create(session, "x", {.capacity = 4, .doorbell = GetParam()});
  auto reader = Reader<Probe>::open(session, "x");
  ASSERT_TRUE(reader);
  constexpr std::uint64_t kRounds = 2000;
  std::atomic<std::uint64_t> acknowledged{0};
  std::atomic<bool> failed{false};
  std::thread sleeper([&] {
    Stamped<Probe> got;
    for (std::uint64_t n = 1; n <= kRounds && !failed; ++n) {
      if (!reader->wait(monotonic_ns() + 60 * kNsPerS)) failed = true;
      if (reader->read_next(got) != ReadStatus::kFresh || got.value.number != n) failed = true;
      acknowledged = n;
    }
  });
  for (std::uint64_t n = 1; n <= kRounds && !failed; ++n) {
    writer->publish({.number = n}, n);
    writer->ring_doorbell();
    while (acknowledged < n && !failed) std::this_thread::yield();
  }
  sleeper.join();
  EXPECT_FALSE(failed);
}

INSTANTIATE_TEST_SUITE_P(WithAndWithoutDoorbell, WaitingReader, ::testing::Bool(),
                         [](const auto& parameter) { return parameter.param ? "Doorbell" : "Polling"; });

TEST(Doorbell, ReaderWithoutWritePermissionPolls) {
  if (::geteuid() != 0 || tests::is_root_alone()) GTEST_SKIP() << "needs root to become somebody else";
  ScratchSession session;
  session->mode = 0644;
  auto writer = Writer<Probe>::create(session, "x", {.doorbell = true});
  ASSERT_TRUE(writer);
  writer->publish({.number = 1}, 1);
  Child child([&] {
    if (::setresuid(65534, 65534, 65534) != 0) return false;
    auto reader = Reader<Probe>::open(session, "x", {.trust = OwnerTrust::kSelfOrRoot});
    Stamped<Probe> got;
    return reader && reader->read_latest(got) == ReadStatus::kFresh && !reader->wait(monotonic_ns() + kNsPerMs);
  });
  EXPECT_TRUE(child.succeeded());
}

}  // namespace
}  // namespace rtbus
