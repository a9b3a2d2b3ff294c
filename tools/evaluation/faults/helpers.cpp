#include "tools/evaluation/faults/helpers.hpp"

#include <sched.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <new>
#include <thread>

#include "rtbus/clock.hpp"

namespace tools {

namespace {

/// In the child: nothing here outlives its purpose, whatever becomes of the process that wanted it.
void bound_this_process(double seconds) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  for (const int number : {SIGINT, SIGTERM, SIGHUP, SIGALRM}) ::signal(number, SIG_DFL);
  const auto whole = static_cast<rlim_t>(std::ceil(seconds)) + 1;
  const rlimit cpu{whole, whole};
  ::setrlimit(RLIMIT_CPU, &cpu);
  ::alarm(static_cast<unsigned>(whole));
}

void end(pid_t pid) {
  if (pid <= 1) return;
  ::kill(pid, SIGKILL);
  (void)::waitpid(pid, nullptr, 0);
}

}  // namespace

CpuHogs::CpuHogs(int count, int core, int fifo_priority, double seconds) {
  int ready[2];
  if (::pipe(ready) != 0) {
    ok_ = false;
    return;
  }
  for (int i = 0; i < count; ++i) {
    const pid_t pid = ::fork();
    if (pid == 0) {
      bound_this_process(seconds);
      bool fits = true;
      if (core >= 0) {
        cpu_set_t only;
        CPU_ZERO(&only);
        CPU_SET(static_cast<unsigned>(core), &only);
        fits = ::sched_setaffinity(0, sizeof only, &only) == 0;
      }
      sched_param parameters{};
      parameters.sched_priority = fifo_priority;
      const bool granted = fits && (fifo_priority == 0 || ::sched_setscheduler(0, SCHED_FIFO, &parameters) == 0);
      const std::uint64_t now_ns = granted ? rtbus::monotonic_ns() : 0;
      (void)!::write(ready[1], &now_ns, sizeof now_ns);
      if (!granted) ::_exit(1);
      const std::uint64_t end_ns = rtbus::monotonic_ns() + static_cast<std::uint64_t>(seconds * 1e9);
      while (rtbus::monotonic_ns() < end_ns) {
      }
      ::_exit(0);
    }
    if (pid > 0) pids_.push_back(pid);
  }
  ::close(ready[1]);
  std::size_t granted = 0;
  for (std::uint64_t at_ns = 0; granted < pids_.size() && ::read(ready[0], &at_ns, sizeof at_ns) == sizeof at_ns;) {
    if (at_ns == 0) break;
    if (granted++ == 0) began_ns_ = at_ns;
  }
  ::close(ready[0]);
  ok_ = granted == static_cast<std::size_t>(count);
}

CpuHogs::~CpuHogs() { std::for_each(pids_.begin(), pids_.end(), &end); }

int hogs_of_a_busy_machine() { return 2 * static_cast<int>(std::max(1U, std::thread::hardware_concurrency())); }

ForkStorm::ForkStorm(int most, double seconds) {
  void* const shared =
      ::mmap(nullptr, sizeof(std::atomic<int>), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (shared == MAP_FAILED) return;
  auto* const alive = new (shared) std::atomic<int>(1);
  pid_ = ::fork();
  if (pid_ == 0) {
    ::setpgid(0, 0);
    ::prctl(PR_SET_CHILD_SUBREAPER, 1);  // all of the storm end with this one
    bound_this_process(seconds);
    const std::uint64_t end_ns = rtbus::monotonic_ns() + static_cast<std::uint64_t>(seconds * 1e9);
    const pid_t first = ::getpid();
    // Every process forks on. The count bounds them: who would be one too many ends at once.
    while (rtbus::monotonic_ns() < end_ns) {
      if (alive->fetch_add(1) >= most) {
        alive->fetch_sub(1);
        while (::waitpid(-1, nullptr, WNOHANG) > 0) {
        }
        if (::getpid() != first) break;
        rtbus::sleep_until(rtbus::monotonic_ns() + rtbus::kNsPerMs);
        continue;
      }
      const pid_t pid = ::fork();
      if (pid == 0) ::prctl(PR_SET_PDEATHSIG, SIGKILL);
      if (pid < 0) alive->fetch_sub(1);
    }
    if (::getpid() != first) {
      alive->fetch_sub(1);
      ::_exit(0);
    }
    ::kill(0, SIGKILL);  // the group, this process among it
    ::_exit(0);
  }
  if (pid_ > 0) ::setpgid(pid_, pid_);
  ::munmap(shared, sizeof(std::atomic<int>));
}

ForkStorm::~ForkStorm() {
  if (pid_ <= 1) return;
  ::kill(-pid_, SIGKILL);
  (void)::waitpid(pid_, nullptr, 0);
}

}  // namespace tools
