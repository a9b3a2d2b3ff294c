// What is in the picture, from how far it is seen, and the scales of arrows, colours and grid.
#include <algorithm>
#include <cmath>
#include <variant>

#include "tools/cli/still/still_scene.hpp"

namespace tools {

namespace {

using rtbus::config::Body;

/// Half lengths of a shape's bounding box about the body's origin; zero for a plane.
Eigen::Vector3d half_extent_m(const rtbus::config::BodyShape& shape) {
  struct Visitor {
    Eigen::Vector3d operator()(const rtbus::shapes::Plane&) const { return Eigen::Vector3d::Zero(); }
    Eigen::Vector3d operator()(const rtbus::shapes::Sphere& s) const { return Eigen::Vector3d::Constant(s.radius_m); }
    Eigen::Vector3d operator()(const rtbus::shapes::Box& box) const { return box.half_size_m; }
    Eigen::Vector3d operator()(const rtbus::config::Capsule& c) const {
      return {c.radius_m, 0.5 * c.length_m, c.radius_m};
    }
    Eigen::Vector3d operator()(const rtbus::config::Cylinder& c) const {
      return {c.radius_m, 0.5 * c.length_m, c.radius_m};
    }
    Eigen::Vector3d operator()(const rtbus::config::ConvexHull& hull) const { return of(*hull.points); }
    Eigen::Vector3d operator()(const rtbus::config::Mesh& mesh) const { return of(*mesh.surface); }
    static Eigen::Vector3d of(const rtbus::config::TriangleMesh& mesh) {
      Eigen::Vector3d most = Eigen::Vector3d::Zero();
      for (const Eigen::Vector3d& v : mesh.vertices_m) most = most.cwiseMax(v.cwiseAbs());
      return most;
    }
  };
  return std::visit(Visitor{}, shape);
}

void add_corners(std::vector<Eigen::Vector3d>& points, const Body& body, const physics::BodyPose& pose) {
  const Eigen::Vector3d half_m = half_extent_m(body.shape);
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d sign((corner & 1) ? 1.0 : -1.0, (corner & 2) ? 1.0 : -1.0, (corner & 4) ? 1.0 : -1.0);
    points.push_back(pose.position_m + pose.orientation * sign.cwiseProduct(half_m));
  }
}

/// Centre and radius of the box around `points`.
std::pair<Eigen::Vector3d, double> ball_around(const std::vector<Eigen::Vector3d>& points) {
  if (points.empty()) return {Eigen::Vector3d::Zero(), 0.0};
  Eigen::Vector3d low = points.front(), high = points.front();
  for (const Eigen::Vector3d& p : points) low = low.cwiseMin(p), high = high.cwiseMax(p);
  return {0.5 * (low + high), 0.5 * (high - low).norm()};
}

constexpr double kLeastRadius_m = 0.03;  // a scene of planes alone
constexpr double kStray = 1.6;           // bodies farther out than so many radii do not shrink the rest of the picture

}  // namespace

double round_up_nicely(double value) {
  const double decade = std::pow(10.0, std::floor(std::log10(value)));
  for (const double step : {1.0, 2.0, 5.0}) {
    if (step * decade >= value * (1.0 - 1e-9)) return step * decade;
  }
  return 10.0 * decade;
}

StillLayout lay_out(const rtbus::config::Scene& scene, std::span<const StillFrame> frames, const StillView& view,
                    int width_px, int height_px) {
  StillLayout layout;
  std::vector<Eigen::Vector3d> points;
  const StillFrame start = frame_of(scene);
  const bool any_moves = !scene.soft_bodies.empty() ||
                         std::any_of(scene.bodies.begin(), scene.bodies.end(),
                                     [](const Body& body) { return body.type != rtbus::config::BodyType::kStatic; });
  points.insert(points.end(), start.soft_nodes_m.begin(), start.soft_nodes_m.end());
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const Body& body = scene.bodies[i];
    if (std::holds_alternative<rtbus::shapes::Plane>(body.shape)) continue;
    if (any_moves && body.type == rtbus::config::BodyType::kStatic && half_extent_m(body.shape).norm() > 0.5) continue;
    add_corners(points, body, start.poses[i]);
  }
  const auto [middle, start_radius_m] = ball_around(points);
  double force_n = 0.0;
  std::vector<double> moved_m;
  for (const StillFrame& frame : frames) {
    for (std::size_t i = 0; i < frame.poses.size() && i < scene.bodies.size(); ++i) {
      if (scene.bodies[i].type == rtbus::config::BodyType::kStatic) continue;
      moved_m.push_back((frame.poses[i].position_m - scene.bodies[i].p_WB).norm());
      if ((frame.poses[i].position_m - middle).norm() > kStray * start_radius_m) continue;
      add_corners(points, scene.bodies[i], frame.poses[i]);
    }
    for (std::size_t i = 0; i < frame.soft_nodes_m.size() && i < start.soft_nodes_m.size(); ++i) {
      moved_m.push_back((frame.soft_nodes_m[i] - start.soft_nodes_m[i]).norm());
      if ((frame.soft_nodes_m[i] - middle).norm() <= kStray * start_radius_m) points.push_back(frame.soft_nodes_m[i]);
    }
    for (const StillHand& hand : frame.hands) {
      points.push_back(hand.proxy_m);
      points.push_back(hand.target_m);
      force_n = std::max(force_n, hand.force_n.norm());
    }
  }
  auto [centre, radius_m] = ball_around(points);
  if (radius_m < kLeastRadius_m && start_radius_m == 0.0) {
    for (const double sign : {-1.0, 1.0}) {
      points.push_back(centre + sign * kLeastRadius_m * Eigen::Vector3d(1.0, 0.3, 1.0));
      points.push_back(centre + sign * kLeastRadius_m * Eigen::Vector3d(1.0, 0.3, -1.0));
    }
    radius_m = kLeastRadius_m;
  }
  layout.radius_m = radius_m;
  // The longest arrow is between a quarter and five eighths of what the picture shows.
  if (force_n > 0.1) layout.n_per_cm = round_up_nicely(force_n / (62.0 * radius_m));
  layout.grid_m = round_up_nicely(radius_m / 12.0);
  std::sort(moved_m.begin(), moved_m.end());
  const double far_m = moved_m.empty() ? 0.0 : moved_m[moved_m.size() * 9 / 10];
  if (far_m > 0.002 * radius_m) layout.moved_max_m = round_up_nicely(far_m);
  for (const StillFrame& frame : frames) {
    for (const StillHand& hand : frame.hands) {
      points.push_back(arrow_tip(hand, layout));
      const double r = drawn_radius_m(hand, layout);
      points.push_back(hand.target_m + Eigen::Vector3d::Constant(r));
      points.push_back(hand.target_m - Eigen::Vector3d::Constant(r));
    }
  }
  layout.camera = fit_camera(points, view, width_px, height_px);
  return layout;
}

Eigen::Vector3d arrow_tip(const StillHand& hand, const StillLayout& layout) {
  return hand.proxy_m + hand.force_n / (100.0 * layout.n_per_cm);
}

double drawn_radius_m(const StillHand& hand, const StillLayout& layout) {
  return std::max(hand.radius_m, 0.018 * layout.radius_m);
}

}  // namespace tools
