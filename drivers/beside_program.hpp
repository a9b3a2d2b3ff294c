#pragma once
/// @file beside_program.hpp
/// Where the build and an installation put modules and libraries of ours: beside the programs, or in ../lib.
#include <array>
#include <filesystem>
#include <string>

namespace drivers {

[[nodiscard]] inline std::array<std::filesystem::path, 2> program_folders() {
  std::error_code failed;
  const auto folder = std::filesystem::read_symlink("/proc/self/exe", failed).parent_path();
  return {folder, (folder / "../lib").lexically_normal()};
}

/// The whole path of `file`; empty: it is in neither folder.
[[nodiscard]] inline std::string find_beside_program(const std::string& file) {
  std::error_code failed;
  for (const auto& folder : program_folders()) {
    if (std::filesystem::is_regular_file(folder / file, failed)) return (folder / file).string();
  }
  return {};
}

}  // namespace drivers
