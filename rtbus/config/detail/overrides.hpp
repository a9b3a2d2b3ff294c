#pragma once
/// @file overrides.hpp
/// `--set` on a tree: find the place, put the value there, and remember what leads into a file not yet read.
#include <string>
#include <vector>

#include "rtbus/config/detail/yaml_tree.hpp"
#include "rtbus/config/document.hpp"

namespace rtbus::config::detail {

/// What is left of an override's way below the root of one file.
struct Assignment {
  std::vector<std::string> way;  ///< Components still to walk.
  Override whole;                ///< As the user gave it, for messages.
};

/// An override that met a scalar on its way. When that scalar names a file, it goes on there.
struct Detour {
  std::string at;  ///< Path of the scalar, list items by index: "haptic.0.device".
  Assignment rest;
};

/// "haptic.0.rate_hz" → {"haptic", "0", "rate_hz"}.
[[nodiscard]] std::vector<std::string> split_path(const std::string& path);

/// Applies all assignments to `root`, whose own path is `prefix`; returns those that met a scalar. Throws Error.
[[nodiscard]] std::vector<Detour> apply(std::vector<Assignment> assignments, const std::string& prefix, Node& root);

/// "haptic" + "0" → "haptic.0"
[[nodiscard]] std::string path_below(const std::string& path, const std::string& key);

}  // namespace rtbus::config::detail
