#include "tools/cli/still/still.hpp"

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <optional>
#include <variant>

#include "tools/cli/common/formatted.hpp"
#include "tools/cli/common/gnuplot.hpp"
#include "tools/cli/common/run_program.hpp"
#include "tools/cli/still/still_scene.hpp"

namespace tools {

namespace {

namespace fs = std::filesystem;

std::string hex(const Rgb& c) {
  char text[16];
  std::snprintf(text, sizeof text, "'#%02x%02x%02x'", static_cast<int>(255 * c.r + 0.5),
                static_cast<int>(255 * c.g + 0.5), static_cast<int>(255 * c.b + 0.5));
  return text;
}

/// "50 mm", "2 m", "0.5 mm".
std::string length_text(double length_m) {
  return length_m < 1.0 ? formatted("%g mm", 1e3 * length_m) : formatted("%g m", length_m);
}

/// Commands that write over the picture. Positions in pixels from the lower left.
class Overlay {
 public:
  void label(double x, double y, const std::string& text, int size, const std::string& more = "") {
    body_ += "set label " + gnuplot_quoted(text) + " at " + at(x, y) + " font 'DejaVu Sans," + std::to_string(size) +
             "' front " + more + "\n";
  }
  void line(double x0, double y0, double x1, double y1, const std::string& style) {
    body_ += "set arrow from " + at(x0, y0) + " to " + at(x1, y1) + " " + style + " front\n";
  }
  void rectangle(double x0, double y0, double x1, double y1, const std::string& style) {
    body_ += "set object rectangle from " + at(x0, y0) + " to " + at(x1, y1) + " front " + style + "\n";
  }
  void circle(double x, double y, double radius, const std::string& style) {
    body_ += "set object circle at " + at(x, y) + " size first " + formatted("%.1f", radius) + " front " + style + "\n";
  }
  [[nodiscard]] const std::string& body() const noexcept { return body_; }

