#pragma once
/// @file tree_python.hpp
/// Programs in Python beside a build of the source tree use the tree's own package `rtbus`, and need no settings.
#include <string>
#include <utility>
#include <vector>

namespace tools {

/// What such a program's environment needs: `PYTHONPATH`, with the tree's package behind what the user has there, and
/// `RTBUS_LIBRARY_DIR`, unless the user has set it. Empty for an installed program: its package is in Python's folders.
[[nodiscard]] std::vector<std::pair<std::string, std::string>> tree_python();

}  // namespace tools
