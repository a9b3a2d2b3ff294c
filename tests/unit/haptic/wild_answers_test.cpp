// Answers of physics whose figures are finite, within the limits of sane_sample, and make no sense: whatever the world
// of local_contact makes of them, what the loop tells physics stays sane, and honest answers end it.
#include <gtest/gtest.h>

#include <cstring>
#include <random>

#include "haptic_node/rendering/local_contact.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/sample.hpp"

namespace wild_answers_test {

using Eigen::Vector3d;
using rtbus::ProxyContacts;

constexpr double kStiffness = 500.0, kDepth_m = 0.002, kRadius_m = 0.001, kMost_n = 8.0;

/// What the loop knows: the wall as a plane, and the body as a box.
haptic::KnownShapes known(bool hull) {
  using rtbus::shapes::Box;
  using rtbus::shapes::Hull;
  using rtbus::shapes::KnownShape;
  using rtbus::shapes::Plane;
  const auto unturned = Eigen::Quaterniond::Identity();
  KnownShape body{Box{Vector3d(0.01, 0.01, 0.01)}, 1, false};
  if (hull) {
    Hull points;
    for (const double x : {-0.01, 0.01}) {
      for (const double y : {-0.01, 0.01}) {
        for (const double z : {-0.01, 0.01}) points.points_m.emplace_back(x, y, z);
      }
    }
    body.shape = points;
  }
  return {{KnownShape{Plane{}, 2, true, unturned, Vector3d(0, -0.01, 0)},
           KnownShape{Box{Vector3d(0.03, 0.01, 0.02)}, 3, true, unturned, Vector3d(0.05, -0.02, 0)}, body}};
}

/// A wall at y = 0, a body of 0.1 kg beside it on the same plane, and what holds it.
ProxyContacts honest(std::uint64_t sample_ns) {
  ProxyContacts out;
  out.device_sequence = out.step_index = 1;
  out.device_time_ns = sample_ns;
  out.step_s = 0.01;
  out.contacts = out.bodies = 2;
  out.supports = 1;
  out.proxy_radius_m = kRadius_m;
  for (std::size_t row = 0; row < 2; ++row) {
    out.contact_body[row] = out.body_index[row] = static_cast<std::uint32_t>(row);
    out.contact_normal[row] = {0, 1, 0};
    out.contact_friction[row] = 0.3;
  }
  out.contact_point_m[1] = out.body_centre_m[1] = {0.05, 0, 0};
  out.contact_gap_m[1] = 0.05;
  out.body_kind[1] = 2;
  out.body_inverse_mass_per_kg[1] = 10.0;
  out.body_inverse_inertia_per_kg_m2[1] = {1e5, 0, 0, 1e5, 0, 1e5};
  out.body_orientation_wxyz[1] = {1, 0, 0, 0};
  out.body_external_force_n[1] = {0, -1, 0};
  out.support_body[0] = 1;
  out.support_normal[0] = {0, 1, 0};
  out.support_point_m[0] = {0.05, -0.01, 0};
  out.support_points[0] = 4;
  return out;
}

/// Some of its figures, anywhere, become what the limits allow.
ProxyContacts wild(std::uint64_t sample_ns, std::mt19937_64& random) {
  constexpr double kFigures[] = {0.0, -1.1, 1.1, 1e-300, 1e-15, -1e-9, 1e-3, -1.0, 3e3, -1e6, 1e6, 1e9, -1e9, 1e15};
  constexpr std::size_t kFirst = offsetof(ProxyContacts, step_s) / sizeof(double);
  constexpr std::size_t kWords = sizeof(ProxyContacts) / sizeof(double) - kFirst;
  ProxyContacts out = honest(sample_ns);
  for (auto left = 1 + random() % 40; left > 0; --left) {
    ProxyContacts next = out;
    const double figure = kFigures[random() % std::size(kFigures)];
    std::memcpy(reinterpret_cast<char*>(&next) + (kFirst + random() % kWords) * sizeof(double), &figure, sizeof figure);
    next.contacts = static_cast<std::uint32_t>(1 + random() % 2);
    if (rtbus::SampleTraits<ProxyContacts>::sane(next, sample_ns)) out = next;
  }
  if (random() % 2 == 0) {
    const auto draw = [&random] { return static_cast<double>(random() % 2001) / 1000.0 - 1.0; };
    const Eigen::Vector4d q = Eigen::Vector4d(draw(), draw(), draw(), draw() + 1e-9).normalized();
    out.body_orientation_wxyz[1] = {q[0], q[1], q[2], q[3]};
  }
  // Often where it is looked at.
  if (random() % 2 == 0) out.body_kind[random() % 2] = static_cast<std::uint32_t>(random() % 3);
  return out;
}

TEST(WildAnswers, LeaveNothingInWhatPhysicsIsTold) {
  std::mt19937_64 random(20);
  const haptic::Mapping mapping{haptic::MappingConfig{}};
  for (int round = 0; round < 400; ++round) {
    haptic::LocalContact method(kStiffness, 0.5, mapping,
                                round % 2 == 0 ? haptic::KnownShapes{} : known(round % 4 == 1));
    std::uint64_t now_ns = rtbus::kNsPerS;
    Vector3d felt_n = Vector3d::Zero();
    haptic::RenderInput input;
    input.proxy.valid = true;
    input.dt_s = 1e-3;
    const auto tick = [&](const ProxyContacts* answer, double y_m) {
      now_ns += rtbus::kNsPerMs;
      input.sample_time_ns = now_ns;
      input.position_m = {0, y_m, 0};
      input.contacts = answer;
      const haptic::RenderOutput out = method.render(input);
      felt_n = !out.force_n.allFinite()       ? Vector3d(Vector3d::Zero())
               : out.force_n.norm() > kMost_n ? Vector3d(out.force_n.normalized() * kMost_n)
                                              : out.force_n;
      method.felt(felt_n);
      rtbus::DeviceState told;
      method.tell(told);
      told.orientation_wxyz = told.target_orientation_wxyz = {1, 0, 0, 0};
      ASSERT_TRUE(rtbus::SampleTraits<rtbus::DeviceState>::sane(told, now_ns)) << "round " << round;
    };
    for (int i = 0; i < 20; ++i) {
      const ProxyContacts answer = wild(now_ns, random);
      for (int k = 0; k < 5; ++k) ASSERT_NO_FATAL_FAILURE(tick(k == 0 ? &answer : nullptr, 0.001 - 1e-4 * i));
    }
    // One second of honest answers.
    for (int i = 0; i < 1000; ++i) {
      const ProxyContacts answer = honest(now_ns);
      ASSERT_NO_FATAL_FAILURE(tick(i % 10 == 0 ? &answer : nullptr, i < 20 ? 0.01 : -kDepth_m));
    }
    ASSERT_NEAR(felt_n.y(), kStiffness * (kDepth_m + kRadius_m), 0.01) << "round " << round;
  }
}

}  // namespace wild_answers_test
