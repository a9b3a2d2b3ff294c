#pragma once
/// @file choose.hpp
/// Which session and which topic a command means when the user types as little as possible. Pure functions over what
/// topic_directory.hpp lists.
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rtbus/result.hpp"
#include "rtbus/topic_directory.hpp"

namespace tools {

/// Why nothing was chosen: one or more sentences for the user, with what exists instead.
struct Refusal {
  std::string message;
  int exit_status = 2;  ///< 2: the user named the wrong thing; 1: there is nothing to name.
};

/// Sessions in `topics`, sorted, each once. `live_only`: those with a topic whose writer lives.
[[nodiscard]] std::vector<std::string> sessions_in(std::span<const rtbus::TopicInfo> topics, bool live_only);

/// `wanted` if it exists; without it the only live session.
[[nodiscard]] rtbus::Result<std::string, Refusal> choose_session(std::span<const rtbus::TopicInfo> topics,
                                                                 const std::optional<std::string>& wanted);

/// The topic called `typed`, or the only one that begins with it, or the only one that contains it.
/// @param topics Of one session.
[[nodiscard]] rtbus::Result<std::string, Refusal> choose_topic(std::span<const rtbus::TopicInfo> topics,
                                                               std::string_view typed);

/// Fewest letters to insert, delete or replace to make `b` of `a` (Levenshtein).
[[nodiscard]] std::size_t edit_distance(std::string_view a, std::string_view b);

/// What both questions together led to.
struct Choice {
  rtbus::Session session;
  std::string topic;
};

/// Lists what is in /dev/shm and applies the two functions above.
[[nodiscard]] rtbus::Result<Choice, Refusal> choose(const std::optional<std::string>& wanted_session,
                                                    std::string_view typed_topic);

}  // namespace tools