 private:
  static std::string at(double x, double y) { return formatted("%.1f", x) + "," + formatted("%.1f", y); }
  std::string body_;
};

constexpr const char* kPanel = "fc rgb '#28ffffff' fs solid noborder";
const std::string kDark = "tc rgb '#202020'";

/// A length on the ground in front of the scene, along the picture's lower edge.
void add_scale_bar(Overlay& over, const rtbus::config::Scene& scene, const StillLayout& layout, double y) {
  const double px_per_m = layout.camera.px_per_m(layout.camera.look_at_m);
  double length_m = round_up_nicely(170.0 / px_per_m);
  const double x1 = layout.camera.width_px - 40.0, x0 = x1 - length_m * px_per_m;
  over.line(x0, y, x1, y, "heads size first 8,90 lw 2.5 lc rgb '#202020'");
  over.label(0.5 * (x0 + x1), y + 24.0, length_text(length_m) + " at the middle", 14, "center " + kDark);
  const bool ground = std::any_of(scene.bodies.begin(), scene.bodies.end(), [](const auto& body) {
    return std::holds_alternative<rtbus::shapes::Plane>(body.shape);
  });
  if (!ground) return;
  over.label(x1, y - 28.0, "ground: squares of " + length_text(layout.grid_m), 14, "right " + kDark);
}

void add_legend(Overlay& over, const StillFrame& frame, const StillLayout& layout, double y) {
  double x = 40.0;
  if (!frame.hands.empty()) {
    over.circle(x + 12.0, y, 11.0, "fc rgb " + hex(kProxyColour) + " fs solid noborder");
    over.label(x + 34.0, y, "proxy: where the world lets the tool be", 14, kDark);
    over.circle(x + 12.0, y - 32.0, 11.0, "fc rgb '#202020' fs empty border lc rgb '#202020' lw 2 dt 2");
    over.label(x + 34.0, y - 32.0, "device: where the hand is", 14, kDark);
    x += 450.0;
    over.line(x, y, x + 56.0, y, "head filled size first 16,20 lw 5 lc rgb " + hex(kForceColour));
    over.label(x + 70.0, y, "force on the hand, " + formatted("%g", layout.n_per_cm) + " N per cm of the scene", 14,
               kDark);
  }
  if (layout.moved_max_m > 0.0) {
    const double bar_y = y - 32.0;
    for (int i = 0; i < 28; ++i) {
      over.rectangle(x + 2.0 * i, bar_y - 8.0, x + 2.0 * (i + 1), bar_y + 8.0,
                     "fc rgb " + hex(moved_colour(i / 27.0)) + " fs solid noborder");
    }
    over.label(x + 70.0, bar_y, "moved since the start, 0 to " + length_text(layout.moved_max_m) + " and more", 14,
               kDark);
  }
}

Figure overlay(const rtbus::config::Scene& scene, const StillFrame& frame, const StillLayout& layout) {
  const Camera& camera = layout.camera;
  const double width = camera.width_px, height = camera.height_px;
  Overlay over;
  over.rectangle(0, height - 92.0, width, height, kPanel);
  over.rectangle(0, 0, width, 92.0, kPanel);
  over.label(40.0, height - 34.0, scene.name + ", " + frame.moment, 22, kDark);
  const auto moving = std::count_if(scene.bodies.begin(), scene.bodies.end(),
                                    [](const auto& body) { return body.type != rtbus::config::BodyType::kStatic; });
  std::string second = moving > 0 ? std::to_string(moving) + (moving == 1 ? " body" : " bodies") + " free to move"
                                  : std::to_string(scene.bodies.size()) + " fixed bodies";
  if (moving == 0 && scene.bodies.size() == 1) second = "1 fixed body";
  if (!scene.soft_bodies.empty()) {
    const std::string soft = std::to_string(scene.soft_bodies.size()) + " soft bodies, " +
                             std::to_string(frame.soft_nodes_m.size()) + " nodes";
    second = moving > 0 ? second + ", " + soft : soft;
  }
  for (const StillHand& hand : frame.hands) {
    second += ";  " + hand.name + ": " + formatted("%.2f N on the hand", hand.force_n.norm()) + ", proxy " +
              formatted("%.1f mm from the device", 1e3 * (hand.proxy_m - hand.target_m).norm());
  }
  over.label(40.0, height - 70.0, second, 16, "tc rgb '#404040'");
  for (const StillHand& hand : frame.hands) {
    const Eigen::Vector2d target = camera.project(hand.target_m), proxy = camera.project(hand.proxy_m);
    const double radius = drawn_radius_m(hand, layout) * camera.px_per_m(hand.target_m);
    over.circle(proxy.x(), proxy.y(), drawn_radius_m(hand, layout) * camera.px_per_m(hand.proxy_m),
                "fs empty border lc rgb " + hex(kProxyColour) + " lw 1.5");
    // A light ring below a dark, dashed one can be seen on any ground, and through what stands before it.
    over.circle(target.x(), target.y(), radius, "fs empty border lc rgb '#60ffffff' lw 5");
    over.circle(target.x(), target.y(), radius, "fs empty border lc rgb '#202020' lw 2 dt 2");
    if ((target - proxy).norm() > 2.5 * radius) {
      over.line(proxy.x(), proxy.y(), target.x(), target.y(), "nohead lw 1.5 dt 3 lc rgb '#202020'");
    }
    const Eigen::Vector2d tip = camera.project(arrow_tip(hand, layout));
    if (hand.force_n.norm() > 0.05) {
      const double side = tip.x() < proxy.x() ? -1.0 : 1.0;
      over.label(tip.x() + 14.0 * side, tip.y(), formatted("%.2f N", hand.force_n.norm()), 17,
                 (side < 0.0 ? "right tc rgb " : "left tc rgb ") + hex(kForceColour));
    }
  }
  add_legend(over, frame, layout, 62.0);
  add_scale_bar(over, scene, layout, 44.0);
  Figure figure{frame.stem, "", camera.width_px, camera.height_px, false};
  figure.body = "set margins 0,0,0,0\nunset border\nunset tics\nunset key\nset xrange [0:" + formatted("%g", width) +
                "]\nset yrange [0:" + formatted("%g", height) + "]\n" + over.body() + "plot " +
                gnuplot_quoted(frame.stem + "_bodies.png") + " binary filetype=png with rgbimage\n";
  return figure;
}

}  // namespace

StillsOutcome draw_stills(const fs::path& folder, const rtbus::config::Scene& scene, std::span<const StillFrame> frames,
                          const StillOptions& options) {
  StillsOutcome outcome;
  if (frames.empty()) return outcome;
  std::error_code error;
  fs::create_directories(folder, error);
  const std::optional<Gnuplot> gnuplot = Gnuplot::find();
  if (!gnuplot) {
    outcome.problem = "no stills: gnuplot is not installed (apt install gnuplot-nox)";
    return outcome;
  }
  const StillLayout layout = lay_out(scene, frames, options.view, options.width_px, options.height_px);
  for (const StillFrame& frame : frames) {
    std::ofstream out(folder / (frame.stem + ".pov"));
    out << pov_text(scene, frame, layout);
    out.close();
    if (!out) {
      outcome.problem = "cannot write " + (folder / (frame.stem + ".pov")).string();
      return outcome;
    }
    const ProgramOutcome rendered = run_program(
        "povray", folder,
        {"+I" + frame.stem + ".pov", "+O" + frame.stem + "_bodies.png", "+FN8", "+W" + std::to_string(options.width_px),
         "+H" + std::to_string(options.height_px), "+A0.3", "+R2", "-D", "-GA", "+GF"});
    if (rendered.status != 0) {
      outcome.problem =
          rendered.status < 0 || rendered.status == 127
              ? "no stills: povray is not installed (apt install povray); their scenes are in " + folder.string()
              : (folder / frame.stem).string() + ".pov: " + rendered.complaint();
      return outcome;
    }
    if (auto drawn = gnuplot->draw(folder, overlay(scene, frame, layout))) {
      outcome.files.push_back(drawn->front().string());
    } else {
      outcome.problem = drawn.error();
      return outcome;
    }
  }
  return outcome;
}

}  // namespace tools
