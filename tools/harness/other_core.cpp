#include "tools/harness/other_core.hpp"

#include <utility>

namespace tools {

OtherCore::OtherCore() {
  CPU_ZERO(&before_);
  (void)::sched_getaffinity(0, sizeof before_, &before_);
  cpu_set_t here, others = before_;
  CPU_ZERO(&here);
  const int core = ::sched_getcpu();
  const bool free = core >= 0 && CPU_COUNT(&before_) > 1;
  if (free) {
    CPU_SET(core, &here);
    CPU_CLR(core, &others);
    (void)::sched_setaffinity(0, sizeof here, &here);
  }
  thread_ = std::thread([this, others] { serve(&others); });
}

OtherCore::~OtherCore() {
  turn_.store(kOver, std::memory_order_release);
  turn_.notify_one();
  thread_.join();
  (void)::sched_setaffinity(0, sizeof before_, &before_);
}

void OtherCore::serve(const cpu_set_t* cores) {
  (void)::sched_setaffinity(0, sizeof *cores, cores);
  for (;;) {
    turn_.wait(kCallers, std::memory_order_acquire);
    if (turn_.load(std::memory_order_acquire) == kOver) return;
    try {
      (*work_)();
    } catch (...) {
      thrown_ = std::current_exception();
    }
    turn_.store(kCallers, std::memory_order_release);
  }
}

void OtherCore::run(const std::function<void()>& work) {
  work_ = &work;
  turn_.store(kWorkers, std::memory_order_release);
  turn_.notify_one();
  while (turn_.load(std::memory_order_acquire) != kCallers) std::this_thread::yield();
  if (thrown_) std::rethrow_exception(std::exchange(thrown_, nullptr));
}

}  // namespace tools
