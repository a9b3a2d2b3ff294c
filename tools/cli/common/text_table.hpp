#pragma once
/// @file text_table.hpp
/// Columns for people: each as wide as its longest cell, figures to the right.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

namespace tools {

class TextTable {
 public:
  enum class Align { kLeft, kRight };

  /// One entry per column.
  explicit TextTable(std::vector<std::pair<std::string, Align>> columns) {
    std::vector<std::string> headings;
    for (auto& [heading, align] : columns) {
      headings.push_back(std::move(heading));
      aligns_.push_back(align);
    }
    rows_.push_back(std::move(headings));
  }

  /// Missing cells stay empty.
  void add(std::vector<std::string> cells) {
    cells.resize(aligns_.size());
    rows_.push_back(std::move(cells));
  }

  [[nodiscard]] bool empty() const { return rows_.size() == 1; }

  /// The lines, headings first, without trailing blanks.
  [[nodiscard]] std::vector<std::string> lines() const {
    std::vector<std::size_t> widths(aligns_.size(), 0);
    for (const auto& row : rows_) {
      for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
    }
    std::vector<std::string> lines;
    for (const auto& row : rows_) {
      std::string line;
      for (std::size_t i = 0; i < row.size(); ++i) {
        const std::string blanks(widths[i] - row[i].size(), ' ');
        line += (i == 0 ? "" : "  ") + (aligns_[i] == Align::kLeft ? row[i] + blanks : blanks + row[i]);
      }
      line.erase(line.find_last_not_of(' ') + 1);
      lines.push_back(std::move(line));
    }
    return lines;
  }

 private:
  std::vector<Align> aligns_;
  std::vector<std::vector<std::string>> rows_;
};

/// `value` with `decimals` digits after the point.
[[nodiscard]] inline std::string fixed(double value, int decimals) {
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return text;
}

/// "430 KiB", "1.3 MiB": three figures at most.
[[nodiscard]] inline std::string human_bytes(std::uint64_t bytes) {
  const char* const units[] = {"B", "KiB", "MiB", "GiB", "TiB"};
  double value = static_cast<double>(bytes);
  std::size_t unit = 0;
  while (value >= 1024.0 && unit + 1 < std::size(units)) value /= 1024.0, ++unit;
  return fixed(value, unit == 0 || value >= 100.0 ? 0 : 1) + " " + units[unit];
}

}  // namespace tools
