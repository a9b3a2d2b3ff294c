/// The method local_contact tick by tick, as the loop calls it.
#include "haptic_node/rendering/local_contact.hpp"

#include <gtest/gtest.h>

#include <memory>

#include "rtbus/clock.hpp"

namespace {

using rtbus::ProxyContacts;

constexpr double kSpeed_m_s = 0.1;

/// A plate whose material fills x < 0 and which moves along +x, whatever pushes.
ProxyContacts plate(std::uint64_t sample_ns) {
  ProxyContacts out;
  out.device_sequence = 1;
  out.device_time_ns = sample_ns;
  out.step_s = 0.05;
  out.contacts = out.bodies = 1;
  out.contact_normal[0] = {1, 0, 0};
  out.body_kind[0] = 1;
  out.body_velocity_m_s[0] = {kSpeed_m_s, 0, 0};
  return out;
}

// A device that does not answer in time repeats its sample. The world goes on for that tick, and the next new sample
// counts only what is left: a plate that takes the proxy along is where its speed has brought it.
TEST(LocalContact, ARepeatedSampleIsNotCountedTwice) {
  const haptic::Mapping mapping{haptic::MappingConfig{}};
  const auto method = std::make_unique<haptic::LocalContact>(500.0, 0.5, mapping);
  const std::uint64_t began_ns = rtbus::kNsPerS;
  haptic::RenderInput input;
  input.proxy.valid = true;
  input.dt_s = 1e-3;
  haptic::RenderOutput out;
  const auto tick = [&](int sample_ms, const ProxyContacts* answer) {
    input.sample_time_ns = began_ns + static_cast<std::uint64_t>(sample_ms) * rtbus::kNsPerMs;
    input.contacts = answer;
    out = method->render(input);
    method->felt(out.force_n);
  };
  tick(0, nullptr);
  const ProxyContacts answer = plate(began_ns);
  tick(1, &answer);
  for (const int sample_ms : {2, 3, 3, 3, 6, 7, 8, 8, 10, 11, 12}) tick(sample_ms, nullptr);
  EXPECT_NEAR(out.proxy_position_m.x(), kSpeed_m_s * 12e-3, 1e-6);
}

}  // namespace
