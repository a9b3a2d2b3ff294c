// Preloaded into the processes of a session whose wall clock is set (the row clock_stepped).
#include "tools/evaluation/faults/wall_clock.hpp"

#include <dlfcn.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#include <atomic>
#include <cmath>
#include <cstdlib>

namespace {

using ClockGettime = int (*)(clockid_t, timespec*);

const std::atomic<double>* offset() {
  static const std::atomic<double>* const shared = []() -> const std::atomic<double>* {
    const char* const file = std::getenv(tools::kWallClockVariable);
    const int fd = file != nullptr ? ::open(file, O_RDONLY | O_CLOEXEC) : -1;
    if (fd < 0) return nullptr;
    void* const at = ::mmap(nullptr, sizeof(double), PROT_READ, MAP_SHARED, fd, 0);
    ::close(fd);
    return at == MAP_FAILED ? nullptr : static_cast<const std::atomic<double>*>(at);
  }();
  return shared;
}

int real_time(clockid_t clock, timespec* out) {
  static const auto real = reinterpret_cast<ClockGettime>(::dlsym(RTLD_NEXT, "clock_gettime"));
  const int status = real(clock, out);
  if (status != 0 || clock != CLOCK_REALTIME || offset() == nullptr) return status;
  out->tv_sec += static_cast<time_t>(std::lround(offset()->load(std::memory_order_relaxed)));
  return status;
}

}  // namespace

extern "C" {

int clock_gettime(clockid_t clock, timespec* out) noexcept { return real_time(clock, out); }

int gettimeofday(timeval* out, void* /*zone*/) noexcept {
  timespec now{};
  const int status = real_time(CLOCK_REALTIME, &now);
  *out = {now.tv_sec, now.tv_nsec / 1000};
  return status;
}

time_t time(time_t* out) noexcept {
  timespec now{};
  (void)real_time(CLOCK_REALTIME, &now);
  if (out != nullptr) *out = now.tv_sec;
  return now.tv_sec;
}
}
