#include "tools/cli/top/top_line.hpp"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <string_view>

#include "tools/cli/common/formatted.hpp"
#include "tools/cli/top/top_marks.hpp"

namespace tools {

std::string ViewLine::text() const {
  std::string out;
  for (const Part& part : parts) out += part.text;
  return out;
}

void ViewLine::fit(std::size_t width, bool utf8) {
  if (width == 0) return;
  std::size_t used = 0;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const std::size_t cells = cells_of(parts[i].text);
    if (used + cells <= width) {
      used += cells;
      continue;
    }
    if (i == 0) {  // a title wider than the window: its beginning is better than nothing
      parts[0].text = first_cells(parts[0].text, width);
      parts.resize(1);
      return;
    }
    // Blanks at the end, or a part too wide: both make room for the mark.
    parts.resize(i);
    if (used + 2 <= width) add(utf8 ? " …" : " ~", Tone::kDim);
    return;
  }
}

std::string clock_text(double seconds) {
  const auto whole = static_cast<long long>(std::clamp(seconds, 0.0, 1e12));
  return formatted("%02lld:%02lld:%02lld", whole / 3600, whole / 60 % 60, whole % 60);
}

std::string three_figures(double value) {
  const double size = std::abs(value);
  if (!(size < 1e6) || size < 0.995) return formatted("%.3g", value);
  return formatted("%.*f", size >= 99.95 ? 0 : size >= 9.995 ? 1 : 2, value);
}

std::string newtons(double force_n) {
  return std::abs(force_n) < 1e4 ? formatted("%.2f", force_n) : formatted("%.2g", force_n);
}

std::string Units::figure(double value, double scale) const {
  return si ? formatted("%.3g", value) : three_figures(value * scale);
}

std::string Units::length(double metres) const {
  return si ? formatted("%+.4f", metres) : formatted("%+.1f", metres * 1e3);
}

void add_wrapped(Lines& lines, const std::string& text, int width, Tone tone) {
  const auto limit = static_cast<std::size_t>(std::max(0, width));
  std::string_view rest = text;
  while (limit > 0 && rest.size() > limit) {
    const std::size_t blank = rest.rfind(' ', limit);
    const bool usable = blank != std::string_view::npos && blank > 0;
    lines.emplace_back(std::string(rest.substr(0, usable ? blank : limit)), tone);
    rest.remove_prefix(usable ? blank + 1 : limit);
  }
  lines.emplace_back(std::string(rest), tone);
}

}  // namespace tools
