#pragma once
/// @file top_view.hpp
/// The pages of `rtbus top` as lines of parts, made from what is known and what the user has chosen. Pure: no terminal,
/// no clock, no shared memory.
#include <optional>
#include <string>

#include "tools/cli/top/top_line.hpp"
#include "tools/cli/top/top_state.hpp"

namespace tools {

/// The page that the user has chosen: exactly `height` lines of at most `width` cells. With `height` 0 (for scripts)
/// nothing is left out; with `width` 0 lines may have any length.
/// @param sample What the topic page shows; the other pages do not need it.
[[nodiscard]] Lines page_lines(const TopSnapshot& snapshot, const std::optional<SampleView>& sample,
                               const TopChoice& choice, int width, int height);

/// Nodes and topics. What does not fit is shortened in this order: topics down to three lines, then drawings, then
/// the rest of the topics, then details of the nodes that are not chosen, then of the chosen one; what was left out is
/// counted.
[[nodiscard]] Lines overview_lines(const TopSnapshot& snapshot, const TopChoice& choice, int width, int height);

/// All topics, and the fields of the chosen one.
[[nodiscard]] Lines topic_lines(const TopSnapshot& snapshot, const std::optional<SampleView>& sample,
                                const TopChoice& choice, int width, int height);

[[nodiscard]] Lines help_lines(int width, int height);

/// RMS of the force between two LoopStats of one node [N]: their RMS values go over everything since start, so the
/// difference of the square sums is what happened in between. None when no tick lies between them.
[[nodiscard]] std::optional<double> force_between(const rtbus::LoopStats& before, const rtbus::LoopStats& now);

/// Where the chosen name stands; the first when it is not there.
template <class Named>
[[nodiscard]] std::size_t chosen_index(const std::vector<Named>& all, const std::string& name) {
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all[i].name == name) return i;
  }
  return 0;
}

}  // namespace tools
