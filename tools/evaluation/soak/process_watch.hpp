#pragma once
/// @file process_watch.hpp
/// What the processes of a session hold: memory, descriptors, threads. From /proc.
#include <sys/types.h>

#include <cstdint>
#include <map>
#include <string>

namespace tools {

struct ProcessUse {
  pid_t pid = 0;
  std::int64_t resident_kib = 0;
  int descriptors = 0;
  int threads = 0;
};

/// A process and its children, by the name of their programs; of several with one name, the first. Those that end
/// meanwhile are left out.
[[nodiscard]] std::map<std::string, ProcessUse> uses_below(pid_t parent);

/// Segments of a session in /dev/shm, whatever state they are in.
[[nodiscard]] int segments_of(const std::string& session);

/// The most that one program has held more than when it was first seen.
struct UseGrowth {
  std::int64_t resident_kib = 0;
  int descriptors = 0;
  int threads = 0;
};

/// Compares what is held at quiet moments. A process that was started again is compared with the first of its name.
class ProcessWatch {
 public:
  void look(pid_t parent);
  /// Whether a program holds more descriptors now than when it was first seen.
  [[nodiscard]] bool more_descriptors(pid_t parent) const;
  [[nodiscard]] const std::map<std::string, UseGrowth>& growth() const noexcept { return growth_; }

 private:
  std::map<std::string, ProcessUse> first_;
  std::map<std::string, UseGrowth> growth_;
};

}  // namespace tools
