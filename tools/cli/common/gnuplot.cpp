#include "tools/cli/common/gnuplot.hpp"

#include <fstream>
#include <utility>

#include "tools/cli/common/run_program.hpp"

namespace tools {

namespace fs = std::filesystem;

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
    const ProgramOutcome outcome = run_program("gnuplot", "/", {"-e", std::string("set terminal ") + terminal});
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
  std::string text = "# Draws " + figure.stem + (figure.svg ? ".png and .svg" : ".png") + ": gnuplot " + file + "\n";
  text += "if (!exists('second')) {\n  set terminal " + png_terminal_ + " size " + size + png_look +
          "\n  set output '" + figure.stem + ".png'\n} else {\n  set terminal svg size " + size + look +
          "\n  set output '" + figure.stem + ".svg'\n}\n";
  text += "reset\n" + figure.body;
  if (!text.ends_with('\n')) text += '\n';
  if (!figure.svg) return text + "set output\n";
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
  const ProgramOutcome outcome = run_program("gnuplot", folder, {file.filename().string()});
  if (outcome.status != 0) return rtbus::Failure{file.string() + ": " + outcome.complaint()};
  if (!figure.svg) return std::vector<fs::path>{folder / (figure.stem + ".png")};
  return std::vector<fs::path>{folder / (figure.stem + ".png"), folder / (figure.stem + ".svg")};
}

}  // namespace tools
