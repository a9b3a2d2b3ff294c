/// The tuned values of local_contact (tuning.hpp): each lies in its range, at both ends of which the method works; and
/// where a value does something to be felt, it fails outside of the range.
#include "haptic_node/rendering/tuning.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <iterator>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "haptic_node/rendering/local_world.hpp"
#include "rtbus/clock.hpp"
#include "tests/unit/haptic/falling_box.hpp"
#include "tests/unit/haptic/held_world.hpp"

namespace tuning_test {

using Eigen::Vector3d;
using haptic::kTunedValues;
using haptic::LocalWorld;
using haptic::TunedValue;
using haptic::Tuning;
using rtbus::ProxyContacts;

constexpr double kH = 1e-3, kK = 500.0, kB = 0.5;

/// A local world with a hand on it.
struct Scene : tests::HeldWorld {
  explicit Scene(const Tuning& tuning, std::vector<rtbus::shapes::KnownShape> shapes = {})
      : HeldWorld(kK, kB, std::move(shapes), 0, tuning) {
    reset(Vector3d::Zero());
  }
  /// Where a hand that came from +x would meet something in the next tick.
  [[nodiscard]] double surface_x() const {
    double low_m = -0.05, high_m = 0.2;
    const auto probe = std::make_unique<LocalWorld>(*world);
    while (high_m - low_m > 1e-6) {
      const double x_m = 0.5 * (low_m + high_m);
      *probe = *world;
      probe->advance({{x_m, 0, 0}, Vector3d::Zero(), kK, 0.0}, now_ns + rtbus::kNsPerMs, kH);
      (probe->impulse_n_s().x() > 0.0 ? low_m : high_m) = x_m;
    }
    return low_m;
  }
  void take(ProxyContacts answer, double age_s = 0.0) {
    answer.device_time_ns = now_ns - static_cast<std::uint64_t>(age_s * 1e9);
    world->take(answer, now_ns);
  }
};

/// A wall that fills x < `x_m`.
ProxyContacts wall_at(double x_m, double step_s = 0.05) {
  ProxyContacts out;
  out.device_sequence = 1;
  out.step_s = step_s;
  out.contacts = out.bodies = 1;
  out.contact_normal[0] = {1, 0, 0};
  out.contact_point_m[0] = {x_m, 0, 0};
  return out;
}

/// A body of 0.1 kg whose surface is at `x_m`, on `points` points of a floor with friction 0.5.
ProxyContacts block_at(double x_m, std::uint32_t points, double inverse_mass_per_kg = 10.0, double step_s = 0.05) {
  const double weight_n = 9.81 / inverse_mass_per_kg;
  ProxyContacts out = wall_at(x_m, step_s);
  out.body_kind[0] = 2;
  out.body_inverse_mass_per_kg[0] = inverse_mass_per_kg;
  out.body_centre_m[0] = {x_m - 0.01, 0, 0};
  out.supports = 1;
  out.support_normal[0] = {0, 1, 0};
  out.support_point_m[0] = {x_m - 0.01, -0.01, 0};
  out.support_force_n[0] = weight_n;
  out.support_friction[0] = 0.5;
  out.support_points[0] = points;
  out.body_friction_bound_n[0] = 0.5 * weight_n;
  return out;
}

ProxyContacts pile_at(double x_m, double mass_kg = 0.1) {
  ProxyContacts out = block_at(x_m, 4, 1.0 / mass_kg);
  out.support_inverse_mass_per_kg[0] = 1.0 / mass_kg;
  return out;
}

/// What yields, with a surface that is at x = 0 at rest: the tool at `tool_x_m` bears `force_n`.
ProxyContacts yields_at(double tool_x_m, double force_n, double stiffness_n_per_m) {
  ProxyContacts out;
  out.device_sequence = 1;
  out.step_s = 0.05;
  out.yields = 1;
  out.yield_tool_m[0] = {tool_x_m, 0, 0};
  out.yield_reaction_n[0] = {force_n, 0, 0};
  out.yield_normal[0] = {1, 0, 0};
  out.yield_gap_m[0] = std::max(tool_x_m, 0.0);
  out.yield_stiffness_n_per_m = stiffness_n_per_m;
  return out;
}

/// A hull of 20 mm around the origin, and the same as triangles.
rtbus::shapes::KnownShape cube(bool triangles) {
  rtbus::shapes::Hull corners;
  for (int i = 0; i < 8; ++i) {
    corners.points_m.emplace_back((i & 1) != 0 ? 0.01 : -0.01, (i & 2) != 0 ? 0.01 : -0.01,
                                  (i & 4) != 0 ? 0.01 : -0.01);
  }
  rtbus::shapes::KnownShape out;
  if (!triangles) {
    out.shape = corners;
    return out;
  }
  const std::vector<std::array<std::uint32_t, 3>> faces{{0, 1, 3}, {0, 3, 2}, {4, 5, 7}, {4, 7, 6},
                                                        {0, 1, 5}, {0, 5, 4}, {2, 3, 7}, {2, 7, 6},
                                                        {0, 2, 6}, {0, 6, 4}, {1, 3, 7}, {1, 7, 5}};
  out.shape = std::make_shared<const rtbus::shapes::Surface>(corners.points_m, faces);
  return out;
}

/// Figures, each within its bounds or not.
struct Figures {
  bool good = true;
  std::string said;

