#include "rtbus/realtime.hpp"

#include <fcntl.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <fstream>

namespace rtbus {

namespace {

constexpr int kMinPriority = 1;
constexpr int kMaxPriority = 98;         // 99 stays with the kernel's own threads
constexpr int kSignOfLifePriority = 10;  // above everything ordinary, far below any loop
constexpr std::size_t kStackPrefaultBytes = std::size_t{256} * 1024;

/// One descriptor per process holds the request; −1: not held.
std::atomic<int> g_dma_latency_fd{-1};

std::string because(int number) { return std::string(" (") + std::strerror(number) + ")"; }

/// CPUs this thread may run on, ascending; empty when the kernel does not say.
std::vector<int> allowed_cores() {
  std::vector<int> cores;
  cpu_set_t set;
  CPU_ZERO(&set);
  if (::sched_getaffinity(0, sizeof set, &set) != 0) return cores;
  for (int core = 0; core < CPU_SETSIZE; ++core) {
    if (CPU_ISSET(core, &set)) cores.push_back(core);
  }
  return cores;
}

void choose_core(const RealtimeRequest& request, RealtimeGrant& grant) {
  const std::vector<int> before = allowed_cores();
  const int core = request.core >= 0 ? request.core : (before.empty() ? 0 : before.back());
  int number = EINVAL;
  if (core < CPU_SETSIZE) {
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET(core, &set);
    number = ::sched_setaffinity(0, sizeof set, &set) == 0 ? 0 : errno;
  }
  if (number != 0) {
    std::string allowed;
    for (const int each : before) allowed += (allowed.empty() ? "" : ",") + std::to_string(each);
    grant.warnings.push_back("core " + std::to_string(core) + " refused" + because(number) +
                             ": the loop may be moved between cores and lose its caches; choose one of " + allowed +
                             " or widen the process's cpuset");
  }
  // What counts is what the kernel says now.
  const std::vector<int> after = allowed_cores();
  grant.core = after.size() == 1 ? after.front() : -1;
}

void set_fifo(const RealtimeRequest& request, RealtimeGrant& grant) {
  sched_param parameters{};
  parameters.sched_priority = std::clamp(request.priority, kMinPriority, kMaxPriority);
  if (parameters.sched_priority != request.priority) {
    grant.warnings.push_back("priority " + std::to_string(request.priority) + " is outside 1…98; using " +
                             std::to_string(parameters.sched_priority));
  }
  // SCHED_RESET_ON_FORK: helpers that this thread starts later do not inherit the priority.
  int number = ::sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &parameters) == 0 ? 0 : errno;
  rlimit limit{};
  if (number == EPERM && ::getrlimit(RLIMIT_RTPRIO, &limit) == 0 && limit.rlim_cur >= kMinPriority &&
      limit.rlim_cur < static_cast<rlim_t>(parameters.sched_priority)) {
    // Less than asked is far better than nothing.
    parameters.sched_priority = static_cast<int>(limit.rlim_cur);
    number = ::sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &parameters) == 0 ? 0 : errno;
    if (number == 0) {
      grant.warnings.push_back("priority " + std::to_string(request.priority) + " refused, " +
                               std::to_string(parameters.sched_priority) +
                               " granted: that is the limit of this user (ulimit -r); raise rtprio in "
                               "/etc/security/limits.d/realtime.conf");
    }
  }
  const int policy = ::sched_getscheduler(0);
  sched_param granted{};
  if (policy >= 0 && (policy & ~SCHED_RESET_ON_FORK) == SCHED_FIFO && ::sched_getparam(0, &granted) == 0) {
    grant.fifo = true;
    grant.priority = granted.sched_priority;
    return;
  }
  grant.warnings.push_back(
      "no SCHED_FIFO" + because(number) +
      ": any other process may delay the loop by milliseconds; add the line `@realtime - rtprio 98` "
      "to /etc/security/limits.d/realtime.conf, join the group `realtime` and log in again (check "
      "with ulimit -r), or run `setcap cap_sys_nice,cap_ipc_lock=ep` on the binary");
}

/// True when this process may lock as much as it likes.
bool may_lock_everything() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_MEMLOCK, &limit) == 0 && limit.rlim_cur == RLIM_INFINITY) return true;
  // With CAP_IPC_LOCK the limit does not count. The kernel prints the effective set as hexadecimal.
  std::ifstream status("/proc/self/status");
  std::string word;
  while (status >> word) {
    if (word == "CapEff:" && status >> word) return ((std::stoull(word, nullptr, 16) >> 14) & 1u) != 0;  // CAP_IPC_LOCK
  }
  return false;
}

