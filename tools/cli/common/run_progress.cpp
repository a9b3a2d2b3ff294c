#include "tools/cli/common/run_progress.hpp"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

#include "tools/cli/common/text_table.hpp"

namespace tools {

namespace {

/// A line that wraps could not be overwritten.
std::size_t terminal_width() {
  winsize size{};
  return ::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

}  // namespace

std::string RunProgress::bar_text(double share) {
  constexpr int kWidth = 20;
  const auto full = static_cast<std::size_t>(std::clamp(share, 0.0, 1.0) * kWidth);
  return "[" + std::string(full, '#') + std::string(kWidth - full, '-') + "]";
}

void RunProgress::log(std::string_view line) {
  if (!log_) return;
  clear();
  std::fprintf(stderr, "%.*s\n", static_cast<int>(line.size()), line.data());
}

void RunProgress::show(double elapsed_s, double total_s, const std::string& figures) {
  if (!bar_) return;
  std::string line = total_s > 0.0
                         ? bar_text(elapsed_s / total_s) + " " + fixed(elapsed_s, 0) + " of " + fixed(total_s, 0) + " s"
                         : fixed(elapsed_s, 0) + " s, Ctrl-C ends";
  draw(line + figures);
}

void RunProgress::show_share(double share, const std::string& what) {
  if (bar_) draw(bar_text(share) + " " + what);
}

void RunProgress::draw(std::string line) {
  line.resize(std::min(line.size(), terminal_width() - 1));
  std::fprintf(stderr, "\r\033[K%s", line.c_str());
  std::fflush(stderr);
  drawn_ = true;
}

void RunProgress::clear() {
  if (!drawn_) return;
  std::fprintf(stderr, "\r\033[K");
  std::fflush(stderr);
  drawn_ = false;
}

}  // namespace tools
