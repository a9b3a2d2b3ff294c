#include "rtbus/detail/mapping_guard.hpp"

#include <signal.h>
#include <sys/mman.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstdint>

namespace rtbus::detail {
namespace {

/// A mapping; base 0: free, 1: being filled in. The handler runs in a thread that uses the mapping, so what it finds
/// under the faulting address stays there meanwhile.
struct Watched {
  std::atomic<std::uintptr_t> base{0};
  std::atomic<std::size_t> bytes{0};
  std::atomic<bool> lost{false};
};
static_assert(std::atomic<std::uintptr_t>::is_always_lock_free && std::atomic<bool>::is_always_lock_free);

constexpr std::uintptr_t kFilling = 1;
std::array<Watched, MappingGuard::kMost> g_watched;
std::atomic<int> g_used{0};  // one past the last entry that was ever taken
struct sigaction g_before {};

Watched* find(std::uintptr_t address) noexcept {
  const int used = g_used.load(std::memory_order_acquire);
  for (int i = 0; i < used; ++i) {
    Watched& entry = g_watched[static_cast<std::size_t>(i)];
    const std::uintptr_t base = entry.base.load(std::memory_order_acquire);
    if (base > kFilling && address >= base && address - base < entry.bytes.load(std::memory_order_relaxed)) {
      return &entry;
    }
  }
  return nullptr;
}

/// Only async-signal-safe calls; Linux's mmap and munlock are plain system calls.
bool replace_pages(Watched& entry) noexcept {
  auto* const base = reinterpret_cast<void*>(entry.base.load(std::memory_order_relaxed));
  const std::size_t bytes = entry.bytes.load(std::memory_order_relaxed);
  constexpr int kFlags = MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED;
  bool done = ::mmap(base, bytes, PROT_READ | PROT_WRITE, kFlags, -1, 0) != MAP_FAILED;
  if (!done && errno == EAGAIN) {
    // RLIMIT_MEMLOCK counts the old pages until they are unlocked.
    ::munlock(base, bytes);
    done = ::mmap(base, bytes, PROT_READ | PROT_WRITE, kFlags, -1, 0) != MAP_FAILED;
  }
  if (done) entry.lost.store(true, std::memory_order_release);
  return done;
}

void on_sigbus(int number, siginfo_t* info, void* context) noexcept {
  const int saved_errno = errno;
  // A positive code comes from the kernel, for an access; the others were sent by somebody.
  Watched* const entry = info->si_code > 0 ? find(reinterpret_cast<std::uintptr_t>(info->si_addr)) : nullptr;
  const bool handled = entry != nullptr && replace_pages(*entry);
  errno = saved_errno;
  if (handled) return;
  if ((g_before.sa_flags & SA_SIGINFO) != 0) {
    g_before.sa_sigaction(number, info, context);
  } else if (g_before.sa_handler != SIG_DFL && g_before.sa_handler != SIG_IGN) {
    g_before.sa_handler(number);
  } else {
    ::signal(number, SIG_DFL);
    ::raise(number);  // blocked until this handler returns
  }
}

bool install() noexcept {
  struct sigaction action {};
  action.sa_sigaction = on_sigbus;
  action.sa_flags = SA_SIGINFO | SA_ONSTACK;
  ::sigemptyset(&action.sa_mask);
  return ::sigaction(SIGBUS, &action, &g_before) == 0;
}

}  // namespace

bool MappingGuard::watch(void* base, std::size_t bytes) noexcept {
  static const bool installed = install();
  forget();
  if (!installed) return false;
  for (std::size_t i = 0; i < kMost; ++i) {
    Watched& entry = g_watched[i];
    std::uintptr_t free = 0;
    if (!entry.base.compare_exchange_strong(free, kFilling, std::memory_order_acquire)) continue;
    entry.bytes.store(bytes, std::memory_order_relaxed);
    entry.lost.store(false, std::memory_order_relaxed);
    entry.base.store(reinterpret_cast<std::uintptr_t>(base), std::memory_order_release);
    const int end = static_cast<int>(i) + 1;
    for (int used = g_used.load(std::memory_order_relaxed);
         used < end && !g_used.compare_exchange_weak(used, end, std::memory_order_release);) {
    }
    index_ = static_cast<int>(i);
    return true;
  }
  return false;
}

void MappingGuard::forget() noexcept {
  if (index_ < 0) return;
  g_watched[static_cast<std::size_t>(index_)].base.store(0, std::memory_order_release);
  index_ = -1;
}

bool MappingGuard::lost() const noexcept {
  return index_ >= 0 && g_watched[static_cast<std::size_t>(index_)].lost.load(std::memory_order_acquire);
}

}  // namespace rtbus::detail
