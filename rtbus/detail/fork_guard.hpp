#pragma once
/// @file fork_guard.hpp
/// A child of fork() inherits the descriptors of its parent's topics, and with them the kernel's locks: a dead writer
/// would seem to live as long as its child. A mapping keeps the open file, and its locks, as a descriptor does. Private
/// to rtbus.
#include <cstddef>

namespace rtbus::detail {

/// Watches the descriptor of a segment that carries a lock, and its mapping, from watch() to its destruction. In a
/// child of fork() the descriptor leads to /dev/null, the mapping holds zeros of its own, and `*owner` is false.
/// Neither copyable nor movable. @realtime No.
class ForkGuard {
 public:
  ForkGuard() = default;
  ~ForkGuard() { forget(); }
  ForkGuard(const ForkGuard&) = delete;
  ForkGuard& operator=(const ForkGuard&) = delete;

  /// @param owner Set to false in the child; may be null.
  void watch(int fd, void* base, std::size_t bytes, bool* owner) noexcept;
  void forget() noexcept;

 private:
  friend struct ForkGuards;
  int fd_ = -1;
  void* base_ = nullptr;
  std::size_t bytes_ = 0;
  bool* owner_ = nullptr;
  ForkGuard *before_ = nullptr, *after_ = nullptr;
};

}  // namespace rtbus::detail
