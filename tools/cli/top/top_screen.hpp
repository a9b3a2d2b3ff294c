#pragma once
/// @file top_screen.hpp
/// The terminal of `rtbus top`, by ncurses. Nothing else includes ncurses.
#include "tools/cli/top/top_keys.hpp"
#include "tools/cli/top/top_line.hpp"

namespace tools {

/// Owns the terminal: whatever ends the command, the user gets it back as it was. One per process; one thread.
class Screen {
 public:
  Screen();
  ~Screen();
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;

  /// False when this terminal is unknown (TERM); nothing else may be called then.
  [[nodiscard]] bool works() const noexcept { return terminal_ != nullptr; }
  [[nodiscard]] bool utf8() const noexcept { return utf8_; }
  [[nodiscard]] int width() const noexcept;
  [[nodiscard]] int height() const noexcept;

  /// Sends only the cells that have changed.
  void draw(const Lines& lines);

  /// Waits for a key for at most `wait_ms`. A change of the window's size ends the wait too.
  /// @param resized Set when the size has changed.
  [[nodiscard]] TopKey key(int wait_ms, bool& resized);

 private:
  void* terminal_ = nullptr;  ///< ncurses' SCREEN.
  bool utf8_ = false;
};

}  // namespace tools
