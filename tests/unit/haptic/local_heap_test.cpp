/// How a body in a heap is taken to move between two answers.
#include "haptic_node/rendering/local_heap.hpp"

#include <gtest/gtest.h>

#include "haptic_node/rendering/contact_solver.hpp"

namespace {

using Eigen::Vector3d;
using haptic::LocalHeap;

constexpr double kMobility = 0.01, kHand_m_s = 0.02;
const Vector3d kPush(0, 0, -0.5), kSpeed(0, 0, -0.01);

LocalHeap told() {
  LocalHeap heap;
  heap.set_mobility(kMobility);
  heap.learn(kPush, kSpeed, kHand_m_s);
  return heap;
}

TEST(LocalHeap, GoesOnAsItWentUnderTheSamePushAndFasterUnderMore) {
  const LocalHeap heap = told();
  EXPECT_NEAR((heap.way_m(0.1 * kPush, 0.1) - 0.1 * kSpeed).norm(), 0.0, 1e-12);
  EXPECT_NEAR(heap.way_m(0.1 * 1.4 * kPush, 0.1).z(), -0.1 * (0.01 + 0.2 * kMobility), 1e-12);
}

TEST(LocalHeap, DoesNotComeBackWhenThePushGoes) {
  LocalHeap heap = told();
  heap.learn(2.0 * kPush, Vector3d::Zero(), kHand_m_s);
  EXPECT_NEAR(heap.way_m(Vector3d::Zero(), 0.1).norm(), 0.0, 1e-12);
  EXPECT_EQ(heap.advance_m_s({0, 0, 1}), 0.0);
}

TEST(LocalHeap, DoesNotSlideOnAsFastAsItSlipped) {
  LocalHeap heap = told();
  heap.learn(kPush, 20.0 * kSpeed, kHand_m_s);
  EXPECT_NEAR(heap.speed_m_s().norm(), kHand_m_s, 1e-12);
  heap.learn(kPush, 20.0 * kSpeed, 0.0);
  EXPECT_NEAR(heap.speed_m_s().norm(), LocalHeap::kOwnSpeed_m_s, 1e-12);
}

TEST(LocalHeap, ComesToRestWithoutNews) {
  LocalHeap heap = told();
  for (int i = 0; i < 100; ++i) heap.brake(0.9);
  EXPECT_LT(heap.way_m(10.0 * kPush, 0.1).norm(), 1e-5);
}

// The contact solver with such a heap as one side: the proxy and the heap move as the heap's law says, from no push to
// a hard one.
TEST(LocalHeap, IsSolvedWithTheProxyInOneRow) {
  const LocalHeap heap = told();
  constexpr double kH = 1e-3, kMass = 0.01;
  const Vector3d normal(0, 0, 1);
  for (const double towards_m_s : {-0.02, 0.0, 0.01, 0.05, 1.0}) {
    haptic::SolverBody proxy;
    proxy.inverse_mass_per_kg = 1.0 / kMass;
    proxy.velocity_m_s = -towards_m_s * normal;
    haptic::SolverContact row;
    row.normal = normal;
    row.surface_velocity_m_s = heap.free_m_s();
    row.softness_per_kg = heap.mobility_m_s_n() / kH;
    row.advance_m_s = heap.advance_m_s(normal);
    haptic::solve_contacts(&proxy, &row, 1, 12);
    const double impulse = row.impulse_n_s.dot(normal);
    const double surface_m_s = heap.way_m(-row.impulse_n_s, kH).z() / kH;
    if (impulse > 0.0) {
      EXPECT_NEAR(proxy.velocity_m_s.z(), surface_m_s, 1e-9) << towards_m_s;
    } else {
      EXPECT_GE(proxy.velocity_m_s.z(), surface_m_s - 1e-12) << towards_m_s;
    }
    EXPECT_EQ(impulse > 0.0, towards_m_s > 0.0) << towards_m_s;
  }
}

}  // namespace
