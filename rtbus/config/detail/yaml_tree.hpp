#pragma once
/// @file yaml_tree.hpp
/// A YAML text as a plain tree with line numbers. Stricter than YAML where leniency hides mistakes: a key given twice,
/// a second document, tabs as indentation and tags are errors; size, depth and the growth through aliases are bounded.
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace rtbus::config::detail {

struct Entry;

struct Node {
  enum class Kind { kNull, kScalar, kList, kMap };
  Kind kind = Kind::kNull;
  std::string scalar;
  bool quoted = false;         ///< A quoted scalar is text, whatever it looks like.
  int line = 0;                ///< From 1; kFromOverride for a value of --set.
  std::vector<Node> items;     ///< kList
  std::vector<Entry> entries;  ///< kMap, in the file's order.

  [[nodiscard]] const Entry* find(std::string_view key) const;
  [[nodiscard]] Entry* find(std::string_view key);
};

struct Entry {
  std::string key;
  int line = 0;
  Node value;
};

inline constexpr int kFromOverride = 0;
inline constexpr std::size_t kMaxFileBytes = std::size_t{1} << 20;
inline constexpr std::size_t kMaxNodes = 100'000;
inline constexpr std::size_t kMaxDepth = 32;
inline constexpr std::size_t kMaxKeys = 1000;  ///< In one map.

/// Parses one document; an empty text gives a null node. `source` is the name of the file, for messages.
/// Throws Error "<source>:<line>: …".
[[nodiscard]] Node parse_yaml(std::string_view text, const std::string& source);

/// Reads and parses a file; `source` is how the user called it. Throws Error.
[[nodiscard]] Node read_yaml_file(const std::string& path, const std::string& source);

}  // namespace rtbus::config::detail
