#pragma once
/// @file gnuplot.hpp
/// Figures through gnuplot. The data (TSV) and the script (.gp) stay beside each figure, so that anyone can draw it
/// again or anew: `gnuplot motion_haptic0.gp` in its folder.
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtbus/result.hpp"

namespace tools {

/// One figure: data files and the gnuplot commands that draw them.
struct Figure {
  std::string stem;  ///< File name without suffix: "motion_haptic0".
  std::string body;  ///< Everything between `set output` and its end. Data files by their bare names.
  int width_px = 1200;
  int height_px = 700;
  bool svg = true;  ///< False: PNG alone, for what is made of pixels.
};

class Gnuplot {
 public:
  /// Looks for gnuplot on the PATH and asks which PNG terminal it has; nullopt when there is none.
  [[nodiscard]] static std::optional<Gnuplot> find();

  /// Writes `<stem>.gp` into `folder` and draws `<stem>.png` and `<stem>.svg` there. @returns both, or what gnuplot
  /// said.
  [[nodiscard]] rtbus::Result<std::vector<std::filesystem::path>, std::string> draw(const std::filesystem::path& folder,
                                                                                    const Figure& figure) const;

  /// What draw() writes into the .gp file.
  [[nodiscard]] std::string script(const Figure& figure) const;

 private:
  explicit Gnuplot(std::string png_terminal) : png_terminal_(std::move(png_terminal)) {}
  std::string png_terminal_;
};

/// `text` as a string of gnuplot's, with the quotes.
[[nodiscard]] std::string gnuplot_quoted(std::string_view text);

}  // namespace tools
