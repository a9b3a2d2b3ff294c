#pragma once
/// @file run_program.hpp
/// Runs a drawing program (gnuplot, povray) and waits for it.
#include <filesystem>
#include <string>
#include <vector>

namespace tools {

struct ProgramOutcome {
  int status = -1;     ///< Exit status; −1 when it did not run or was killed.
  std::string output;  ///< stdout and stderr.

  /// What it said, in one line: without position marks and blank lines, at most 300 bytes.
  [[nodiscard]] std::string complaint() const;
};

/// Runs `program` from the PATH in `folder`, stdin empty.
[[nodiscard]] ProgramOutcome run_program(const std::string& program, const std::filesystem::path& folder,
                                         std::vector<std::string> arguments);

}  // namespace tools