void lock_memory(RealtimeGrant& grant) {
  // Under a limit, MCL_FUTURE would make a later mmap or malloc fail once the limit is reached: a small limit then
  // locks what is there now. Topics that come later are faulted in when they are opened, but not locked.
  if (::mlockall(may_lock_everything() ? MCL_CURRENT | MCL_FUTURE : MCL_CURRENT) == 0) {
    grant.memory_locked = true;
    return;
  }
  grant.warnings.push_back(
      "memory not locked" + because(errno) +
      ": a page fault may cost the loop milliseconds; add the line `@realtime - memlock unlimited` "
      "to /etc/security/limits.d/realtime.conf and log in again (check with ulimit -l), or run "
      "`setcap cap_sys_nice,cap_ipc_lock=ep` on the binary");
}

/// The kernel honours the request for as long as the descriptor is open.
void hold_dma_latency(RealtimeGrant& grant) {
  if (g_dma_latency_fd.load() >= 0) {
    grant.dma_latency_held = true;
    return;
  }
  const int fd = ::open("/dev/cpu_dma_latency", O_WRONLY | O_CLOEXEC);
  const std::int32_t microseconds = 0;
  if (fd >= 0 && ::write(fd, &microseconds, sizeof microseconds) == sizeof microseconds) {
    int none = -1;
    if (!g_dma_latency_fd.compare_exchange_strong(none, fd)) ::close(fd);  // another thread was quicker
    grant.dma_latency_held = true;
    return;
  }
  const int number = errno;
  if (fd >= 0) ::close(fd);
  grant.warnings.push_back("/dev/cpu_dma_latency not held" + because(number) +
                           ": the CPU may sleep deeply between cycles and wake up 6 to 7 times slower; as root run "
                           "`chgrp realtime /dev/cpu_dma_latency && chmod g+w /dev/cpu_dma_latency`, or a udev rule "
                           "that does");
}

/// Touches the stack below this frame, so that the loop meets no page fault there.
[[gnu::noinline]] void prefault_stack() noexcept {
  std::array<char, kStackPrefaultBytes> stack;
  volatile char* const bytes = stack.data();
  for (std::size_t i = 0; i < stack.size(); i += 1024) bytes[i] = 0;
}

}  // namespace

std::string RealtimeGrant::summary() const {
  std::string line = fifo ? "SCHED_FIFO " + std::to_string(priority) : std::string("SCHED_OTHER");
  line += core >= 0 ? ", core " + std::to_string(core) : std::string(", any core");
  line += memory_locked ? ", memory locked" : ", memory not locked";
  line += dma_latency_held ? ", cpu_dma_latency 0 us" : ", cpu_dma_latency not held";
  return line;
}

RealtimeGrant enter_realtime(const RealtimeRequest& request) {
  RealtimeGrant grant;
  if (request.lock_memory) lock_memory(grant);
  prefault_stack();
  choose_core(request, grant);
  if (request.hold_dma_latency) hold_dma_latency(grant);
  set_fifo(request, grant);
  return grant;
}

void leave_realtime() noexcept {
  const int fd = g_dma_latency_fd.exchange(-1);
  if (fd >= 0) ::close(fd);
}

ThreadScheduling::ThreadScheduling() noexcept
    : policy_(::sched_getscheduler(0)), cores_known_(::sched_getaffinity(0, sizeof cores_, &cores_) == 0) {
  sched_param parameters{};
  if (::sched_getparam(0, &parameters) == 0) priority_ = parameters.sched_priority;
}

void ThreadScheduling::restore() const noexcept {
  sched_param parameters{};
  parameters.sched_priority = priority_;
  // The flag may not be taken back without privilege.
  (void)::sched_setscheduler(0, policy_ | SCHED_RESET_ON_FORK, &parameters);
  if (cores_known_) (void)::sched_setaffinity(0, sizeof cores_, &cores_);
}

bool prefer_on_time() noexcept {
  sched_param parameters{};
  parameters.sched_priority = kSignOfLifePriority;
  return ::sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &parameters) == 0;
}

bool stay_off_cores(const std::vector<int>& cores) noexcept {
  const std::vector<int> allowed = allowed_cores();
  cpu_set_t left;
  CPU_ZERO(&left);
  int count = 0;
  for (const int core : allowed) {
    const auto is_taken = [&](int taken) { return core == (taken < 0 ? allowed.back() : taken); };
    if (std::any_of(cores.begin(), cores.end(), is_taken)) continue;
    CPU_SET(core, &left);
    ++count;
  }
  return count > 0 && ::sched_setaffinity(0, sizeof left, &left) == 0;
}

void name_this_thread(const char* name) noexcept { ::prctl(PR_SET_NAME, name, 0, 0, 0); }

}  // namespace rtbus
