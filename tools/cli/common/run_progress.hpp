#pragma once
/// @file run_progress.hpp
/// The one line on stderr that tells how a run gets on, and the lines of the nodes above it.
#include <string>
#include <string_view>

namespace tools {

class RunProgress {
 public:
  /// @param bar Draw the line: a terminal, a run that lasts, and nobody asked for silence. @param log Pass log lines
  /// on.
  RunProgress(bool bar, bool log) : bar_(bar), log_(log) {}
  ~RunProgress() { clear(); }
  RunProgress(const RunProgress&) = delete;
  RunProgress& operator=(const RunProgress&) = delete;

  /// Prints a line of a node above the progress line.
  void log(std::string_view line);

  /// Draws the line anew. @param total_s 0: runs until somebody ends it. @param figures "haptic0 1000 Hz 0.41 N".
  void show(double elapsed_s, double total_s, const std::string& figures);

  /// The same for work that is counted and not timed. @param share 0…1.
  void show_share(double share, const std::string& what);

  void clear();

  [[nodiscard]] bool has_bar() const noexcept { return bar_; }

  /// The bar alone, 20 characters: "[#####---------------]".
  [[nodiscard]] static std::string bar_text(double share);

 private:
  void draw(std::string line);
  bool bar_;
  bool log_;
  bool drawn_ = false;
};

}  // namespace tools
