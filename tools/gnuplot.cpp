#include "tools/gnuplot.hpp"

#include <fcntl.h>
#include <spawn.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <utility>

namespace tools {

namespace {

namespace fs = std::filesystem;

struct Outcome {
  int status = -1;     ///< Exit status; −1 when it did not run or was killed.
  std::string output;  ///< stdout and stderr.
};

/// Runs gnuplot in `folder` and waits for it.
Outcome run_gnuplot(const fs::path& folder, std::vector<std::string> arguments) {
  Outcome outcome;
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) return outcome;
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addchdir_np(&actions, folder.c_str());
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);
  arguments.insert(arguments.begin(), "gnuplot");
  std::vector<char*> argv;
  for (std::string& each : arguments) argv.push_back(each.data());
  argv.push_back(nullptr);
  pid_t pid = 0;
  const int error = ::posix_spawnp(&pid, "gnuplot", &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  ::close(ends[1]);
  if (error == 0) {
    char buffer[1024];
    for (ssize_t got = 0; (got = ::read(ends[0], buffer, sizeof buffer)) > 0 || (got < 0 && errno == EINTR);) {
      if (got > 0) outcome.output.append(buffer, static_cast<std::size_t>(got));
    }
    int status = 0;
    while (::waitpid(pid, &status, 0) < 0 && errno == EINTR) {
    }
    if (WIFEXITED(status)) outcome.status = WEXITSTATUS(status);
  } else {
    outcome.output = ::strerror(error);
  }
  ::close(ends[0]);
  return outcome;
}

/// What gnuplot said, in one line: without position marks and blank lines.
std::string complaint(const std::string& output) {
  std::string text;
  for (std::size_t begin = 0; begin < output.size();) {
    const std::size_t end = std::min(output.find('\n', begin), output.size());
    const std::size_t first = output.find_first_not_of(" \t^", begin);
    if (first != std::string::npos && first < end) {
      text += (text.empty() ? "" : "; ") + output.substr(first, end - first);
    }
    begin = end + 1;
  }
  constexpr std::size_t kLongest = 300;
  if (text.size() > kLongest) text = text.substr(0, kLongest) + " …";
  return text.empty() ? "gnuplot failed without a word" : text;
}

}  // namespace

std::string gnuplot_quoted(std::string_view text) {
  std::string quoted = "'";
  for (const char c : text) {
    if (c == '\'') quoted += '\'';
    quoted += c == '\n' ? ' ' : c;
  }
  return quoted + "'";
}

std::optional<Gnuplot> Gnuplot::find() {
  // Cairo draws smoother lines; some builds have only libgd.
  for (const char* terminal : {"pngcairo", "png"}) {
    const Outcome outcome = run_gnuplot("/", {"-e", std::string("set terminal ") + terminal});
    if (outcome.status == 0) return Gnuplot(terminal);
  }
  return std::nullopt;
}

std::string Gnuplot::script(const Figure& figure) const {
  const std::string size = std::to_string(figure.width_px) + "," + std::to_string(figure.height_px);
  const std::string file = figure.stem + ".gp";
  const std::string look = " noenhanced font 'DejaVu Sans,11' background rgb 'white'";
  // libgd's terminal knows neither the background word nor a family by this name.
  const std::string png_look = png_terminal_ == "pngcairo" ? look : " noenhanced";
  std::string text = "# Draws " + figure.stem + ".png and .svg: gnuplot " + file + "\n";
  text += "if (!exists('second')) {\n  set terminal " + png_terminal_ + " size " + size + png_look +
          "\n  set output '" + figure.stem + ".png'\n} else {\n  set terminal svg size " + size + look +
          "\n  set output '" + figure.stem + ".svg'\n}\n";
  text += "reset\n" + figure.body;
  if (!text.ends_with('\n')) text += '\n';
  text +=
      "set output\n# Once more, for the other format.\nif (!exists('second')) { second = 1; load '" + file + "' }\n";
  return text;
}

rtbus::Result<std::vector<fs::path>, std::string> Gnuplot::draw(const fs::path& folder, const Figure& figure) const {
  const fs::path file = folder / (figure.stem + ".gp");
  std::ofstream out(file);
  out << script(figure);
  out.close();
  if (!out) return rtbus::Failure{"cannot write " + file.string()};
  const Outcome outcome = run_gnuplot(folder, {file.filename().string()});
  if (outcome.status != 0) return rtbus::Failure{file.string() + ": " + complaint(outcome.output)};
  return std::vector<fs::path>{folder / (figure.stem + ".png"), folder / (figure.stem + ".svg")};
}

}  // namespace tools
