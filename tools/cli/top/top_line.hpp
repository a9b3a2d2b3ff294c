#pragma once
/// @file top_line.hpp
/// Lines of the screen of `rtbus top`: parts with attributes, and figures with their units. Pure.
#include <cstdint>
#include <string>
#include <vector>

namespace tools {

enum class Tone : std::uint8_t { kPlain, kHeading, kGood, kWarn, kBad, kDim, kChosen };

/// One line. A part is the smallest thing that is shown or left out: half a figure would be a wrong one.
struct ViewLine {
  struct Part {
    std::string text;  ///< With the blanks that separate it from the part before.
    Tone tone = Tone::kPlain;
  };
  std::vector<Part> parts;

  ViewLine() = default;
  explicit ViewLine(std::string text, Tone tone = Tone::kPlain) { add(std::move(text), tone); }
  ViewLine& add(std::string text, Tone tone = Tone::kPlain) {
    parts.push_back({std::move(text), tone});
    return *this;
  }
  [[nodiscard]] std::string text() const;
  /// Leaves out the last parts until the line has at most `width` cells, and marks that; 0: any width.
  void fit(std::size_t width, bool utf8);
};

using Lines = std::vector<ViewLine>;

/// For the format %llu.
[[nodiscard]] constexpr unsigned long long count(std::uint64_t value) { return value; }

/// "01:02:03".
[[nodiscard]] std::string clock_text(double seconds);

/// How figures are shown. Everything comes in as SI.
struct Units {
  bool si = false;

  [[nodiscard]] std::string latency(double seconds) const { return figure(seconds, 1e6); }
  [[nodiscard]] std::string age(double seconds) const { return figure(seconds, 1e3); }
  [[nodiscard]] std::string length(double metres) const;  ///< With its sign.
  [[nodiscard]] const char* latency_unit() const { return si ? "s" : "us"; }
  [[nodiscard]] const char* age_unit() const { return si ? "s" : "ms"; }
  [[nodiscard]] const char* length_unit() const { return si ? "m" : "mm"; }

 private:
  [[nodiscard]] std::string figure(double value, double scale) const;
};

/// Three significant figures, whole from 100 on.
[[nodiscard]] std::string three_figures(double value);

/// A force in a few characters, whatever it is.
[[nodiscard]] std::string newtons(double force_n);

/// Breaks `text` at blanks into lines of at most `width` cells; 0: one line.
void add_wrapped(Lines& lines, const std::string& text, int width, Tone tone = Tone::kPlain);

}  // namespace tools
