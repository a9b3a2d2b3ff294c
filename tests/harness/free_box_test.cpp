/// Free boxes that turn, tip and leave a table, and what rolls, under a hand (simulated clock): against closed forms,
/// and the same method at 10 kHz on both sides.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <numbers>
#include <numeric>
#include <string>
#include <vector>

#include "tests/harness/push.hpp"

#if RTBUS_WITH_BULLET
namespace free_box {
namespace {

using tests::apart_n;
using tests::kConverged;
using tests::kPhysics_hz;
using tests::physics_at;
using tests::push;
using tests::Push;
using tests::Pushed;

constexpr double kGravity_m_s2 = 9.81;
const std::string kFloor = "{name: floor, type: static, shape: {plane: {}}, friction: 0.5}";
const std::string kBox =
    ", {name: box, type: dynamic, mass_kg: 0.2, shape: {box: {size_m: [0.04, 0.04, 0.04]}}, position_m: [0, 0.02, 0], "
    "friction: 0.5}";

/// Four triangles around the middle, as high as kFloor but for the skin that the engine gives a mesh.
std::string mesh_floor() {
  const std::string file = testing::TempDir() + "flat_" + std::to_string(getpid()) + ".obj";
  std::ofstream(file) << "v -0.2 0 -0.2\nv 0.2 0 -0.2\nv 0.2 0 0.2\nv -0.2 0 0.2\nv 0 0 0\n"
                         "f 1 5 2\nf 2 5 3\nf 3 5 4\nf 4 5 1\n";
  return "{name: floor, type: static, shape: {mesh: {file: " + file +
         ", metres_per_unit: 1}}, position_m: [0, -0.13e-3, 0], friction: 0.5}";
}

// F·h = m·g·d/2 about the edge, without friction of the tip, which would pull at the face that rises. The hand is slow:
// its speed times √(K·m) comes on top.
/// @param most Of the force, over the closed form.
void expect_tips_at(double tips_n, double most, const Push& how) {
  constexpr int kMean_ms = 300;
  for (const char* const hz : kPhysics_hz) {
    std::vector<std::string> settings = physics_at(hz);
    settings.emplace_back("haptic.0.device.mechanics.position_quantum_m=0");
    const Pushed felt = push(how, settings);
    ASSERT_GT(felt.tips_s, 1.0) << hz;
    const auto begin = felt.force_n.begin() + static_cast<std::ptrdiff_t>(1000.0 * felt.tips_s);
    const double mean_n = std::accumulate(begin, begin + kMean_ms, 0.0) / kMean_ms;
    const double largest_n = *std::max_element(felt.force_n.begin(), felt.force_n.end());
    std::printf("physics %s Hz: tips under %.4f N, at most %.4f N; closed form %.4f N\n", hz, mean_n, largest_n,
                tips_n);
    EXPECT_NEAR(mean_n, tips_n, 0.02 * tips_n) << hz;
    EXPECT_LE(largest_n, most * tips_n) << hz;
    EXPECT_GT(felt.last.orientation.angularDistance(Eigen::Quaterniond::Identity()), 0.02) << "it tips, physics " << hz;
  }
}

// As a patch that cannot tilt the box resisted with all its friction.
TEST(FreeBox, TipsAtTheForceThatLiftsItOverItsEdge) {
  constexpr double kMass_kg = 0.2, kDepth_m = 0.03, kHeight_m = 0.07;
  expect_tips_at(kMass_kg * kGravity_m_s2 * (kDepth_m / 2.0) / kHeight_m, 1.05,
                 {kFloor + ", {name: box, type: dynamic, mass_kg: 0.2, shape: {box: {size_m: [0.04, 0.08, 0.03]}}, "
                           "position_m: [0, 0.04, -0.015], friction: 1.5}",
                  "[0, 0.07, 0.0055]", 0.004, 0.0005, 9.5, 0.0});
}

// A light one could not tilt in the loop, and could in physics: at 18 Hz it clicked by 0.3 N along the push, and fell
// onto its other side.
TEST(FreeBox, ALightOneTipsAsInTruth) {
  const Push how{kFloor +
                     ", {name: box, type: dynamic, mass_kg: 0.01, shape: {box: {size_m: [0.04, 0.08, 0.03]}}, "
                     "position_m: [0, 0.04, -0.015], friction: 1.5}",
                 "[0, 0.07, 0.012]", 0.06, 0.03, 4.0};
  const Pushed truth = push(how, kConverged);
  EXPECT_GT(*std::max_element(truth.force_n.begin(), truth.force_n.end()), 0.05);
  for (const char* const hz : kPhysics_hz) {
    const Pushed felt = push(how, physics_at(hz));
    double square = 0.0, jump_n = 0.0;
    for (std::size_t i = 1; i < felt.force_n.size(); ++i) {
      square += std::pow(felt.force_n[i] - truth.force_n[i], 2);
      jump_n = std::max(jump_n, std::abs(felt.force_n[i] - felt.force_n[i - 1]));
    }
    const double rms_n = std::sqrt(square / static_cast<double>(felt.force_n.size()));
    const double off_deg = 180.0 / std::numbers::pi * felt.last.orientation.angularDistance(truth.last.orientation);
    std::printf("physics %s Hz: %.4f N RMS off, at most %.4f N in 1 ms, %.2f deg off\n", hz, rms_n, jump_n, off_deg);
    EXPECT_LE(rms_n, 0.02) << hz;
    EXPECT_LE(jump_n, 0.1) << hz;
    EXPECT_LE(off_deg, 1.0) << hz;
  }
}

// A hand that has tipped a box up holds it there on its edge. Steps had a part of a sample of the hand too little, and
// re-simulations went in parts of 8 ms: with physics at 5 Hz the box fell over from four of five starts.
TEST(FreeBox, IsHeldOnItsEdgeWherePhysicsIsSlow) {
  constexpr int kStarts = 5, kLast_ms = 500;
  const auto held_n = [](int start, const char* hz) {
    const Push how{
        "{name: floor, type: static, shape: {plane: {}}, friction: 0.7}, {name: box, type: dynamic, mass_kg: "
        "0.58, shape: {box: {size_m: [0.04, 0.08, 0.02]}}, position_m: [0, 0.04, -0.015], friction: 0.7}",
        "[0, 0.07, " + std::to_string(0.0124 + 1e-5 * start) + "]",
        0.0223,
        0.0223,
        6.0,
        0.7};
    std::vector<std::string> settings = physics_at(hz);
    settings.emplace_back("haptic.0.coupling={stiffness_n_per_m: 99, damping_n_s_per_m: 0.04}");
    const Pushed felt = push(how, settings);
    return std::accumulate(felt.force_n.end() - kLast_ms, felt.force_n.end(), 0.0) / kLast_ms;
  };
  const double truth_n = held_n(0, "1000");
  EXPECT_GT(truth_n, 0.5);
  int held = 0;
  for (int start = 0; start < kStarts; ++start) {
    const double mean_n = held_n(start, "5.2");
    std::printf("%.4f N, with physics at 1 kHz %.4f N\n", mean_n, truth_n);
    held += std::abs(mean_n - truth_n) <= 0.1 * truth_n ? 1 : 0;
  }
  EXPECT_GT(2 * held, kStarts);
}

// Bullet rounds rims by a tenth of the radius: it tipped over as if it were thinner, and not where the loop had its
// rim. With the lowest point of the rim as at the beginning of a re-simulation it fell back at 18 Hz, under 0.97 N.
TEST(FreeCylinder, TipsAtTheForceThatLiftsItOverItsRim) {
  constexpr double kMass_kg = 0.2, kRadius_m = 0.02, kHeight_m = 0.05;
  for (const std::string& floor : {kFloor, mesh_floor()}) {
    expect_tips_at(kMass_kg * kGravity_m_s2 * kRadius_m / kHeight_m, 1.2,
                   {floor + ", {name: can, type: dynamic, mass_kg: 0.2, shape: {cylinder: {radius_m: 0.02, length_m: "
                            "0.06}}, position_m: [0, 0.03, -0.02], friction: 1.5}",
                    "[0, 0.05, 0.0055]", 0.006, 0.0005, 12.5, 0.0});
  }
}

// On the points that physics tells it rocked: at 18 Hz 0.1 to 0.24 N RMS off, with clicks of 0.2 N.
TEST(FreeCylinder, StandingIsPushedAsInTruth) {
  struct Place {
    const char *what, *start_m;
    double tip_friction;
  };
  for (const Place& each :
       {Place{"at its side", "[0, 0.015, 0.0055]", 0.5}, Place{"beside its middle", "[0.01, 0.015, 0.0055]", 0.5},
        Place{"along its top", "[0, 0.032, 0]", 1.0}}) {
    const Push how{kFloor +
                       ", {name: can, type: dynamic, mass_kg: 0.2, shape: {cylinder: {radius_m: 0.02, length_m: "
                       "0.03}}, position_m: [0, 0.015, -0.02], friction: 0.5}",
                   each.start_m,
                   0.03,
                   0.03,
                   2.2,
                   each.tip_friction};
    const Pushed truth = push(how, kConverged);
    EXPECT_GT(*std::max_element(truth.force_n.begin(), truth.force_n.end()), 0.4);
    for (const char* const hz : kPhysics_hz) {
      const double worst_n = apart_n(push(how, physics_at(hz)), truth);
      std::printf("%s, physics %s Hz: at most %.4f N off\n", each.what, hz, worst_n);
      EXPECT_LE(worst_n, 0.1) << each.what << ", physics " << hz;
    }
  }
}

void expect_turns_as_in_truth(const std::string& floor) {
  const Push how{floor +
                     ", {name: block, type: dynamic, mass_kg: 0.1, shape: {box: {size_m: [0.06, 0.04, 0.04]}}, "
                     "position_m: [0, 0.02, -0.02], friction: 0.6}",
                 "[0.022, 0.02, 0.012]", 0.03, 0.03, 2.5};
  const Pushed truth = push(how, kConverged);
  const double turned_deg =
      180.0 / std::numbers::pi * truth.last.orientation.angularDistance(Eigen::Quaterniond::Identity());
  EXPECT_GT(turned_deg, 10.0);
  for (const char* const hz : kPhysics_hz) {
    const Pushed felt = push(how, physics_at(hz));
    const double off_deg = 180.0 / std::numbers::pi * felt.last.orientation.angularDistance(truth.last.orientation);
    std::printf("physics %s Hz: turned by %.2f deg, off by %.2f deg\n", hz, turned_deg, off_deg);
    EXPECT_LE(off_deg, 2.0) << hz;
  }
}

TEST(FreeBox, PushedAtACornerTurnsAsItDoesInTruth) { expect_turns_as_in_truth(kFloor); }

// As a patch it turned by 8 degrees too little with physics at 18 Hz.
TEST(FreeBox, PushedAtACornerOnAMeshTurnsAsItDoesInTruth) { expect_turns_as_in_truth(mesh_floor()); }

TEST(FreeBox, PushedOffATableFallsWhenItsMiddleIsBeyondTheEdge) {
  const Push how{
      "{name: table, type: static, shape: {box: {size_m: [0.2, 0.1, 0.1]}}, position_m: [0, -0.05, -0.01], "
      "friction: 0.5}, {name: block, type: dynamic, mass_kg: 0.1, shape: {box: {size_m: [0.04, 0.04, "
      "0.03]}}, position_m: [0, 0.02, -0.025], friction: 0.4}",
      "[0, 0.02, 0.002]", 0.06, 0.03, 4.0};
  constexpr double kFallen_m = 0.02;
  // When it falls varies by 17 ms with the engine's rate, up and down: the truth is a mean of three.
  double truth_s = 0.0;
  for (const std::string both_hz : {"2000", "4000", "10000"}) {
    const Pushed truth = push(how, {"haptic.0.rate_hz=" + both_hz, "physics.rate_hz=" + both_hz}, kFallen_m);
    ASSERT_GT(truth.left_s, 1.0);
    truth_s += truth.left_s / 3.0;
  }
  for (const char* const hz : kPhysics_hz) {
    const Pushed felt = push(how, physics_at(hz), kFallen_m);
    std::printf("physics %s Hz: fallen after %.3f s, in truth %.3f s\n", hz, felt.left_s, truth_s);
    EXPECT_NEAR(felt.left_s, truth_s, 1e-3 + 1.0 / std::stod(hz)) << hz;
  }
}

// Physics lets what slides tilt by micrometres. To fall by that in each tick, and to be put back by each answer, took
// the tip down along the face until its friction was spent: half of the push.
TEST(FreeBox, PushedStraightByAHandWithFastPhysicsIsNotFeltAcross) {
  struct Pushes {
    std::string what, shape, height_m;
  };
  for (const Pushes& each : {Pushes{"box", "{box: {size_m: [0.04, 0.04, 0.04]}}", "0.02"},
                             Pushes{"cylinder", "{cylinder: {radius_m: 0.02, length_m: 0.03}}", "0.015"}}) {
    const Push how{kFloor + ", {name: body, type: dynamic, mass_kg: 0.2, shape: " + each.shape + ", position_m: [0, " +
                       each.height_m + ", 0], friction: 0.5}",
                   "[0, " + each.height_m + ", 0.03]",
                   0.05,
                   0.03,
                   2.6,
                   1.0};
    const Pushed felt = push(how, {"physics.rate_hz=1000"});
    constexpr std::ptrdiff_t kSlides_ms = 1300;
    const double push_n_ms = std::accumulate(felt.force_n.begin() + kSlides_ms, felt.force_n.end(), 0.0);
    const double across_n_ms = std::accumulate(felt.across_n.begin() + kSlides_ms, felt.across_n.end(), 0.0);
    std::printf("%s: across %.3f of the push\n", each.what.c_str(), across_n_ms / push_n_ms);
    EXPECT_GT(push_n_ms, 300.0) << "it slides under the push";
    EXPECT_LE(across_n_ms, 0.05 * push_n_ms) << each.what;
  }
}

// Physics told that a wall holds it only after it had met the wall: until then the box went on, and the force was 0.8 N
// too small.
TEST(FreeBox, PushedAgainstAWallStopsThere) {
  const Push how{kFloor + kBox +
                     ", {name: wall, type: static, shape: {box: {size_m: [0.2, 0.1, 0.02]}}, "
                     "position_m: [0, 0.05, -0.05]}",
                 "[0, 0.02, 0.03]",
                 0.04,
                 0.03,
                 2.6,
                 0.0};
  const Pushed prompt = push(how, {"physics.rate_hz=1000"});
  EXPECT_GT(*std::max_element(prompt.force_n.begin(), prompt.force_n.end()), 3.0) << "it stands at the wall";
  for (const char* const hz : kPhysics_hz) {
    const double worst_n = apart_n(push(how, physics_at(hz)), prompt);
    std::printf("physics %s Hz: at most %.4f N off\n", hz, worst_n);
    EXPECT_LE(worst_n, 0.1) << hz;
  }
}

// The side of a table that is as high as the one before it is no wall.
TEST(FreeBox, PushedFromTableToTableFeelsNoSeam) {
  const auto table = [](const std::string& name, const std::string& depth_m, const std::string& z_m) {
    return "{name: " + name + ", type: static, friction: 0.7, shape: {box: {size_m: [0.2, 0.1, " + depth_m +
           "]}}, position_m: [0, -0.05, " + z_m + "]}";
  };
  const std::string one = table("one", "0.2", "-0.03") + kBox;
  const std::string two = table("near", "0.1", "0.02") + kBox + ", " + table("far", "0.1", "-0.08");
  for (const char* const hz : kPhysics_hz) {
    const auto pushed = [hz](const std::string& bodies) {
      return push({bodies, "[0, 0.02, 0.03]", 0.07, 0.03, 3.4, 0.0}, physics_at(hz));
    };
    const Pushed over = pushed(two);
    EXPECT_LT(over.last.position_m.z(), -0.035) << "its middle is over the other table";
    EXPECT_NEAR(over.last.position_m.y(), 0.02, 1e-4);
    const double worst_n = apart_n(over, pushed(one));
    std::printf("physics %s Hz: a seam is felt by %.4f N\n", hz, worst_n);
    EXPECT_LE(worst_n, 0.05) << hz;
  }
}

// Stroked along its top, from z = −45 mm on, with slow physics.
void expect_rolls_as_in_truth(const std::string& body, double tolerance_m, const std::string& floor = kFloor) {
  const Push how{floor + ", {name: roller, type: dynamic, friction: 0.7, position_m: [0, 0.012, -0.045], " + body + "}",
                 "[0, 0.0275, -0.035]",
                 0.03,
                 0.03,
                 2.5,
                 1.0};
  const double truth_m = push(how, kConverged).last.position_m.z();
  EXPECT_LT(truth_m, -0.055);
  for (const char* const hz : kPhysics_hz) {
    const double rolled_m = push(how, physics_at(hz)).last.position_m.z();
    std::printf("physics %s Hz: rolls to %.3f mm, in truth to %.3f mm\n", hz, 1e3 * rolled_m, 1e3 * truth_m);
    EXPECT_NEAR(rolled_m, truth_m, tolerance_m) << hz;
  }
}

// Held a step behind its centre it was braked by its weight, and ended 1.2 mm short.
TEST(FreeBall, StrokedAlongItsTopRollsAsFarAsInTruth) {
  expect_rolls_as_in_truth("mass_kg: 0.05, shape: {sphere: {radius_m: 0.012}}", 0.1e-3);
}

// What is round is held below its axis, wherever it has turned. As a foot that turns along it braked, and the finger
// ran off in front of it after half of the way. With one of its ends at a time on the floor it ended 0.5 mm off.
const std::string kCapsule =
    "mass_kg: 0.1, shape: {capsule: {radius_m: 0.012, length_m: 0.06}}, orientation_wxyz: [0.70710678, 0, 0, "
    "0.70710678]";
const std::string kRoller =
    "mass_kg: 0.1, shape: {cylinder: {radius_m: 0.012, length_m: 0.05}}, orientation_wxyz: [0.70710678, 0, 0, "
    "0.70710678]";

TEST(FreeCapsule, StrokedAlongItsTopRollsAsFarAsInTruth) { expect_rolls_as_in_truth(kCapsule, 0.1e-3); }

TEST(FreeCylinder, StrokedAlongItsTopRollsAsFarAsInTruth) { expect_rolls_as_in_truth(kRoller, 0.1e-3); }

// A table has the face of a box: with Bullet's points on that they rolled on when the finger had stopped.
TEST(FreeCapsule, StrokedAlongItsTopOnATableRollsAsFarAsInTruth) {
  for (const std::string& body : {kCapsule, kRoller}) {
    expect_rolls_as_in_truth(body, 0.1e-3,
                             "{name: table, type: static, shape: {box: {size_m: [0.4, 0.1, 0.4]}}, position_m: [0, "
                             "-0.05, 0], friction: 0.5}");
  }
}

TEST(FreeCapsule, StrokedAlongItsTopOnAMeshRollsAsFarAsInTruth) {
  for (const std::string& body : {kCapsule, kRoller}) expect_rolls_as_in_truth(body, 0.1e-3, mesh_floor());
}

// At the edge its rim is cut off. With Bullet's points there it was 0.3 N off when it tipped.
TEST(FreeCylinder, PushedOffATableIsFeltAsInTruth) {
  const Push how{
      "{name: table, type: static, shape: {box: {size_m: [0.2, 0.1, 0.1]}}, position_m: [0, -0.05, -0.01], friction: "
      "0.5}, {name: can, type: dynamic, mass_kg: 0.2, shape: {cylinder: {radius_m: 0.02, length_m: 0.04}}, position_m: "
      "[0, 0.02, -0.025], friction: 0.4}",
      "[0, 0.02, 0.002]", 0.06, 0.03, 2.8};
  const Pushed truth = push(how, kConverged, 0.1);
  EXPECT_GT(truth.left_s, 2.2);
  for (const char* const hz : kPhysics_hz) {
    const Pushed pushed = push(how, physics_at(hz), 0.1);
    const double worst_n = apart_n(pushed, truth);
    std::printf("physics %s Hz: at most %.3f N off, falls after %.3f s, in truth %.3f s\n", hz, worst_n, pushed.left_s,
                truth.left_s);
    EXPECT_LE(worst_n, 0.1) << hz;
    EXPECT_NEAR(pushed.left_s, truth.left_s, 0.06) << hz;
  }
}

// A wedge is a hull, and lies on the face of the table as on a plane.
TEST(FreeHull, PushedOnATableIsFeltAsOnAPlane) {
  const auto pushed = [](const std::string& floor, const char* hz) {
    return push({floor + ", {name: wedge, type: dynamic, mass_kg: 0.2, shape: {convex_hull: {file: "
                         "scenes/meshes/wedge.obj, metres_per_unit: 0.001}}, position_m: [-0.01333, 0, -0.015], "
                         "friction: 0.5}",
                 "[0, 0.010, 0.0205]", 0.03, 0.03, 2.5, 0.3},
                physics_at(hz));
  };
  for (const char* const hz : kPhysics_hz) {
    const double worst_n = apart_n(pushed("{name: table, type: static, shape: {box: {size_m: [0.4, 0.1, 0.4]}}, "
                                          "position_m: [0, -0.05, 0], friction: 0.5}",
                                          hz),
                                   pushed(kFloor, hz));
    std::printf("physics %s Hz: at most %.4f N apart\n", hz, worst_n);
    EXPECT_LE(worst_n, 0.05) << hz;
  }
}

}  // namespace
}  // namespace free_box
#endif