  Figures& within(const char* what, double value, double low, double high) {
    good = good && value >= low && value <= high;
    said += std::string(said.empty() ? "" : ", ") + what + " " + std::to_string(value) + " [" + std::to_string(low) +
            ", " + std::to_string(high) + "]";
    return *this;
  }
  operator testing::AssertionResult() const {  // NOLINT(google-explicit-constructor): EXPECT_TRUE takes it
    return (good ? testing::AssertionSuccess() : testing::AssertionFailure()) << said;
  }
};

// What the method must do whatever a tuned value within its range is.

/// A wall is felt with the spring's force, and free air with none.
Figures wall_is_exact(const Tuning& tuning) {
  Scene scene(tuning);
  scene.take(wall_at(0.0));
  for (int i = 0; i < 50; ++i) scene.tick(-1e-3);
  const double pressed_n = scene.tick(-1e-3);
  return Figures{}.within("pressed N", pressed_n, 0.499999, 0.500001).within("free N", scene.tick(0.02), 0.0, 0.0);
}

/// A block that is pressed with 0.25 N of the 0.49 N that friction bears stands, with answers 50 ms old. What creeps
/// would soon be off by more: 0.01 N is 20 um.
Figures block_stands(const Tuning& tuning) {
  Scene scene(tuning);
  scene.take(block_at(0.0, 4));
  double force_n = 0.0;
  for (int i = 0; i < 600; ++i) {
    if (i % 50 == 0 && i > 0) scene.take(block_at(0.0, 4), 0.05);
    force_n = scene.tick(-5e-4);
  }
  return Figures{}.within("force N", force_n, 0.24, 0.26);
}

/// Pushed at 0.1 m/s the block resists with friction's force, with answers 50 ms old of where it is.
Figures block_slides(const Tuning& tuning) {
  constexpr double kSpeed = 0.1, kMass_kg = 0.1, kFriction_n = 0.5 * kMass_kg * 9.81;
  constexpr int kPeriod = 50;
  Scene scene(tuning);
  scene.take(block_at(0.0, 4));
  struct Truth {
    double x_m = 0.0, velocity_m_s = 0.0;
  } truth;
  std::vector<Truth> past;
  double sum_n = 0.0, peak_n = 0.0;
  for (int i = 0; i < 1000; ++i) {
    past.push_back(truth);
    if (i % kPeriod == 0 && i >= kPeriod) {
      const Truth& then = past[static_cast<std::size_t>(i - kPeriod)];
      ProxyContacts told = block_at(then.x_m, 4);
      told.body_velocity_m_s[0] = {then.velocity_m_s, 0, 0};
      scene.take(told, kH * kPeriod);
    }
    const double force_n = scene.tick({-kSpeed * kH * i, 0, 0}, {-kSpeed, 0, 0}).x();
    truth.velocity_m_s -= kH * force_n / kMass_kg;
    const double stopped = kH * kFriction_n / kMass_kg;
    truth.velocity_m_s -= std::clamp(truth.velocity_m_s, -stopped, stopped);
    truth.x_m += kH * truth.velocity_m_s;
    if (i < 500) continue;
    sum_n += force_n / 500.0;
    peak_n = std::max(peak_n, std::abs(force_n - kFriction_n));
  }
  return Figures{}
      .within("mean force N", sum_n, 0.98 * kFriction_n, 1.02 * kFriction_n)
      .within("off N", peak_n, 0.0, 0.06);
}

/// The proxy goes around the edge of a known shape without leaving it.
Figures edge_is_followed(const Tuning& tuning) {
  double worst_m = 0.0;
  for (const bool triangles : {false, true}) {
    Scene scene(tuning, {cube(triangles)});
    constexpr double kRadius_m = 0.004;
    scene.reset({0, 0.0142, 0});
    ProxyContacts top = wall_at(0.0, 1.0);
    top.proxy_radius_m = kRadius_m;
    top.contact_normal[0] = {0, 1, 0};
    top.contact_point_m[0] = {0, 0.01, 0};
    scene.take(top);
    for (int i = 0; i <= 250; ++i) {
      const double along_m = 1e-4 * i;
      scene.tick(along_m < 0.012 ? Vector3d(along_m, 0.012, 0) : Vector3d(0.012, 0.024 - along_m, 0));
      const Vector3d outside = (scene.world->position_m().cwiseAbs() - Vector3d::Constant(0.01)).cwiseMax(0.0);
      worst_m = std::max(worst_m, std::abs(outside.norm() - kRadius_m));
    }
  }
  return Figures{}.within("off the shape um", 1e6 * worst_m, 0.0, 5.0);
}

/// A soft body that is told with a stiffness of a third to four times the true one comes to its true force.
Figures soft_settles(const Tuning& tuning) {
  constexpr double kTrue_n_per_m = 100.0, kHand = -0.008;
  const double due_n = -kHand / (1.0 / kK + 1.0 / kTrue_n_per_m);
  Figures out;
  for (const double told : {33.0, 100.0, 400.0}) {
    Scene scene(tuning);
    scene.take(yields_at(0.0, 0.0, told));
    double force_n = 0.0, hand_tool_m = 0.0;
    for (int step = 0; step < 60; ++step) {
      for (int i = 0; i < 50; ++i) force_n = scene.tick(kHand);
      // The tool of physics is on the same spring, and gets what the hand felt at the last answered sample.
      if (step > 0) scene.take(yields_at(hand_tool_m, -kTrue_n_per_m * hand_tool_m, told), 0.05);
      hand_tool_m = (kK * scene.world->position_m().x() - force_n) / (kK + kTrue_n_per_m);
    }
    out.within("force over its due one", force_n / due_n, 0.98, 1.02);
  }
  return out;
}

/// A hand that rests on a pile of a kilogram is not moved by it.
Figures pile_bears(const Tuning& tuning) {
  Scene scene(tuning);
  double force_n = 0.0;
  for (int answer = 0; answer < 20; ++answer) {
    scene.take(pile_at(0.0, 1.0), 0.05);
    for (int i = 0; i < 50; ++i) force_n = scene.tick(-1e-3);
  }
  return Figures{}.within("force N", force_n, 0.49, 0.51);
}

// What one value does. Each is said of a tuning as a whole.

/// Share of a step of a fixed surface by 0.1 mm that is left after `wait_s`, and the largest part of it in one tick.
struct Step {
  double left = 0.0, largest = 0.0;
};
template <class Answer>
Step step_of(const Tuning& tuning, double wait_s, const Answer& at) {
  constexpr double kMoved_m = 1e-4;
  Scene scene(tuning);
  scene.damping_n_s_per_m = 0.0;
  scene.take(at(0.0));
  double before_n = 0.0;
  for (int i = 0; i < 100; ++i) before_n = scene.tick(-1e-3);
  scene.take(at(kMoved_m));
  const double due_n = before_n + kK * kMoved_m;
  Step out;
  for (int i = 0; i < static_cast<int>(wait_s / kH); ++i) {
    const double force_n = scene.tick(-1e-3);
    out.largest = std::max(out.largest, std::abs(force_n - before_n) / (kK * kMoved_m));
    before_n = force_n;
  }
  out.left = std::abs(due_n - before_n) / (kK * kMoved_m);
  return out;
}

Figures blends_within_a_period(const Tuning& tuning) {
  const Step step = step_of(tuning, 0.2, [](double x_m) { return wall_at(x_m, 0.2); });
  return Figures{}.within("left", step.left, 0.0, 0.2).within("largest", step.largest, 0.0, 0.05);
}

Figures blends_fast_answers(const Tuning& tuning) {
  const Step step = step_of(tuning, 0.04, [](double x_m) { return wall_at(x_m, 1e-3); });
  return Figures{}.within("left", step.left, 0.0, 0.1).within("largest", step.largest, 0.0, 0.2);
}

/// What yields bears 0.1 N more: `kDue_n` of it is the hand's, which gives way by the rest. The hand moves along it:
/// one that rests feels the change later.
Figures blends_what_yields(const Tuning& tuning) {
  constexpr double kSoft_n_per_m = 100.0, kTool_m = -1e-3, kBefore_n = 0.4, kMore_n = 0.1;
  constexpr double kHand_m = kTool_m - kBefore_n / kK, kDue_n = kMore_n * kK / (kK + kSoft_n_per_m);
  Scene scene(tuning);
  scene.damping_n_s_per_m = 0.0;
  scene.take(yields_at(kTool_m, kBefore_n, kSoft_n_per_m));
  double before_n = 0.0, largest_n = 0.0;
  const auto tick = [&] { return scene.tick({kHand_m, 0, 0}, {0, 0.02, 0}).x(); };
  for (int i = 0; i < 100; ++i) before_n = tick();
  scene.take(yields_at(kTool_m, kBefore_n + kMore_n, kSoft_n_per_m));
  for (int i = 0; i < 50; ++i) {
    const double force_n = tick();
    largest_n = std::max(largest_n, std::abs(force_n - before_n));
    before_n = force_n;
  }
  return Figures{}
      .within("left after a period", (kBefore_n + kDue_n - before_n) / kDue_n, 0.0, 0.3)
      .within("largest", largest_n / kDue_n, 0.0, 0.08);
}

/// A body as heavy as a mountain, on one point.
Figures blends_what_rocks_slowly(const Tuning& tuning) {
  const auto at = [](double x_m) { return block_at(x_m, 1, 1e-9, 0.05); };
  return Figures{}
      .within("left after a period", step_of(tuning, 0.05, at).left, 0.4, 1.0)
      .within("left after eight", step_of(tuning, 0.4, at).left, 0.0, 0.15);
}

Figures averages_what_rocks(const Tuning& tuning) {
  const auto at = [](double x_m) { return block_at(x_m, 1, 1e-9, 1e-3); };
  const Step step = step_of(tuning, 0.1, at);
  return Figures{}.within("left", step.left, 0.0, 0.15).within("largest", step.largest, 0.0, 0.051);
}

/// A tip that begins 10 mm deep in a wall comes out, but does not fly out.
Figures comes_out_of_a_wall(const Tuning& tuning) {
  Scene scene(tuning);
  scene.reset({-0.01, 0, 0});
  scene.take(wall_at(0.0, 0.03));
  double fastest_m_s = 0.0;
  int ticks = 0;
  while (scene.world->position_m().x() < -2e-3 && ticks < 1000) {
    const double before_m = scene.world->position_m().x();
    scene.tick(-0.01);
    fastest_m_s = std::max(fastest_m_s, (scene.world->position_m().x() - before_m) / kH);
    ++ticks;
  }
  return Figures{}.within("ticks", ticks, 0, 100).within("fastest m/s", fastest_m_s, 0.0, 0.35);
}

/// A box that stood on its edge 0.2 s ago falls over towards the hand.
Figures falls_as_a_pendulum(const Tuning& tuning) {
  using tests::FallingBox;
  constexpr double kPast_rad = 0.02, kAge_s = 0.2;
  Scene scene(tuning, FallingBox::shapes());
  scene.tick({0.1, 0, 0});
  scene.take(FallingBox::answer(kPast_rad, 0), kAge_s);
  const double turned_rad = kPast_rad * (std::cosh(FallingBox::kLambda_per_s * (kAge_s + kH)) - 1.0);
  const double leans_rad = std::atan2(scene.surface_x(), -FallingBox::kEdge_m.y());
  const double turns = (leans_rad - FallingBox::kBalanced_rad - kPast_rad) / turned_rad;
  return Figures{}.within("turns, of the closed form", turns, 0.99, 1.01);
}

/// A plate that comes at 0.2 m/s pushes a proxy at rest into a wall that it has missed by a little.
Figures is_not_squeezed_through(const Tuning& tuning) {
  double deepest_m = 0.0;
  for (int start = 0; start < 20; ++start) {
    Scene scene(tuning);
    ProxyContacts told = wall_at(-1e-3 - 1e-5 * start, 1.0);
    told.contacts = told.bodies = 2;
    told.body_kind[0] = 1;
    told.body_velocity_m_s[0] = {0.2, 0, 0};
    told.body_centre_m[0] = told.contact_point_m[0];
    told.body_index[1] = told.contact_body[1] = 1;
    told.contact_normal[1] = {-M_SQRT1_2, -M_SQRT1_2, 0};
    told.contact_point_m[1] = {1e-4, 1e-4, 0};
    scene.take(told);
    for (int i = 0; i < 8; ++i) {
      scene.tick(Vector3d::Zero());
      const Vector3d way = scene.world->position_m() - Vector3d(1e-4, 1e-4, 0);
      deepest_m = std::max(deepest_m, way.dot(Vector3d(M_SQRT1_2, M_SQRT1_2, 0)));
    }
  }
  return Figures{}.within("deepest mm", 1e3 * deepest_m, -1.0, 0.15);
}

/// A proxy of 0.6 mm meets a surface of triangles that no answer describes rightly; one of 0.05 mm meets the plane.
Figures small_proxies_meet_planes(const Tuning& tuning) {
  const auto rests_at = [&](double radius_m) {
    Scene scene(tuning, {cube(true)});
    scene.reset({0, 0.012, 0});
    ProxyContacts top = wall_at(0.0, 1.0);
    top.proxy_radius_m = radius_m;
    top.contact_normal[0] = {0, 1, 0};
    top.contact_point_m[0] = {0, 0.005, 0};  // 5 mm below where the surface is
    scene.take(top);
    for (int i = 0; i < 50; ++i) scene.tick({0, 0.003, 0});
    return scene.world->position_m().y();
  };
  return Figures{}
      .within("large one at mm", 1e3 * rests_at(0.6e-3), 10.59, 10.61)
      .within("small one at mm", 1e3 * rests_at(0.05e-3), 5.04, 5.06);
}

/// A body between two supports that face each other, pressed on one of them, neither flies off nor sinks.
Figures facing_supports_agree(const Tuning& tuning) {
  Scene scene(tuning);
  ProxyContacts told = block_at(0.0, 4);
  told.supports = 2;
  told.support_normal[0] = {1, 0, 0};
  told.support_normal[1] = {-1, 0, 0};
  told.support_point_m[0] = {-0.02, 0, 0};
  told.support_point_m[1] = {0.0, 0.01, 0};
  told.support_friction[0] = told.support_friction[1] = 0.0;
  told.support_force_n[0] = told.support_force_n[1] = 5.0;
  scene.take(told);
  double least_n = 1e9, most_n = 0.0;
  for (int i = 0; i < 400; ++i) {
    if (i % 50 == 0) scene.take(told, i == 0 ? 0.0 : 0.05);
    const double force_n = scene.tick(-1e-3);
    if (i < 100) continue;
    least_n = std::min(least_n, force_n);
    most_n = std::max(most_n, force_n);
  }
  return Figures{}.within("least N", least_n, 0.45, 0.55).within("spread N", most_n - least_n, 0.0, 0.02);
}

/// A pile that slipped by 2 mm in a period under a hand at rest does not go on as fast: by the time it is told, 0.04
/// m/s would be 2 mm more.
Figures a_slip_is_over(const Tuning& tuning) {
  constexpr double kAge_s = 0.05;
  Scene scene(tuning);
  scene.take(pile_at(0.0), kAge_s);
  for (int i = 0; i < 50; ++i) scene.tick(-1e-3);
  scene.take(pile_at(-2e-3), kAge_s);
  double low_m = 1.0;
  for (int i = 0; i < 300; ++i) {
    scene.tick(-6e-3);
    low_m = std::min(low_m, scene.world->position_m().x());
  }
  return Figures{}.within("lowest mm", 1e3 * low_m, -3.5, -1.8);
}

/// A pile of 0.1 kg under 0.5 N more than it was told of gives way: by 1 to 3 mm/s per newton.
Figures a_pile_gives_way(const Tuning& tuning) {
  Scene scene(tuning);
  scene.take(pile_at(0.0));
  for (int i = 0; i < 5; ++i) scene.tick(-1e-3);
  const double before_m = scene.world->position_m().x();
  double force_n = 0.0;
  for (int i = 0; i < 20; ++i) force_n += scene.tick(-1e-3) / 20.0;
  const double mobility = (before_m - scene.world->position_m().x()) / 0.02 / force_n;
  return Figures{}.within("mm/s per N", 1e3 * mobility, 0.9, 3.1);
}

/// A driven plate goes on for two periods without an answer, and stands soon after.
Figures goes_on_for_its_period(const Tuning& tuning) {
  const auto after = [&](double wait_s, double period_s) {
    Scene scene(tuning);
    scene.reset({0.5, 0, 0});
    ProxyContacts plate = wall_at(0.0, period_s);
    plate.body_kind[0] = 1;
    plate.body_velocity_m_s[0] = {0.1, 0, 0};
    scene.take(plate);
    for (int i = 0; i < static_cast<int>(wait_s / kH); ++i) scene.tick(0.5);
    return scene.surface_x();
  };
  const double steady_m = after(0.2 * 1.15, 0.2) - after(0.05, 0.2), stands_m = after(1.0, 0.05) - after(0.6, 0.05);
  return Figures{}
      .within("went on mm", 1e3 * steady_m, 16.0, 20.0)
      .within("moves still mm", 1e3 * stands_m, -0.1, 0.1)
      .within("stood at mm", 1e3 * after(0.6, 0.05), 6.0, 14.5);
}

/// Answers that are two ticks late at 1 kHz do not stop it; when they stay away it stands within 30 ms.
Figures waits_for_the_scheduler(const Tuning& tuning) {
  double way_m[2] = {};
  for (const int late : {2, 60}) {
    Scene at(tuning);
    at.reset({0.5, 0, 0});
    ProxyContacts plate = wall_at(0.0, 1e-3);
    plate.body_kind[0] = 1;
    plate.body_velocity_m_s[0] = {0.1, 0, 0};
    at.take(plate);
    for (int i = 0; i < late; ++i) at.tick(0.5);
    way_m[late == 2 ? 0 : 1] = at.surface_x();
  }
  return Figures{}.within("two late mm", 1e3 * way_m[0], 0.29, 0.5).within("in the end mm", 1e3 * way_m[1], 0.5, 4.0);
}

/// Deep in a plate of 40 mm the nearer side changes with each answer: the way out does not, while answers come.
Figures keeps_the_way_out(const Tuning& tuning) {
  Scene scene(tuning);
  scene.reset({0.001, 0, 0});
  for (int answer = 0; answer < 8; ++answer) {
    const double side = answer % 2 == 0 ? 1.0 : -1.0;
    ProxyContacts told = wall_at(0.02 * side);
    told.contact_normal[0] = {side, 0, 0};
    scene.take(told);
    for (int i = 0; i < 50; ++i) scene.tick(0.0);
  }
  return Figures{}.within("out at mm", 1e3 * scene.world->position_m().x(), 18.0, 22.0);
}

/// A face that turns by 30 degrees between two answers is one contact still: its force does not jump. One that is at
/// right angles to it is another.
Figures tells_contacts_apart(const Tuning& tuning) {
  Scene scene(tuning);
  scene.take(wall_at(0.0));
  double force_n = 0.0;
  for (int i = 0; i < 100; ++i) force_n = scene.tick(-1e-3);
  ProxyContacts turned = wall_at(0.0);
  turned.contact_normal[0] = {std::cos(0.5), std::sin(0.5), 0};
  turned.contact_point_m[0] = {1e-3, 0, 0};
  scene.take(turned);
  double least_n = force_n;
  for (int i = 0; i < 20; ++i) least_n = std::min(least_n, scene.tick(-1e-3));
  Scene corner(tuning);
  corner.take(wall_at(0.0));
  for (int i = 0; i < 100; ++i) corner.tick(-1e-3);
  ProxyContacts other = wall_at(0.0);
  other.contact_normal[0] = {std::cos(1.3), std::sin(1.3), 0};
  other.contact_point_m[0] = {0, -1e-3, 0};
  corner.take(other);
  for (int i = 0; i < 3; ++i) corner.tick(-1e-3);
  // Were it the same one, it would now be felt along its own normal alone.
  const Vector3d after = corner.world->impulse_n_s() / kH;
  return Figures{}
      .within("least of the same one N", least_n, 0.35, 0.6)
      .within("of the old one N", after.x(), 0.05, 0.5)
      .within("of the new one N", std::abs(after.y()), 0.0, 0.05);
}

/// A hand that is 60 mm behind a surface at 1 m/s stays on its side.
Figures is_held_at_speed(const Tuning& tuning) {
  Scene scene(tuning, {cube(true)});
  constexpr double kRadius_m = 0.002;
  ProxyContacts named = wall_at(0.0, 1.0);
  named.proxy_radius_m = kRadius_m;
  double farthest_m = 0.0;
  for (int i = 0; i < 4000; ++i) {
    if (i % 200 == 0) scene.take(named);
    const int twentieth = i / 20;
    const double turn = 0.37 * twentieth;
    scene.tick({0.06 * std::cos(turn), 0.06 * std::sin(2.1 * turn), 0.06 * std::sin(0.7 * turn)});
    farthest_m = std::max(farthest_m, scene.world->position_m().cwiseAbs().maxCoeff());
  }
  return Figures{}.within("farthest mm", 1e3 * farthest_m, 7.0, 8.2);
}

struct Behaviour {
  std::string_view name;
  std::function<Figures(const Tuning&)> holds;
  std::vector<double> too_far;  ///< Values outside of the range, at which it does not hold. None: a bound of cost.
};

const std::vector<Behaviour>& behaviours() {
  static const std::vector<Behaviour> kAll{
      {"blend_periods", &blends_within_a_period, {0.08, 1.0}},
      {"blend_floor_s", &blends_fast_answers, {3e-3, 0.025}},
      {"yielding_blend_periods", &blends_what_yields, {0.15, 1.5}},
      {"slow_blend_periods", &blends_what_rocks_slowly, {0.7, 6.0}},
      {"noise_s", &averages_what_rocks, {0.01, 0.1}},
      {"recovery_m_s", &comes_out_of_a_wall, {0.05, 0.6}},
      {"least_proxy_m", &small_proxies_meet_planes, {0.02e-3, 1e-3}},
      {"support_softness", &facing_supports_agree, {}},
      {"pile_own_speed_m_s", &a_slip_is_over, {40e-3}},
      {"pile_mobility_s", &a_pile_gives_way, {0.05e-3, 0.8e-3}},
      {"sweeps", &block_slides, {}},
      {"row_budget", &block_slides, {}},
      {"parts", &block_slides, {}},
      {"longest_part_s", &falls_as_a_pendulum, {0.05}},
      {"good_periods", &goes_on_for_its_period, {0.5, 4.0}},
      {"good_besides_s", &waits_for_the_scheduler, {-1e-3, 50e-3}},
      {"way_out_s", &keeps_the_way_out, {}},
      {"same_contact_cosine", &tells_contacts_apart, {0.1}},
      {"same_plane_cosine", &edge_is_followed, {}},
      {"fast_look_m_s", &is_held_at_speed, {}},
  };
  return kAll;
}

/// Those that do something to be felt outside of their range; the others bound cost.
std::vector<Behaviour> felt_outside() {
  std::vector<Behaviour> out;
  std::copy_if(behaviours().begin(), behaviours().end(), std::back_inserter(out),
               [](const Behaviour& each) { return !each.too_far.empty(); });
  return out;
}

std::string name_of(const testing::TestParamInfo<Behaviour>& row) { return std::string(row.param.name); }

class TunedValueTest : public testing::TestWithParam<Behaviour> {
 protected:
  [[nodiscard]] const TunedValue& row() const {
    return *std::find_if(kTunedValues.begin(), kTunedValues.end(),
                         [](const TunedValue& each) { return each.name == GetParam().name; });
  }
  [[nodiscard]] Tuning with(double value) const {
    Tuning out;
    out.*row().value = value;
    return out;
  }
};

TEST_P(TunedValueTest, LiesInItsRangeAndWorksAtBothEnds) {
  const TunedValue& each = row();
  const double value = Tuning{}.*each.value;
  EXPECT_GE(value, each.least) << each.why;
  EXPECT_LE(value, each.most) << each.why;
  for (const double at : {each.least, value, each.most}) {
    const Tuning tuning = with(at);
    SCOPED_TRACE(std::string(each.name) + " = " + std::to_string(at) + " " + std::string(each.unit));
    EXPECT_TRUE(testing::AssertionResult(GetParam().holds(tuning))) << each.why;
    EXPECT_TRUE(testing::AssertionResult(wall_is_exact(tuning)));
    EXPECT_TRUE(testing::AssertionResult(block_stands(tuning)));
    EXPECT_TRUE(testing::AssertionResult(block_slides(tuning)));
    EXPECT_TRUE(testing::AssertionResult(edge_is_followed(tuning)));
    EXPECT_TRUE(testing::AssertionResult(soft_settles(tuning)));
    EXPECT_TRUE(testing::AssertionResult(pile_bears(tuning)));
    EXPECT_TRUE(testing::AssertionResult(is_not_squeezed_through(tuning)));
  }
}

class TunedValueOutside : public TunedValueTest {};

TEST_P(TunedValueOutside, IsFelt) {
  const TunedValue& each = row();
  for (const double at : GetParam().too_far) {
    EXPECT_TRUE(at < each.least || at > each.most) << at;
    EXPECT_FALSE(testing::AssertionResult(GetParam().holds(with(at))))
        << each.name << " = " << at << " " << each.unit << " would do as well";
  }
}

INSTANTIATE_TEST_SUITE_P(Row, TunedValueTest, testing::ValuesIn(behaviours()), name_of);
INSTANTIATE_TEST_SUITE_P(Row, TunedValueOutside, testing::ValuesIn(felt_outside()), name_of);

TEST(Tuning, HasAtMostTwentyValuesEachWithItsTestAndItsReason) {
  EXPECT_LE(kTunedValues.size(), 20U);
  EXPECT_EQ(sizeof(Tuning), kTunedValues.size() * sizeof(double)) << "a value without a row";
  std::set<std::string_view> names;
  for (const TunedValue& each : kTunedValues) {
    EXPECT_TRUE(names.insert(each.name).second) << each.name;
    EXPECT_LT(each.least, each.most) << each.name;
    EXPECT_FALSE(each.unit.empty() || each.why.empty() || each.source.empty()) << each.name;
    const auto same = [&](const Behaviour& row) { return row.name == each.name; };
    EXPECT_EQ(std::count_if(behaviours().begin(), behaviours().end(), same), 1) << each.name;
  }
}

TEST(Tuning, LooksForContactsAsFarAsASurfaceComesInATick) {
  Tuning none;
  none.recovery_m_s = 0.0;
  EXPECT_EQ(none.reach_m(), 0.0);
  EXPECT_FALSE(testing::AssertionResult(is_not_squeezed_through(none)));
}

}  // namespace tuning_test
