/// A thread with the name and the rhythm of a haptic loop, and one system call that does not belong there: what
/// syscall_test.cpp must see.
#include <sys/syscall.h>
#include <unistd.h>

#include <thread>

#include "rtbus/clock.hpp"
#include "rtbus/realtime.hpp"

int main() {
  std::thread loop([] {
    rtbus::name_this_thread("haptic_loop");
    for (int tick = 0; tick < 20; ++tick) {
      rtbus::sleep_until(rtbus::monotonic_ns() + rtbus::kNsPerMs);
      if (tick == 10) syscall(SYS_getppid);
    }
  });
  loop.join();
  return 0;
}
