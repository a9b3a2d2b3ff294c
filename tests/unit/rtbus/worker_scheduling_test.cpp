// A worker is realtime as long as it rests, whatever it does in between: what the kernel says of its thread decides.
#include "rtbus/worker_scheduling.hpp"

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <thread>

#include "rtbus/clock.hpp"
#include "rtbus/realtime.hpp"

namespace rtbus {
namespace {

TEST(RestAccount, OnlyAWorkerThatHasSavedItsTimeRests) {
  RestAccount account;
  EXPECT_FALSE(account.rests());
  account.add(0.1, 0.0);
  EXPECT_FALSE(account.rests());
  account.add(0.1, 0.0);
  EXPECT_TRUE(account.rests());
}

TEST(RestAccount, AStepWithoutEndIsSeenAfterTwiceWhatIsSaved) {
  RestAccount account;
  account.add(1.0, 0.0);
  account.add(0.19, 0.19);
  EXPECT_TRUE(account.rests());
  account.add(0.02, 0.02);
  EXPECT_FALSE(account.rests());
}

TEST(RestAccount, MoreThanHalfOfTheTimeIsSeenHoweverItIsSpread) {
  for (const double period_s : {0.001, 0.01, 0.1}) {
    RestAccount account;
    account.add(1.0, 0.0);
    for (double at_s = 0.0; at_s < 2.0; at_s += period_s) account.add(period_s, 0.45 * period_s);
    EXPECT_TRUE(account.rests()) << period_s;
    for (double at_s = 0.0; at_s < 2.5; at_s += period_s) account.add(period_s, 0.55 * period_s);
    EXPECT_FALSE(account.rests()) << period_s;
    for (double at_s = 0.0; at_s < 2.5; at_s += period_s) account.add(period_s, 0.45 * period_s);
    EXPECT_TRUE(account.rests()) << period_s;
  }
}

TEST(RestAccount, AShareThatWaversAboutAHalfDoesNotSwitch) {
  RestAccount account;
  account.add(1.0, 0.0);
  for (int round = 0; round < 1000; ++round) {
    account.add(0.04, 0.03);
    ASSERT_TRUE(account.rests());
    account.add(0.04, 0.01);
  }
}

/// A thread that sleeps, or computes without end, and is a worker.
class Worker {
 public:
  Worker() : thread_([this] { run(); }) {
    while (tid_ == 0) sleep_until(monotonic_ns() + kNsPerMs);
  }
  ~Worker() {
    ends_ = true;
    thread_.join();
  }
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  void compute(bool on) { computes_ = on; }
  [[nodiscard]] int kernels_policy() const { return ::sched_getscheduler(tid_) & ~SCHED_RESET_ON_FORK; }
  [[nodiscard]] int kernels_nice() const { return ::getpriority(PRIO_PROCESS, static_cast<id_t>(tid_)); }
  /// Watches it as a beat does. @returns whether it came to have `policy` in that time.
  [[nodiscard]] bool comes_to(int policy, std::uint64_t within_ns = 20 * kNsPerS) {
    const std::uint64_t end_ns = monotonic_ns() + within_ns;
    while (monotonic_ns() < end_ns) {
      scheduling.watch();
      if (kernels_policy() == policy) return true;
      sleep_until(monotonic_ns() + 20 * kNsPerMs);
    }
    return false;
  }

  WorkerScheduling scheduling;

 private:
  void run() {
    scheduling.enter();
    tid_ = ::gettid();
    while (!ends_) {
      if (!computes_) sleep_until(monotonic_ns() + kNsPerMs);
    }
    scheduling.leave();
  }

  std::atomic<pid_t> tid_{0};
  std::atomic<bool> computes_{false}, ends_{false};
  std::thread thread_;
};

bool may_be_realtime() {
  bool granted = false;
  std::thread([&granted] { granted = prefer_on_time(); }).join();
  return granted;
}

TEST(WorkerScheduling, IsRealtimeWhileItRestsAndLeavesTheOthersSomethingElse) {
  Worker worker;
  if (!may_be_realtime()) {
    EXPECT_FALSE(worker.comes_to(SCHED_FIFO, kNsPerS));
    EXPECT_STREQ(worker.scheduling.policy(), "SCHED_OTHER");
    return;
  }
  ASSERT_TRUE(worker.comes_to(SCHED_FIFO));
  EXPECT_STREQ(worker.scheduling.policy(), "SCHED_FIFO");
  EXPECT_EQ(worker.scheduling.summary(), "SCHED_FIFO 2");
  worker.compute(true);
  ASSERT_TRUE(worker.comes_to(SCHED_OTHER));
  EXPECT_STREQ(worker.scheduling.policy(), "SCHED_OTHER");
  EXPECT_EQ(worker.scheduling.summary(), worker.kernels_nice() == kWorkerNice ? "nice -15" : "no priority");
  worker.compute(false);
  EXPECT_TRUE(worker.comes_to(SCHED_FIFO));
}

}  // namespace
}  // namespace rtbus
