#pragma once
/// @file mapping_guard.hpp
/// A mapped segment whose file is shortened loses its pages: the next access raises SIGBUS. Private to rtbus.
///
/// The handler of this process puts zeroed memory of its own in the place of the whole mapping, marks the mapping as
/// lost, and lets the access go on. A reader then finds no newer sample, a writer writes where nobody looks, and the
/// housekeeping threads find lost(). The same holds when /dev/shm has no page left for a hole in the file.
/// A SIGBUS elsewhere goes to the handler that was there before, or ends the process as ever.
/// Why this way and no other: docs/decisions/0018-a-segment-that-loses-its-pages.md.
#include <cstddef>

namespace rtbus::detail {

/// Watches one mapping, from watch() to its destruction, which must come before the mapping's. Neither copyable nor
/// movable. @realtime The handler makes one system call, mmap, at the first access after the loss; none without a loss.
class MappingGuard {
 public:
  MappingGuard() = default;
  ~MappingGuard() { forget(); }
  MappingGuard(const MappingGuard&) = delete;
  MappingGuard& operator=(const MappingGuard&) = delete;

  /// Watches this mapping instead of the one before. The first call installs the handler. False: the process watches
  /// kMost mappings already, or the handler could not be installed. @realtime No.
  [[nodiscard]] bool watch(void* base, std::size_t bytes) noexcept;
  void forget() noexcept;

  /// The pages have gone; the mapping holds zeros, or what was written into it since. Any thread.
  [[nodiscard]] bool lost() const noexcept;

  /// Mappings that one process can watch; each open segment takes a file descriptor too.
  static constexpr std::size_t kMost = 4096;

 private:
  int index_ = -1;
};

}  // namespace rtbus::detail
