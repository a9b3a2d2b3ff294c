#pragma once
/// @file users.hpp
/// Whether a test can become another user.
#include <unistd.h>

#include <cstdint>
#include <fstream>

namespace tests {

/// Root of a user namespace with this one user, in which tools/test_aarch64 runs: it can become nobody else, and give
/// no file away.
inline bool is_root_alone() {
  std::ifstream map("/proc/self/uid_map");  // user_namespaces(7): first here, first outside, how many
  std::uint64_t here = 0, outside = 0, count = 0, users = 0;
  while (map >> here >> outside >> count) users += count;
  return ::geteuid() == 0 && users == 1;
}

}  // namespace tests
