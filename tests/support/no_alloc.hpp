#pragma once
/// @file no_alloc.hpp
/// Counts what a stretch of code allocates: malloc and everything above it (new, std containers) in the calling thread.
/// Include it in exactly one source file of a test program. Not under sanitizers, which bring their own malloc.
#include <cstddef>
#include <cstdint>

#if !defined(RTBUS_SANITIZED)
extern "C" {
void* __libc_malloc(std::size_t bytes);
void* __libc_calloc(std::size_t count, std::size_t bytes);
void* __libc_realloc(void* block, std::size_t bytes);
void __libc_free(void* block);
}

namespace tests {

inline thread_local bool g_counting = false;
inline thread_local std::uint64_t g_allocations = 0;

/// While one lives, allocations and frees of this thread are counted.
class AllocationTrap {
 public:
  AllocationTrap() noexcept {
    g_allocations = 0;
    g_counting = true;
  }
  ~AllocationTrap() { g_counting = false; }
  AllocationTrap(const AllocationTrap&) = delete;
  AllocationTrap& operator=(const AllocationTrap&) = delete;
  [[nodiscard]] std::uint64_t count() const noexcept { return g_allocations; }
};

}  // namespace tests

extern "C" {
void* malloc(std::size_t bytes) noexcept {
  if (tests::g_counting) ++tests::g_allocations;
  return __libc_malloc(bytes);
}
void* calloc(std::size_t count, std::size_t bytes) noexcept {
  if (tests::g_counting) ++tests::g_allocations;
  return __libc_calloc(count, bytes);
}
void* realloc(void* block, std::size_t bytes) noexcept {
  if (tests::g_counting) ++tests::g_allocations;
  return __libc_realloc(block, bytes);
}
void free(void* block) noexcept {
  if (tests::g_counting && block != nullptr) ++tests::g_allocations;
  __libc_free(block);
}
}
#endif
