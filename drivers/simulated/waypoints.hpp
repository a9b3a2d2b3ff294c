#pragma once
/// @file waypoints.hpp
/// A motion given as a table of points in time, from a CSV file.
#include <string>
#include <vector>

#include <Eigen/Core>

#include "rtbus/realtime.hpp"
#include "rtbus/result.hpp"

namespace drivers::simulated {

/// One row of the table.
struct Waypoint {
  double time_s = 0.0;                                   ///< Since the script began.
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();  ///< In D.
};

/// How to get from one point to the next.
enum class Interpolation : unsigned char {
  kLinear,  ///< Straight, with a jump of velocity at each point.
  kSmooth,  ///< Cubic Hermite; the velocity at a point is the slope between its neighbours (Catmull & Rom 1974), zero
            ///< at both ends. With unequal spacing the curve may overshoot a little between points.
};

/// The whole table. Before the first point the motion rests there; after the last it rests there, or begins anew.
class WaypointPath {
 public:
  /// @pre at least two points, times finite and strictly increasing, first time >= 0.
  WaypointPath(std::vector<Waypoint> points, Interpolation interpolation, bool loop);

  [[nodiscard]] const std::vector<Waypoint>& points() const noexcept { return points_; }

  /// Where the motion is `time_s` after its beginning. @realtime Yes: one binary search.
  void at(double time_s, Eigen::Vector3d& position_m, Eigen::Vector3d& velocity_m_s) const noexcept RTBUS_NONBLOCKING;

 private:
  std::vector<Waypoint> points_;
  std::vector<Eigen::Vector3d> slopes_m_s_;  ///< Velocity at each point, kSmooth only.
  bool loop_;
};

/// Reads rows `t_s,x_m,y_m,z_m`. Lines that begin with '#' and empty lines are skipped; one header line with exactly
/// these names is allowed. The error is a sentence with file and line. At most 1e6 rows. @realtime No.
[[nodiscard]] rtbus::Result<std::vector<Waypoint>, std::string> read_waypoints(const std::string& file);

}  // namespace drivers::simulated
