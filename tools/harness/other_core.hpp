#pragma once
/// @file other_core.hpp
/// Work on another core of the machine, which is waited for.
#include <sched.h>

#include <atomic>
#include <exception>
#include <functional>
#include <thread>

namespace tools {

/// A thread of its own, bound to the cores that the caller does not run on. The caller is bound to its core until this
/// is gone. Where there is one core, both share it.
class OtherCore {
 public:
  OtherCore();
  ~OtherCore();
  OtherCore(const OtherCore&) = delete;
  OtherCore& operator=(const OtherCore&) = delete;

  /// Does the work there. The caller waits without giving up its core. What the work throws is thrown here.
  void run(const std::function<void()>& work);

 private:
  enum Turn { kCallers, kWorkers, kOver };
  void serve(const cpu_set_t* cores);

  cpu_set_t before_{};
  std::atomic<int> turn_{kCallers};
  const std::function<void()>* work_ = nullptr;
  std::exception_ptr thrown_;
  std::thread thread_;
};

}  // namespace tools
