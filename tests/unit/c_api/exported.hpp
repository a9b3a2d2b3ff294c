#pragma once
/// @file exported.hpp
/// Symbols of a shared library against a pinned list.
#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>
#include <set>
#include <string>

namespace tests {

inline std::set<std::string> lines_of(const std::string& path) {
  std::set<std::string> out;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) out.insert(line);
  return out;
}

/// @param version Of the version script: a symbol, too.
inline std::set<std::string> exported_by(const std::string& library, const std::string& version) {
  std::set<std::string> out;
  FILE* const pipe = ::popen(("nm -D --defined-only " + library).c_str(), "r");
  if (pipe == nullptr) return out;
  char line[512];
  while (std::fgets(line, sizeof line, pipe) != nullptr) {
    std::string name(line);
    name = name.substr(name.rfind(' ') + 1);
    name = name.substr(0, name.find_first_of("@\n"));
    if (name != version) out.insert(name);
  }
  EXPECT_EQ(::pclose(pipe), 0);
  return out;
}

}  // namespace tests
