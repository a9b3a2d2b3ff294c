#pragma once
/// @file find_config.hpp
/// Where the project's own session and device files are.
#include <string>

namespace tools {

/// `name` under config/: from the folder where the command runs, else beside the build (build/bin/../../config).
/// Throws rtbus::config::Error when it is in neither.
[[nodiscard]] std::string find_config(const std::string& name);

}  // namespace tools
