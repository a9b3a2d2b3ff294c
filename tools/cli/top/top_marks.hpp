#pragma once
/// @file top_marks.hpp
/// Small drawings in characters: bars and sparklines, from block characters or, where the terminal cannot show them,
/// from ASCII. Pure functions; every character is one cell wide.
#include <span>
#include <string>
#include <vector>

namespace tools {

/// Cells that UTF-8 `text` of one-cell characters takes.
[[nodiscard]] std::size_t cells_of(const std::string& text) noexcept;

/// The first `cells` characters.
[[nodiscard]] std::string first_cells(const std::string& text, std::size_t cells);

/// "[######....|...]": how much of `limit` is used; the mark is the peak. What is no number counts as full, so that it
/// never looks harmless; without a limit the bar is empty.
[[nodiscard]] std::string limit_bar(double value, double peak, double limit, std::size_t width, bool utf8);

/// A bar of share 0…1 without a frame, padded to `width`; a share above zero shows at least a trace.
[[nodiscard]] std::string share_bar(double share, std::size_t width, bool utf8);

/// One character for a share 0…1; above zero it is never blank.
[[nodiscard]] std::string share_mark(double share, bool utf8);

/// The last `columns` of `values` between `low` and `high`, `rows` lines high, the upper one first. NaN is a gap;
/// beyond the range is drawn at its border; a shorter history stands at the right.
[[nodiscard]] std::vector<std::string> sparkline(std::span<const double> values, double low, double high,
                                                 std::size_t columns, std::size_t rows, bool utf8);

}  // namespace tools
