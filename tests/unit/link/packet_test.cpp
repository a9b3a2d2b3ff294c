// What a link packs comes out unchanged, fits a datagram, and nothing that is broken comes out at all.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <span>

#include "tools/link/packet.hpp"

namespace {

using namespace link_dds;

template <class T>
bool same_bytes(const T& a, const T& b) {
  return std::ranges::equal(std::as_bytes(std::span(&a, 1)), std::as_bytes(std::span(&b, 1)));
}

/// A pile: `contacts` contacts, each with a body of its own that lies on `supports` others. Every number is another
/// one.
rtbus::ProxyContacts pile(std::uint32_t contacts, std::uint32_t supports) {
  rtbus::ProxyContacts out;
  out.step_index = 7;
  out.radius_m = 0.01;
  out.contacts = out.bodies = contacts;
  for (std::uint32_t i = 0; i < contacts; ++i) {
    const double x = 1.0 + i;
    out.contact_body[i] = i;
    out.contact_gap_m[i] = 1e-3 * x;
    out.contact_point_m[i] = {x, 2 * x, 3 * x};
    out.contact_normal[i] = {0.6, 0.8, 0.01 * x};
    out.contact_velocity_m_s[i] = {x, x, x};
    out.contact_friction[i] = 0.5;
    out.contact_inverse_mass_per_kg[i] = {x, x, x, x, x, x};
    out.body_index[i] = 100 + i;
    out.body_kind[i] = 2;
    out.body_centre_m[i] = {x, x, x};
    out.body_velocity_m_s[i] = {x, x, x};
    out.body_inverse_mass_per_kg[i] = x;
    out.body_inverse_inertia_per_kg_m2[i] = {x, x, x, x, x, x};
    out.body_external_force_n[i] = {x, x, x};
    for (std::uint32_t k = 0; k < supports && out.supports < rtbus::kSupportSlots; ++k) {
      const std::uint32_t row = out.supports++;
      out.support_body[row] = i;
      out.support_force_n[row] = x + k;
      out.support_point_m[row] = {x, x + k, x};
      out.support_normal[row] = {0.0, 1.0, 0.0};
    }
  }
  return out;
}

Answer answer_with(const rtbus::ProxyContacts& contacts) {
  Answer out;
  out.beat.beats = 3;
  out.beat.pid = 4;
  out.beat_age_ns = 5;
  out.proxy.emplace().position_m = {1.0, 2.0, 3.0};
  out.proxy->step_index = contacts.step_index;
  out.contacts = contacts;
  return out;
}

TEST(LinkPacket, AHandComesOutAsItWentIn) {
  rtbus::DeviceState state;
  state.target_position_m = {0.1, -0.2, 0.3};
  state.sample_time_ns = 123456789;
  state.wants = rtbus::kWantsContacts;
  state.hand_impulse_n_s[2] = {1.0, 2.0, 3.0};
  const Bytes bytes = pack_hand(state, 42);
  EXPECT_LT(bytes.size(), sizeof state);
  const auto out = unpack_hand(bytes);
  ASSERT_TRUE(out);
  EXPECT_EQ(out->device_sequence, 42u);
  EXPECT_TRUE(same_bytes(out->state, state));
}

TEST(LinkPacket, ABlockOnTheFloorFitsWhole) {
  const Answer answer = answer_with(pile(2, 4));
  Bytes bytes;
  const LeftOut left = pack_answer(answer, bytes, 4 * kMostBody_bytes);
  EXPECT_EQ(left.contacts + left.supports, 0u);
  const auto out = unpack_answer(bytes);
  ASSERT_TRUE(out && out->proxy && out->contacts);
  EXPECT_TRUE(same_bytes(*out->contacts, *answer.contacts));
  EXPECT_TRUE(same_bytes(*out->proxy, *answer.proxy));
  EXPECT_TRUE(same_bytes(out->beat, answer.beat));
  EXPECT_EQ(out->beat_age_ns, 5u);
}

TEST(LinkPacket, OfAPileTheNearestFitIntoOneDatagramAndTheRestIsCounted) {
  for (const std::uint32_t contacts : {1u, 2u, 3u, 5u, 16u}) {
    for (const std::uint32_t supports : {0u, 1u, 4u, 12u, 32u}) {
      const rtbus::ProxyContacts whole = pile(contacts, supports);
      Bytes bytes;
      const LeftOut left = pack_answer(answer_with(whole), bytes);
      EXPECT_LE(bytes.size(), kMostBody_bytes);
      const auto out = unpack_answer(bytes);
      ASSERT_TRUE(out && out->contacts);
      const rtbus::ProxyContacts& part = *out->contacts;
      EXPECT_GE(part.contacts, 1u);
      EXPECT_EQ(part.contacts + left.contacts, contacts);
      EXPECT_EQ(part.contacts_overflow, left.contacts);
      EXPECT_EQ(part.supports_overflow, left.supports);
      for (std::uint32_t i = 0; i < part.contacts; ++i) {  // the nearest, each with its own body
        EXPECT_EQ(part.contact_gap_m[i], whole.contact_gap_m[i]);
        ASSERT_LT(part.contact_body[i], part.bodies);
        EXPECT_EQ(part.body_index[part.contact_body[i]], whole.body_index[whole.contact_body[i]]);
      }
      for (std::uint32_t i = 0; i < part.supports; ++i) {
        ASSERT_LT(part.support_body[i], part.bodies);
        EXPECT_EQ(part.support_point_m[i][0], part.body_centre_m[part.support_body[i]][0]);
      }
      EXPECT_TRUE(rtbus::SampleTraits<rtbus::ProxyContacts>::sane(part, 1));
    }
  }
}

/// Of `bodies`, each holds the next one; the proxy touches body `touched`.
rtbus::ProxyContacts row_of(std::uint32_t bodies, std::uint32_t touched) {
  rtbus::ProxyContacts out = pile(bodies, 1);
  const rtbus::ProxyContacts one = pile(1, 1);
  out.contacts = 1;
  out.contact_point_m = one.contact_point_m;
  out.contact_normal = one.contact_normal;
  out.contact_gap_m = one.contact_gap_m;
  out.contact_velocity_m_s = one.contact_velocity_m_s;
  out.contact_friction = one.contact_friction;
  out.contact_inverse_mass_per_kg = one.contact_inverse_mass_per_kg;
  out.contact_body = {touched};
  for (std::uint32_t i = 1; i < bodies; ++i) {
    const std::uint32_t pair = out.supports++;
    out.support_body[pair] = i - 1;
    out.support_holder[pair] = i + 1;
    out.support_inverse_mass_per_kg[pair] = 1.0 + i;  // as the row of what holds
    out.support_point_m[pair] = {static_cast<double>(i), 0.0, 0.0};
    out.support_normal[pair] = {0.0, 0.0, 1.0};
  }
  return out;
}

// Bodies that are told together go together, whichever of them is touched: each alone would be a pile, and a support
// without its holder makes no sense.
TEST(LinkPacket, BodiesThatAreToldTogetherStayTogether) {
  for (const std::uint32_t bodies : {2u, 6u}) {
    for (std::uint32_t touched = 0; touched < bodies; ++touched) {
      const rtbus::ProxyContacts whole = row_of(bodies, touched);
      Bytes bytes;
      EXPECT_EQ(pack_answer(answer_with(whole), bytes, 4 * kMostBody_bytes).supports, 0u);
      const auto out = unpack_answer(bytes);
      ASSERT_TRUE(out && out->contacts);
      EXPECT_TRUE(same_bytes(*out->contacts, whole)) << touched;
    }
  }
}

// Where they do not fit, the touched one is told alone, on what gives way.
TEST(LinkPacket, ARowThatDoesNotFitIsAPile) {
  for (std::uint32_t touched = 0; touched < 6; ++touched) {
    const rtbus::ProxyContacts whole = row_of(6, touched);
    Bytes bytes;
    (void)pack_answer(answer_with(whole), bytes);
    EXPECT_LE(bytes.size(), kMostBody_bytes);
    const auto out = unpack_answer(bytes);
    ASSERT_TRUE(out && out->contacts);
    const rtbus::ProxyContacts& part = *out->contacts;
    ASSERT_TRUE(rtbus::SampleTraits<rtbus::ProxyContacts>::sane(part, 1));
    ASSERT_EQ(part.contacts, 1u);
    EXPECT_EQ(part.body_index[part.contact_body[0]], whole.body_index[touched]);
    EXPECT_GE(part.supports, touched < 5 ? 2u : 1u) << "floor, and the next one";
    for (std::uint32_t i = 0; i < part.supports; ++i) EXPECT_LE(part.support_holder[i], part.bodies);
  }
}

TEST(LinkPacket, BrokenBytesComeOutAsNothing) {
  Bytes good;
  (void)pack_answer(answer_with(pile(2, 4)), good);
  for (std::size_t size = 0; size < good.size(); ++size) {
    EXPECT_FALSE(unpack_answer(std::span(good).first(size))) << size;
  }
  Bytes longer = good;
  longer.push_back(0);
  EXPECT_FALSE(unpack_answer(longer));
  Bytes unknown = good;
  unknown[0] = 0xff;
  EXPECT_FALSE(unpack_answer(unknown));
  std::mt19937 random(5);
  for (int i = 0; i < 20000; ++i) {  // never more than is there
    Bytes noise(random() % 1500);
    for (std::uint8_t& byte : noise) byte = static_cast<std::uint8_t>(random());
    (void)unpack_answer(noise);
    (void)unpack_hand(noise);
  }
}

}  // namespace
