#pragma once
/// @file started_with.hpp
/// The session file that a running node was started with, from the command line of its process.
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace tools {

struct StartedWith {
  std::string file;                      ///< Absolute where the process's folder could be read.
  std::vector<std::string> assignments;  ///< Values of its `--set`.

  bool operator==(const StartedWith&) const = default;
};

/// Reads /proc/PID/cmdline. None: the process may not be asked (another user, another container), or has no --config.
[[nodiscard]] std::optional<StartedWith> started_with(std::uint32_t pid);

}  // namespace tools
