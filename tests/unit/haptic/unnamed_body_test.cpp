/// A body that an answer of physics named and the next one does not.
#include <gtest/gtest.h>

#include <memory>

#include "haptic_node/rendering/local_world.hpp"
#include "rtbus/clock.hpp"

namespace {

// Found by the search for the worst physics: a plate that took the proxy along went on for ever.
TEST(UnnamedBody, ComesToRestAlsoIfItMovesWhateverPushes) {
  constexpr double kPlate_m_s = 1.0;
  auto world = std::make_unique<haptic::LocalWorld>();
  std::uint64_t now_ns = rtbus::kNsPerS;
  world->reset(Eigen::Vector3d::Zero(), now_ns);
  rtbus::ProxyContacts answer;
  answer.device_sequence = 1;
  answer.step_s = 1e-3;
  answer.contacts = answer.bodies = 1;
  answer.contact_normal[0] = {1, 0, 0};
  answer.body_kind[0] = 1;
  double force_n = 0.0;
  const auto tick = [&] {
    answer.device_time_ns = now_ns;
    world->take(answer, now_ns);
    now_ns += rtbus::kNsPerMs;
    world->advance({Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), 200.0, 0.5}, now_ns, 1e-3);
    force_n = world->impulse_n_s().norm() / 1e-3;
  };
  for (int i = 0; i < 10; ++i) {
    const double x_m = 1e-3 * i * kPlate_m_s;
    answer.contact_point_m[0] = answer.body_centre_m[0] = {x_m, 0, 0};
    answer.body_velocity_m_s[0] = answer.contact_velocity_m_s[0] = {kPlate_m_s, 0, 0};
    tick();
  }
  ASSERT_GT(force_n, 1.0) << "the plate takes the proxy along";
  answer.contacts = answer.bodies = 0;
  for (int i = 0; i < 300; ++i) tick();
  EXPECT_EQ(force_n, 0.0);
  EXPECT_NEAR(world->position_m().x(), 0.0, 1e-9);
}

}  // namespace
