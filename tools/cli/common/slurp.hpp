#pragma once
/// @file slurp.hpp
/// Files whose size is not known beforehand.
#include <fstream>
#include <iterator>
#include <string>

namespace tools {

/// A whole file of /proc or /sys; "" when it cannot be read.
[[nodiscard]] inline std::string slurp(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

}  // namespace tools
