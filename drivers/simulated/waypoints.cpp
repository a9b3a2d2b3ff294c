#include "drivers/simulated/waypoints.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <string_view>
#include <utility>

namespace drivers::simulated {
namespace {

constexpr std::size_t kMaxRows = 1'000'000;
constexpr std::string_view kHeader = "t_s,x_m,y_m,z_m";

std::string_view trimmed(std::string_view text) {
  const auto is_space = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
  return text;
}

// Four finite numbers separated by commas, independent of the locale.
bool parse_row(std::string_view row, std::array<double, 4>& out) {
  for (std::size_t i = 0; i < out.size(); ++i) {
    const std::size_t comma = row.find(',');
    if ((comma == std::string_view::npos) != (i + 1 == out.size())) return false;
    const std::string_view cell = trimmed(row.substr(0, comma));
    const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), out[i]);
    if (error != std::errc{} || end != cell.data() + cell.size() || !std::isfinite(out[i])) return false;
    if (comma != std::string_view::npos) row.remove_prefix(comma + 1);
  }
  return true;
}

}  // namespace

WaypointPath::WaypointPath(std::vector<Waypoint> points, Interpolation interpolation, bool loop)
    : points_(std::move(points)), loop_(loop) {
  if (interpolation != Interpolation::kSmooth) return;
  slopes_m_s_.assign(points_.size(), Eigen::Vector3d::Zero());
  for (std::size_t i = 1; i + 1 < points_.size(); ++i) {
    slopes_m_s_[i] =
        (points_[i + 1].position_m - points_[i - 1].position_m) / (points_[i + 1].time_s - points_[i - 1].time_s);
  }
}

void WaypointPath::at(double time_s, Eigen::Vector3d& position_m,
                      Eigen::Vector3d& velocity_m_s) const noexcept RTBUS_NONBLOCKING {
  const double first_s = points_.front().time_s;
  const double last_s = points_.back().time_s;
  if (loop_ && time_s > first_s) time_s = first_s + std::fmod(time_s - first_s, last_s - first_s);

  velocity_m_s.setZero();
  if (time_s <= first_s) {
    position_m = points_.front().position_m;
    return;
  }
  if (time_s >= last_s) {
    position_m = points_.back().position_m;
    return;
  }
  const auto after = std::upper_bound(points_.begin(), points_.end(), time_s,
                                      [](double t, const Waypoint& point) { return t < point.time_s; });
  const auto next = static_cast<std::size_t>(after - points_.begin());
  const Waypoint& a = points_[next - 1];
  const Waypoint& b = points_[next];
  const double span_s = b.time_s - a.time_s;
  const double u = (time_s - a.time_s) / span_s;

  if (slopes_m_s_.empty()) {
    velocity_m_s = (b.position_m - a.position_m) / span_s;
    position_m = a.position_m + u * (b.position_m - a.position_m);
    return;
  }
  // Hermite basis and its derivative.
  const double u2 = u * u;
  const double u3 = u2 * u;
  const Eigen::Vector3d& slope_a = slopes_m_s_[next - 1];
  const Eigen::Vector3d& slope_b = slopes_m_s_[next];
  position_m = (2 * u3 - 3 * u2 + 1) * a.position_m + (3 * u2 - 2 * u3) * b.position_m +
               span_s * ((u3 - 2 * u2 + u) * slope_a + (u3 - u2) * slope_b);
  velocity_m_s = (6 * u2 - 6 * u) / span_s * (a.position_m - b.position_m) + (3 * u2 - 4 * u + 1) * slope_a +
                 (3 * u2 - 2 * u) * slope_b;
}

rtbus::Result<std::vector<Waypoint>, std::string> read_waypoints(const std::string& file) {
  std::ifstream in(file);
  if (!in) return rtbus::Failure{file + " cannot be read; check its name and permissions"};
  std::vector<Waypoint> points;
  bool header_allowed = true;
  std::string line;
  for (std::size_t number = 1; std::getline(in, line); ++number) {
    const std::string where = file + ":" + std::to_string(number) + ": ";
    const std::string_view row = trimmed(line);
    if (row.empty() || row.front() == '#') continue;
    if (std::exchange(header_allowed, false) && row == kHeader) continue;
    std::array<double, 4> cells{};
    if (!parse_row(row, cells)) {
      return rtbus::Failure{where + "expected four finite numbers t_s,x_m,y_m,z_m, found '" + line + "'"};
    }
    if (cells[0] < 0.0) return rtbus::Failure{where + "t_s is negative; the script begins at 0"};
    if (!points.empty() && cells[0] <= points.back().time_s) {
      return rtbus::Failure{where + "t_s does not grow; give the points in order of time"};
    }
    if (points.size() == kMaxRows) return rtbus::Failure{where + "more than 1000000 points; thin the table"};
    points.push_back({cells[0], {cells[1], cells[2], cells[3]}});
  }
  if (points.size() < 2) return rtbus::Failure{file + " has fewer than two points; a motion needs two"};
  return points;
}

}  // namespace drivers::simulated
