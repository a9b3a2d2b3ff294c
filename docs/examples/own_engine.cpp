// Physics of your own in C++ (or C: only the C interface is used): a cart of 0.5 kg on a rail, which the hand pushes
// along z. Serves remote_virtual_coupling and local_contact. Started by `rtbus run own_engine.yaml`.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "rtbus_engine.h"

namespace {

constexpr double kMass_kg = 0.5, kDrag_n_s_per_m = 0.5, kHalf_m = 0.02, kFriction = 0.1;

template <class T>
T sized() {
  T out{};
  out.struct_bytes = sizeof out;
  return out;
}

/// The cart: its front face is at z + kHalf_m, and the tool comes from there.
struct Cart {
  double z_m = -kHalf_m, speed_m_s = 0.0;
};

/// One step of the tool on its implicit spring, solved together with the cart; both are moved.
rtbus_engine_tool pushed(const rtbus_engine_hand& hand, std::array<double, 3>& x, std::array<double, 3>& v, Cart& cart,
                         double h) {
  rtbus_engine_tool tool = sized<rtbus_engine_tool>();
  const double b = hand.damping_n_s_per_m, k = hand.stiffness_n_per_m;
  const double tool_kg = hand.mass_kg + h * b + h * h * k;  // what a contact meets: the spring is implicit
  for (int i = 0; i < 3; ++i) {
    if (hand.reset != 0) x[i] = hand.target_position_m[i], v[i] = 0.0;
    const double pull = k * (hand.target_position_m[i] - x[i]) + b * hand.target_velocity_m_s[i] + hand.force_n[i];
    v[i] = (hand.mass_kg * v[i] + h * pull) / tool_kg;
  }
  const double gap = x[2] - hand.radius_m - (cart.z_m + kHalf_m);
  // > 0: they would overlap after the step. What overlaps already parts at 0.2 m/s at most.
  const double closing_m_s = cart.speed_m_s - v[2] + std::min(-gap / h, 0.2);
  if (closing_m_s > 0.0) {
    const double impulse = closing_m_s / (1.0 / tool_kg + 1.0 / kMass_kg);
    v[2] += impulse / tool_kg;
    cart.speed_m_s -= impulse / kMass_kg;
    tool.contact_force_n[2] = impulse / h;
    tool.contacts = 1;
  }
  for (int i = 0; i < 3; ++i) {
    x[i] += h * v[i];
    tool.position_m[i] = x[i];
    tool.velocity_m_s[i] = v[i];
  }
  return tool;
}

int failed(const char* what) {
  std::fprintf(stderr, "own_engine: %s: %s\n", what, rtbus_engine_last_error());
  return 1;
}

}  // namespace

int main() {
  rtbus_engine_options options = sized<rtbus_engine_options>();
  options.gives = RTBUS_GIVES_BODIES;
  rtbus_engine* engine = nullptr;
  if (const int status = rtbus_engine_open(&options, &engine); status < 0) {
    failed("open");
    return status == RTBUS_ENGINE_E_CONFIG ? 2 : 1;  // 2: another start would not change it
  }
  Cart cart;
  std::array<double, 3> x{}, v{};
  rtbus_engine_step step = sized<rtbus_engine_step>();
  int status = 0;
  while ((status = rtbus_engine_begin(engine, &step)) >= 0) {
    if (step.due == 0) continue;
    const double h = step.step_s;
    rtbus_engine_hand hand = sized<rtbus_engine_hand>();
    if (rtbus_engine_get_hand(engine, 0, &hand) < 0) return failed("hand");
    cart.speed_m_s /= 1.0 + h * kDrag_n_s_per_m / kMass_kg;
    if (hand.tool == RTBUS_TOOL_SPRING) {
      const rtbus_engine_tool tool = pushed(hand, x, v, cart, h);
      if (rtbus_engine_set_tool(engine, 0, &tool) < 0) return failed("tool");
    }
    for (unsigned i = 0; i < hand.pushes; ++i) cart.speed_m_s += h * hand.push[i].force_n[2] / kMass_kg;
    cart.z_m += h * cart.speed_m_s;

    rtbus_engine_body body = sized<rtbus_engine_body>();
    body.kind = RTBUS_BODY_DYNAMIC;
    body.position_m[1] = kHalf_m;
    body.position_m[2] = cart.z_m;
    body.velocity_m_s[2] = cart.speed_m_s;
    body.mass_kg = kMass_kg;
    body.external_force_n[2] = -kDrag_n_s_per_m * cart.speed_m_s;
    std::fill_n(body.inertia_kg_m2, 3, 1e3);  // the rail keeps it from turning
    if (rtbus_engine_set_body(engine, 0, &body) < 0) return failed("body");
    const double gap = hand.target_position_m[2] - hand.radius_m - (cart.z_m + kHalf_m);
    if (hand.tool == RTBUS_TOOL_PLACED && gap < hand.contact_reach_m) {
      rtbus_engine_contact contact = sized<rtbus_engine_contact>();
      contact.point_m[0] = hand.target_position_m[0];
      contact.point_m[1] = body.position_m[1];  // at the height of its centre
      contact.point_m[2] = cart.z_m + kHalf_m;
      contact.normal[2] = 1.0;
      contact.gap_m = gap;
      contact.friction = kFriction * hand.friction;
      if (rtbus_engine_add_contact(engine, 0, &contact) < 0) return failed("contact");
    }
    if (rtbus_engine_finish(engine) < 0) return failed("finish");
  }
  const bool ended = status == RTBUS_ENGINE_E_ENDED;
  if (!ended) failed("begin");
  rtbus_engine_close(engine);
  return ended ? 0 : (status == RTBUS_ENGINE_E_CONFIG ? 2 : 1);
}
