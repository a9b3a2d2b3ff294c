#pragma once
/// @file top_keys.hpp
/// What a key does to what the user has chosen. Pure.
#include <cstdint>

#include "tools/cli/top/top_state.hpp"

namespace tools {

/// A key as the terminal's library gave it, without that library's numbers.
struct TopKey {
  enum class Kind : std::uint8_t { kNone, kCharacter, kNext, kPrevious, kPageUp, kPageDown, kEscape };
  Kind kind = Kind::kNone;
  char character = '\0';  ///< Of kCharacter.
};

/// @returns false when the user wants to quit.
[[nodiscard]] bool apply_key(const TopKey& key, const TopSnapshot& snapshot, TopChoice& choice);

}  // namespace tools
