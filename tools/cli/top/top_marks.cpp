#include "tools/cli/top/top_marks.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace tools {

namespace {

/// Filled from below, in eighths.
constexpr std::array<const char*, 9> kColumn = {" ", "▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"};
constexpr std::array<const char*, 9> kColumnAscii = {" ", "_", ".", ":", "-", "=", "+", "*", "#"};
/// Filled from the left, in eighths.
constexpr std::array<const char*, 9> kRow = {"", "▏", "▎", "▍", "▌", "▋", "▊", "▉", "█"};

bool begins_character(char c) { return (static_cast<unsigned char>(c) & 0xc0u) != 0x80u; }

/// Of `whole` steps; what is no number is full.
std::size_t steps_of(double share, std::size_t whole) {
  if (std::isnan(share)) return whole;
  return static_cast<std::size_t>(std::lround(std::clamp(share, 0.0, 1.0) * static_cast<double>(whole)));
}

}  // namespace

std::size_t cells_of(const std::string& text) noexcept {
  return static_cast<std::size_t>(std::count_if(text.begin(), text.end(), begins_character));
}

std::string first_cells(const std::string& text, std::size_t cells) {
  std::size_t seen = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (begins_character(text[i]) && seen++ == cells) return text.substr(0, i);
  }
  return text;
}

std::string limit_bar(double value, double peak, double limit, std::size_t width, bool utf8) {
  const bool limited = limit > 0.0;
  const std::size_t full = limited ? steps_of(value / limit, width) : 0;
  const std::size_t mark = limited ? steps_of(peak / limit, width) : 0;
  std::string text = "[";
  for (std::size_t cell = 1; cell <= width; ++cell) {
    if (cell == mark) {
      text += utf8 ? "│" : "|";
    } else if (cell <= full) {
      text += utf8 ? "█" : "#";
    } else {
      text += utf8 ? "·" : ".";
    }
  }
  return text + "]";
}

std::string share_bar(double share, std::size_t width, bool utf8) {
  std::size_t eighths = steps_of(share, utf8 ? 8 * width : width);
  if (!utf8) eighths *= 8;
  if (share > 0.0 && eighths == 0) eighths = 1;
  std::string text;
  for (std::size_t cell = 0; cell < width; ++cell) {
    const std::size_t here = std::min<std::size_t>(8, eighths - std::min(eighths, 8 * cell));
    if (here == 0) {
      text += " ";
    } else if (utf8) {
      text += kRow[here];
    } else {
      text += here == 8 ? "#" : "-";
    }
  }
  return text;
}

std::string share_mark(double share, bool utf8) {
  std::size_t level = steps_of(share, 8);
  if (level == 0 && share > 0.0) level = 1;
  return utf8 ? kColumn[level] : kColumnAscii[level];
}

std::vector<std::string> sparkline(std::span<const double> values, double low, double high, std::size_t columns,
                                   std::size_t rows, bool utf8) {
  const std::size_t shown = std::min(values.size(), columns);
  const std::size_t whole = 8 * rows;
  std::vector<std::string> lines(rows, std::string(columns - shown, ' '));
  for (const double value : values.last(shown)) {
    // The lowest value still has its eighth: a line at zero is not a gap.
    const std::size_t level =
        std::isnan(value) ? 0
                          : std::max<std::size_t>(1, high > low ? steps_of((value - low) / (high - low), whole) : 1);
    for (std::size_t row = 0; row < rows; ++row) {
      const std::size_t below = 8 * (rows - 1 - row);
      const std::size_t here = std::min<std::size_t>(8, level - std::min(level, below));
      lines[row] += utf8 ? kColumn[here] : kColumnAscii[here];
    }
  }
  return lines;
}

}  // namespace tools
