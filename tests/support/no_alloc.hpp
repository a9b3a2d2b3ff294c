#pragma once
/// @file no_alloc.hpp
/// Counts what a realtime thread must not do: allocations (malloc and everything above it: new, std containers) and
/// locks (pthread_mutex_lock and everything above it: std::mutex), in the calling thread.
/// Include it in exactly one source file of a test program that exports its symbols (ENABLE_EXPORTS), so that loaded
/// modules are counted too. Not under sanitizers, which bring their own malloc and their own locks.
#include <dlfcn.h>
#include <execinfo.h>
#include <pthread.h>

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>

// Its intrinsics declare posix_memalign once more, which clang takes only before the definition below.
#include <Eigen/Core>

#if !defined(RTBUS_SANITIZED)
extern "C" {
void* __libc_malloc(std::size_t bytes);
void* __libc_calloc(std::size_t count, std::size_t bytes);
void* __libc_realloc(void* block, std::size_t bytes);
void* __libc_memalign(std::size_t alignment, std::size_t bytes);
void __libc_free(void* block);
}

namespace tests {

/// What was caught in one stretch of code, or in many.
struct Caught {
  std::uint64_t allocations = 0;  ///< And frees.
  std::uint64_t locks = 0;
  static constexpr int kMaxFrames = 12;
  void* first_stack[kMaxFrames] = {};  ///< Of the first of either.
  int frames = 0;

  /// The functions of `first_stack`, one a line; allocates.
  [[nodiscard]] std::string where() const {
    std::string out;
    char** const names = backtrace_symbols(first_stack, frames);
    for (int i = 0; names != nullptr && i < frames; ++i) out += std::string("  ") + names[i] + '\n';
    std::free(names);
    return out;
  }
};

inline thread_local Caught* g_caught = nullptr;

inline void note(std::uint64_t Caught::*count) noexcept {
  Caught* const into = g_caught;
  if (into == nullptr) return;
  ++(into->*count);
  if (into->frames > 0) return;
  g_caught = nullptr;  // what the stack takes is not caught
  into->frames = backtrace(into->first_stack, Caught::kMaxFrames);
  g_caught = into;
}

/// While one lives, what this thread does is counted into `caught`.
class RealtimeTrap {
 public:
  explicit RealtimeTrap(Caught& caught) noexcept { g_caught = &caught; }
  ~RealtimeTrap() { g_caught = nullptr; }
  RealtimeTrap(const RealtimeTrap&) = delete;
  RealtimeTrap& operator=(const RealtimeTrap&) = delete;
};

}  // namespace tests

extern "C" {
void* malloc(std::size_t bytes) noexcept {
  tests::note(&tests::Caught::allocations);
  return __libc_malloc(bytes);
}
void* calloc(std::size_t count, std::size_t bytes) noexcept {
  tests::note(&tests::Caught::allocations);
  return __libc_calloc(count, bytes);
}
void* realloc(void* block, std::size_t bytes) noexcept {
  tests::note(&tests::Caught::allocations);
  return __libc_realloc(block, bytes);
}
void* aligned_alloc(std::size_t alignment, std::size_t bytes) noexcept {
  tests::note(&tests::Caught::allocations);
  return __libc_memalign(alignment, bytes);
}
int posix_memalign(void** out, std::size_t alignment, std::size_t bytes) noexcept {
  tests::note(&tests::Caught::allocations);
  *out = __libc_memalign(alignment, bytes);
  return *out != nullptr ? 0 : ENOMEM;
}
void free(void* block) noexcept {
  if (block != nullptr) tests::note(&tests::Caught::allocations);
  __libc_free(block);
}
int pthread_mutex_lock(pthread_mutex_t* mutex) noexcept {
  using Lock = int (*)(pthread_mutex_t*);
  static const Lock lock = reinterpret_cast<Lock>(dlsym(RTLD_NEXT, "pthread_mutex_lock"));
  tests::note(&tests::Caught::locks);
  return lock(mutex);
}
}
#endif
