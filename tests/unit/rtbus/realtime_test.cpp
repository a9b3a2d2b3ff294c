// What a thread asked for is compared with what the kernel says, with and without privileges.
#include "rtbus/realtime.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <thread>

#include "tests/support/users.hpp"

namespace rtbus {
namespace {

/// Runs `check` in a forked child, since locking memory and priorities outlive a test otherwise.
int in_child(int (*check)()) {
  const pid_t pid = ::fork();
  if (pid == 0) ::_exit(check());
  int status = 0;
  ::waitpid(pid, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST(Realtime, StaysOffTheCoresOfALoopUnlessNoneIsLeft) {
  const int outcome = in_child([] {
    cpu_set_t before;
    ::sched_getaffinity(0, sizeof before, &before);
    int last = -1;
    for (int core = 0; core < CPU_SETSIZE; ++core) {
      if (CPU_ISSET(core, &before)) last = core;
    }
    cpu_set_t after;
    const bool several = CPU_COUNT(&before) > 1;
    if (stay_off_cores({-1, last}) != several) return 1;
    ::sched_getaffinity(0, sizeof after, &after);
    if (CPU_COUNT(&after) != CPU_COUNT(&before) - (several ? 1 : 0)) return 2;
    return several && CPU_ISSET(last, &after) ? 3 : 0;
  });
  EXPECT_EQ(outcome, 0);
}

TEST(Realtime, GrantSaysWhatTheKernelSays) {
  const int outcome = in_child([] {
    const RealtimeGrant grant = enter_realtime({.priority = 42, .lock_memory = false});
    const int policy = ::sched_getscheduler(0) & ~SCHED_RESET_ON_FORK;
    sched_param parameters{};
    ::sched_getparam(0, &parameters);
    cpu_set_t set;
    ::sched_getaffinity(0, sizeof set, &set);
    if (grant.fifo != (policy == SCHED_FIFO)) return 1;
    if (grant.fifo && (grant.priority != 42 || parameters.sched_priority != 42)) return 2;
    if (!grant.fifo && grant.warnings.empty()) return 3;
    if ((grant.core >= 0) != (CPU_COUNT(&set) == 1)) return 4;
    if (grant.core >= 0 && !CPU_ISSET(grant.core, &set)) return 5;
    if (grant.memory_locked) return 6;
    leave_realtime();
    leave_realtime();
    return 0;
  });
  EXPECT_EQ(outcome, 0);
}

TEST(Realtime, WithoutPrivilegesItStillRunsAndNamesTheRemedies) {
  if (tests::is_root_alone()) GTEST_SKIP() << "root can become nobody else";
  const int outcome = in_child([] {
    const rlimit none{0, 0};
    ::setrlimit(RLIMIT_RTPRIO, &none);
    ::setrlimit(RLIMIT_MEMLOCK, &none);
    if (::geteuid() == 0 && (::setresgid(65534, 65534, 65534) != 0 || ::setresuid(65534, 65534, 65534) != 0)) return 1;
    const RealtimeGrant grant = enter_realtime({});
    if (grant.fifo || grant.priority != 0) return 2;
    std::string all;
    for (const std::string& warning : grant.warnings) all += warning + "\n";
    if (all.find("@realtime - rtprio 98") == std::string::npos) return 3;
    if (all.find("setcap") == std::string::npos) return 4;
    if (grant.summary().find("SCHED_OTHER") != 0) return 5;
#ifndef RTBUS_SANITIZED  // sanitizers turn mlockall into a success that does nothing
    if (grant.memory_locked || all.find("memlock") == std::string::npos) return 6;
#endif
    return 0;
  });
  EXPECT_EQ(outcome, 0);
}

TEST(Realtime, ACoreThatDoesNotExistIsAWarning) {
  const int outcome = in_child([] {
    for (const int core : {CPU_SETSIZE - 1, CPU_SETSIZE, 1 << 30}) {
      const RealtimeGrant grant = enter_realtime({.core = core, .lock_memory = false, .hold_dma_latency = false});
      if (grant.core == core || grant.warnings.empty()) return 1;
      if (grant.warnings.front().find("core " + std::to_string(core) + " refused") != 0) return 2;
    }
    return 0;
  });
  EXPECT_EQ(outcome, 0);
}

TEST(Realtime, SummaryIsOneLine) {
  RealtimeGrant grant;
  EXPECT_EQ(grant.summary(), "SCHED_OTHER, any core, memory not locked, cpu_dma_latency not held");
  grant.fifo = grant.memory_locked = grant.dma_latency_held = true;
  grant.priority = 80;
  grant.core = 1;
  EXPECT_EQ(grant.summary(), "SCHED_FIFO 80, core 1, memory locked, cpu_dma_latency 0 us");
  EXPECT_STREQ(grant.scheduling(), "SCHED_FIFO");
}

TEST(Realtime, ThreadsCarryTheirNames) {
  std::thread([] {
    name_this_thread("haptic_loop_with_a_long_name");
    char name[16] = {};
    ::prctl(PR_GET_NAME, name, 0, 0, 0);
    EXPECT_STREQ(name, "haptic_loop_wit");
  }).join();
}

}  // namespace
}  // namespace rtbus
