#pragma once
/// @file tmux.hpp
/// A terminal whose screen a test can read: a shell in a tmux server of its own.
#include <unistd.h>

#include <cstdio>
#include <string>

#include "tests/support/process.hpp"

namespace tests {

/// The shell says "ready> " before each command. The server dies with the object.
class Tmux {
 public:
  static bool available() { return run("command -v tmux") != ""; }

  /// @param locale For the shell and what it starts, for example "C.UTF-8".
  Tmux(int width, int height, const std::string& locale)
      : server_("tmux -L rtbus_test_" + std::to_string(getpid()) + "_" + std::to_string(++made_)) {
    (void)run("env -u TMUX LC_ALL=" + locale + " " + server_ + " -u -f /dev/null new -d -x " + std::to_string(width) +
              " -y " + std::to_string(height) + " 'sh -i'");
    type("PS1=\"rea\"\"dy> \"; clear");  // typed so that it is not yet what one waits for
  }
  ~Tmux() { (void)run(server_ + " kill-server"); }
  Tmux(const Tmux&) = delete;
  Tmux& operator=(const Tmux&) = delete;

  /// Keys by tmux's names: "q", "Enter", "PageDown".
  void press(const std::string& key) const { (void)run(server_ + " send-keys '" + key + "'"); }
  /// A line for the shell.
  void type(const std::string& line) const {
    (void)run(server_ + " send-keys -l '" + line + "'");
    press("Enter");
  }
  void resize(int width, int height) const {
    (void)run(server_ + " resize-window -x " + std::to_string(width) + " -y " + std::to_string(height));
  }
  [[nodiscard]] std::string screen() const { return run(server_ + " capture-pane -p"); }

  /// Waits until `text` is on the screen; the last screen is left in seen().
  bool shows(const std::string& text, double timeout_s = 20.0) {
    return eventually(timeout_s, [&] { return (seen_ = screen()).find(text) != std::string::npos; });
  }
  bool shows_no(const std::string& text, double timeout_s = 20.0) {
    return eventually(timeout_s, [&] { return (seen_ = screen()).find(text) == std::string::npos; });
  }
  [[nodiscard]] const std::string& seen() const { return seen_; }

 private:
  /// What the command printed.
  static std::string run(const std::string& command) {
    std::string out;
    FILE* const pipe = popen((command + " 2>/dev/null").c_str(), "r");
    if (pipe == nullptr) return out;
    char buffer[4096];
    for (std::size_t got = 0; (got = fread(buffer, 1, sizeof buffer, pipe)) > 0;) out.append(buffer, got);
    pclose(pipe);
    return out;
  }

  static inline int made_ = 0;
  std::string server_;
  std::string seen_;
};

}  // namespace tests
