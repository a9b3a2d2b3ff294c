// The motion of a waypoint table, and what its reader refuses.
#include "drivers/simulated/waypoints.hpp"

#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace drivers::simulated {
namespace {

using Eigen::Vector3d;
using ::testing::HasSubstr;

class TemporaryCsv {
 public:
  explicit TemporaryCsv(const std::string& text)
      : path_(std::filesystem::temp_directory_path() / ("waypoints_" + std::to_string(::getpid()) + ".csv")) {
    std::ofstream(path_) << text;
  }
  ~TemporaryCsv() { std::filesystem::remove(path_); }
  [[nodiscard]] std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

std::string refusal(const std::string& text) {
  const TemporaryCsv file(text);
  const auto points = read_waypoints(file.path());
  return points ? "accepted" : points.error();
}

const std::vector<Waypoint> kTriangle{{0.5, {0, 0, 0}}, {1.0, {0.01, 0, 0}}, {2.0, {0.01, 0.02, 0}}, {2.5, {0, 0, 0}}};

Vector3d position(const WaypointPath& path, double time_s) {
  Vector3d p;
  Vector3d v;
  path.at(time_s, p, v);
  return p;
}

TEST(WaypointPath, LinearGoesStraightFromPointToPoint) {
  const WaypointPath path(kTriangle, Interpolation::kLinear, false);
  EXPECT_EQ(position(path, 0.0), Vector3d(0, 0, 0));
  EXPECT_LT((position(path, 0.75) - Vector3d(0.005, 0, 0)).norm(), 1e-15);
  EXPECT_LT((position(path, 1.5) - Vector3d(0.01, 0.01, 0)).norm(), 1e-15);
  EXPECT_EQ(position(path, 99.0), Vector3d(0, 0, 0));
  Vector3d p;
  Vector3d v;
  path.at(1.5, p, v);
  EXPECT_LT((v - Vector3d(0, 0.02, 0)).norm(), 1e-15);
}

TEST(WaypointPath, SmoothMeetsEveryPointWithoutAJumpOfVelocity) {
  const WaypointPath path(kTriangle, Interpolation::kSmooth, false);
  for (const Waypoint& point : kTriangle) {
    EXPECT_LT((position(path, point.time_s) - point.position_m).norm(), 1e-12);
    Vector3d p;
    Vector3d before;
    Vector3d after;
    path.at(point.time_s - 1e-9, p, before);
    path.at(point.time_s + 1e-9, p, after);
    EXPECT_LT((before - after).norm(), 1e-6);
  }
  for (double t = 0.01; t < 2.6; t += 0.0137) {
    Vector3d p;
    Vector3d v;
    path.at(t, p, v);
    ASSERT_LT(((position(path, t + 1e-6) - position(path, t - 1e-6)) / 2e-6 - v).norm(), 1e-6) << t;
  }
}

TEST(WaypointPath, LoopRepeatsFromItsFirstPoint) {
  const WaypointPath path(kTriangle, Interpolation::kLinear, true);
  EXPECT_LT((position(path, 0.75 + 2.0) - position(path, 0.75)).norm(), 1e-12);
  EXPECT_LT((position(path, 1.5 + 20.0) - position(path, 1.5)).norm(), 1e-12);
  EXPECT_EQ(position(path, 0.1), Vector3d(0, 0, 0));
}

TEST(ReadWaypoints, ReadsRowsHeaderAndComments) {
  const TemporaryCsv file("# a motion\nt_s,x_m,y_m,z_m\n0, 0.1,-2e-2, 0\r\n\n1.5,1,2,3\n");
  const auto points = read_waypoints(file.path());
  ASSERT_TRUE(points) << points.error();
  ASSERT_EQ(points->size(), 2u);
  EXPECT_EQ((*points)[0].position_m, Vector3d(0.1, -0.02, 0));
  EXPECT_EQ((*points)[1].time_s, 1.5);
}

TEST(ReadWaypoints, NamesTheLineItCannotUse) {
  EXPECT_THAT(refusal("0,0,0,0\n1,0,0\n"), HasSubstr(".csv:2: expected four finite numbers"));
  EXPECT_THAT(refusal("0,0,0,0\n1,0,0,0,0\n"), HasSubstr(".csv:2: expected four finite numbers"));
  EXPECT_THAT(refusal("0,0,0,0\n1,0,nan,0\n"), HasSubstr(".csv:2: expected four finite numbers"));
  EXPECT_THAT(refusal("t,x,y,z\n"), HasSubstr(".csv:1: expected four finite numbers"));
  EXPECT_THAT(refusal("0,0,0,0\n0,0,0,0\n"), HasSubstr(".csv:2: t_s does not grow"));
  EXPECT_THAT(refusal("-1,0,0,0\n"), HasSubstr(".csv:1: t_s is negative"));
  EXPECT_THAT(refusal("0,0,0,0\n"), HasSubstr("fewer than two points"));
  const auto missing = read_waypoints("/nonexistent/motion.csv");
  ASSERT_FALSE(missing);
  EXPECT_THAT(missing.error(), HasSubstr("cannot be read"));
}

}  // namespace
}  // namespace drivers::simulated
