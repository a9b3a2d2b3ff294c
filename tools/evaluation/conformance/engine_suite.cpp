#include "tools/evaluation/conformance/engine_suite.hpp"

#include <cstdio>
#include <limits>
#include <random>

#include "rtbus/eigen.hpp"

namespace tools {

namespace {

using Eigen::Vector3d;
using rtbus::ProxyState;
using rtbus::vector_of;

constexpr int kTries = 5;
constexpr double kPress_m = 0.01;  // beyond touching
constexpr double kFar_m = 0.12;    // a tool that begins 46 mm from its target must never get so far from the origin

bool finite(const ProxyState& state) {
  return vector_of(state.position_m).allFinite() && vector_of(state.velocity_m_s).allFinite() &&
         vector_of(state.contact_force_n).allFinite() && vector_of(state.coupling_force_n).allFinite();
}

std::string text_of_step(double step_s) {
  char text[32];
  std::snprintf(text, sizeof text, "%gms", 1e3 * step_s);
  return text;
}

}  // namespace

EngineSuite::EngineSuite(const EngineFile& engine, Experiment& experiment, double step_s, const std::string& bodies)
    : file_(engine),
      bars_(engine.tolerances),
      experiment_(experiment),
      engine_(engine, {step_s, bodies, experiment.folder().string()}),
      step_s_(step_s),
      tag_("." + text_of_step(step_s)) {}

void EngineSuite::run(const std::function<void()>& one) {
  for (int tries = 1;; ++tries) {
    try {
      one();
      return;
    } catch (const HandPaused&) {
      if (tries == kTries) throw;
    }
  }
}

void EngineSuite::free_air() {
  const double floor = floor_m();
  begin({0, floor + 0.1, 0});
  const Vector3d target(0.05, floor + 0.15, -0.02);
  const ProxyState last = hold({target}, steps(3.0));
  const double off_m = (vector_of(last.position_m) - target).norm();
  const double force_n = vector_of(last.coupling_force_n).norm();
  experiment_.check_at_most("free_air" + tag_, "tool from its target in free air", off_m, "m", bars_.free_m);
  experiment_.check_at_most("free_force" + tag_, "force of its spring there", force_n, "N", bars_.free_force_n);
}

void EngineSuite::follows() {
  const double y = floor_m() + 0.2;  // above the ball
  begin({0, y, 0});
  ProxyState last;
  OutsideHand hand{{0, y, 0}, {0.1, 0, 0}};
  for (int i = 1; i <= steps(1.0); ++i) {
    hand.target_m.x() = 0.1 * step_s_ * i;
    last = engine_.step(hand);
  }
  const double off_m = (vector_of(last.position_m) - hand.target_m).norm();
  experiment_.check_at_most("follows" + tag_, "tool behind a hand at 0.1 m/s in free air", off_m, "m", bars_.free_m);
}

void EngineSuite::wall() {
  const double touching = floor_m() + kToolRadius_m;
  begin({0, floor_m() + 0.05, 0});
  const ProxyState last = hold({{0, touching - kPress_m, 0}}, steps(2.0));
  const double force_n = kToolStiffness_n_per_m * kPress_m;
  experiment_.check_at_most("wall_depth" + tag_, "tool inside a wall, 10 mm beyond touching",
                            std::abs(last.position_m[1] - touching), "m", bars_.depth_m);
  experiment_.check_at_most("wall_force" + tag_, "force of the wall, share off",
                            std::abs(last.contact_force_n[1] / force_n - 1.0), "", bars_.force_share);
  experiment_.check_at_least("wall_contacts" + tag_, "contacts told there", last.contacts, "", 1.0);
}

void EngineSuite::does_not_tunnel() {
  begin({0, floor_m() + 0.5, 0});
  double deepest_m = 0.0;
  for (int i = 0; i < 20; ++i) {
    const ProxyState now = engine_.step({{0, floor_m() - 1.0, 0}, Vector3d::Zero(), 2000.0});
    deepest_m = std::max(deepest_m, floor_m() + kToolRadius_m - now.position_m[1]);
  }
  experiment_.check_at_most("tunnel" + tag_, "tool inside a wall, pulled at 2000 N/m over 1 m", deepest_m, "m",
                            bars_.hard_depth_m);
}

void EngineSuite::momentum() {
  const double floor = floor_m();
  const double wide_m = file_.reads_scenes ? 0.12 : 0.03;
  begin({0, floor + 0.1, 0});
  double worst_n = 0.0;
  Vector3d before = Vector3d::Zero();
  for (int i = 0; i < steps(3.0); ++i) {
    const double t = i * step_s_;
    const ProxyState now =
        engine_.step({{wide_m * std::sin(3 * t), floor + 0.03 * std::cos(5 * t), 0.03 * std::sin(2 * t)}});
    const Vector3d velocity = vector_of(now.velocity_m_s);
    const Vector3d told_n = vector_of(now.coupling_force_n) + vector_of(now.contact_force_n);
    worst_n = std::max(worst_n, (kToolMass_kg * (velocity - before) / step_s_ - told_n).norm());
    before = velocity;
  }
  experiment_.check_at_most("momentum" + tag_, "m dv/dt of the tool against the forces told, worst step", worst_n, "N",
                            bars_.momentum_n);
}

void EngineSuite::friction() {
  const double mu = kToolFriction * (file_.reads_scenes ? 0.5 : file_.floor_friction);
  const double y = floor_m() + kToolRadius_m - kPress_m;
  begin({0, floor_m() + kToolRadius_m, 0});
  (void)hold({{0, y, 0}}, steps(1.0));
  double above = 0.0, last = 0.0;
  for (int i = 0; i < steps(1.5); ++i) {
    const ProxyState now = engine_.step({{0.02 * step_s_ * i, y, 0}});
    const Vector3d& force = vector_of(now.contact_force_n);
    last = std::hypot(force.x(), force.z()) / force.y();
    above = std::max(above, last / mu - 1.0);
  }
  experiment_.check_at_most("friction_cone" + tag_, "friction above the coefficient, share", above, "",
                            bars_.friction_share);
  experiment_.check_at_most("friction_used" + tag_, "friction below the coefficient while it slides, share",
                            1.0 - last / mu, "", bars_.slip_share);
}

void EngineSuite::reset() {
  begin({0, floor_m() + 0.05, 0});
  (void)hold({{0.3, floor_m() - 0.2, 0}, Vector3d::Zero(), 2000.0}, 30);
  const Vector3d place(0.02, floor_m() + 0.2, 0.1);
  begin(place);
  double off_m = 0.0, force_n = 0.0;
  for (int i = 0; i < 50; ++i) {
    const ProxyState now = engine_.step({place});
    off_m = std::max(off_m, (vector_of(now.position_m) - place).norm());
    force_n = std::max(force_n, vector_of(now.coupling_force_n).norm());
  }
  experiment_.check_at_most("reset" + tag_, "tool from where a reset puts it", off_m, "m", bars_.free_m);
  experiment_.check_at_most("reset_force" + tag_, "force of its spring there", force_n, "N", bars_.free_force_n);
}

void EngineSuite::stiffnesses() {
  double farthest_m = 0.0;
  for (const double stiffness : {10.0, 200.0, 2000.0, 20000.0}) {
    begin({0, floor_m() + 0.05, 0});
    for (int i = 0; i < 200; ++i) {
      const ProxyState now = engine_.step({{0.02, floor_m() + kToolRadius_m - 0.005, 0}, Vector3d::Zero(), stiffness});
      const double far_m = finite(now) ? (vector_of(now.position_m) - Vector3d(0, floor_m(), 0)).norm()
                                       : std::numeric_limits<double>::infinity();
      farthest_m = std::max(farthest_m, far_m);
    }
  }
  experiment_.check_at_most("stable" + tag_, "farthest way of a tool 46 mm from its target, 10…20 000 N/m", farthest_m,
                            "m", kFar_m);
}

void EngineSuite::hostile() {
  double bad = 0.0;
  for (const double p : {0.0, 1e-300, -1.0, 1.0}) {  // a metre in a step; more is refused by the library
    for (const double stiffness : {1e-3, 2e5}) {
      for (int i = 0; i < 3; ++i) {
        bad += finite(engine_.step({{p, -p, p}, {-p, p, p}, stiffness})) ? 0.0 : 1.0;
      }
    }
  }
  begin({0, floor_m() + 0.1, 0});
  const Vector3d target(0, floor_m() + 0.2, 0);
  const ProxyState last = hold({target}, steps(3.0));
  experiment_.check_between("hostile" + tag_, "answers to absurd targets that are not finite", bad, "", 0.0, 0.0);
  experiment_.check_at_most("usable" + tag_, "tool from its target after them",
                            (vector_of(last.position_m) - target).norm(), "m", bars_.free_m);
}

void EngineSuite::leaves() {
  const bool ball = file_.reads_scenes;
  begin(ball ? Vector3d(0.1, 0.05, 0) : Vector3d(0, floor_m(), 0));
  const Vector3d target(ball ? 0.1 : 0.0, floor_m() + 0.2, 0);
  const ProxyState last = hold({target}, steps(5.0));
  experiment_.check_at_most("leaves" + tag_, "tool from its target, begun inside a body",
                            (vector_of(last.position_m) - target).norm(), "m", 1e-3);
}

std::array<double, 9> EngineSuite::wander() {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> u(-0.15, 0.15);
  begin({0, floor_m() + 0.1, 0});
  ProxyState last;
  for (int i = 0; i < 500; ++i) {
    const double x = u(random), y = u(random), z = u(random);
    last = engine_.step({{x, floor_m() + y, z}, Vector3d::Zero(), 800.0});
  }
  std::array<double, 9> out{};
  std::copy_n(last.position_m.begin(), 3, out.begin());
  std::copy_n(last.velocity_m_s.begin(), 3, out.begin() + 3);
  std::copy_n(last.contact_force_n.begin(), 3, out.begin() + 6);
  return out;
}

void EngineSuite::contacts() {
  struct Place {
    Vector3d from, normal;  // a point of the surface
    std::uint32_t body;
    double corner;  // share of a rounded edge's radius that the surface lies deeper
  };
  const double floor = floor_m();
  std::vector<Place> places{{{0, floor, 0.3}, {0, 1, 0}, 0, 0.0}};
  if (file_.reads_scenes) {
    const Vector3d ball(0.1, 0.05, 0), block(-0.1, 0.05, 0);
    places.push_back({ball + Vector3d(0.05, 0, 0), {1, 0, 0}, 1, 0.0});
    places.push_back({ball + 0.05 * Vector3d(0.6, 0.8, 0), {0.6, 0.8, 0}, 1, 0.0});
    places.push_back({block + Vector3d(0.01, 0.05, -0.02), {0, 1, 0}, 2, 0.0});
    places.push_back({block + Vector3d(-0.05, 0.05, 0), Vector3d(-1, 1, 0).normalized(), 2, std::sqrt(2.0) - 1.0});
    places.push_back({block + Vector3d(-0.05, 0.05, 0.05), Vector3d(-1, 1, 1).normalized(), 2, std::sqrt(3.0) - 1.0});
  }
  double missing = 0.0, gap_m = 0.0, normal = 0.0, point_m = 0.0, other = 0.0;
  begin({0, floor + 0.3, 0});
  for (const Place& place : places) {
    for (const double far_m : {-0.0005, 0.0005, 0.004}) {
      OutsideHand hand{place.from + (kToolRadius_m + far_m) * place.normal};
      hand.placed = true;
      for (int i = 0; i < 3; ++i) (void)engine_.step(hand);
      const rtbus::ProxyContacts told = engine_.contacts();
      if (told.contacts != 1 || told.bodies != 1 || told.body_index[0] != place.body) {
        missing += 1.0;
        continue;
      }
      const double truth_m = far_m + place.corner * bars_.rounded_edge_m;
      const Vector3d n = vector_of(told.contact_normal[0]);
      gap_m = std::max(gap_m, std::abs(told.contact_gap_m[0] - truth_m));
      normal = std::max(normal, (n - place.normal).norm());
      const Vector3d surface = hand.target_m - (kToolRadius_m + truth_m) * place.normal;
      point_m = std::max(point_m, (vector_of(told.contact_point_m[0]) - surface).norm());
      const double mu = kToolFriction * (file_.reads_scenes ? 0.5 : file_.floor_friction);
      other = std::max({other, std::abs(told.contact_friction[0] - mu), double(told.body_kind[0]),
                        told.body_inverse_mass_per_kg[0], vector_of(told.contact_velocity_m_s[0]).norm()});
    }
  }
  experiment_.check_between("contacts" + tag_, "places where not exactly the one contact is told", missing, "", 0, 0);
  experiment_.check_at_most("contact_gap" + tag_, "gap of a contact", gap_m, "m", bars_.gap_m);
  experiment_.check_at_most("contact_point" + tag_, "point of a contact", point_m, "m", 5.0 * bars_.gap_m);
  experiment_.check_at_most("contact_normal" + tag_, "normal of a contact", normal, "", bars_.normal);
  experiment_.check_at_most("contact_rest" + tag_, "friction, kind, mass and speed of what never moves", other, "",
                            1e-6);
}

void EngineSuite::push() {
  begin({0, 0.02, 0.02 + kToolRadius_m});
  OutsideHand hand{{0, 0.02, 0.02 + kToolRadius_m + 0.001}};
  hand.placed = true;
  hand.pushed_body = 1;
  for (int i = 0; i < 20; ++i) (void)engine_.step(hand);
  const int count = std::max(1, static_cast<int>(std::lround(0.2 / step_s_)));
  for (int i = 0; i < count; ++i) {
    hand.impulse_n_s.z() -= 0.5 * step_s_;
    (void)engine_.step(hand);
  }
  // The tool stays near, so that the body is told: that has gone 20 to 22 mm.
  hand.target_m.z() -= 0.020;
  (void)engine_.step(hand);
  const rtbus::ProxyContacts told = engine_.contacts();
  const bool there = told.bodies > 0;
  double speed = 0.0, load_n = std::numeric_limits<double>::infinity();
  for (std::uint32_t i = 0; i < told.bodies; ++i) {
    if (told.body_index[i] != 1) continue;
    speed = -told.body_velocity_m_s[i][2];
    load_n = vector_of(told.body_external_force_n[i]).norm();
  }
  const double truth_m_s = 0.5 * step_s_ * count / 0.5;
  experiment_.check_between("push_seen" + tag_, "bodies near the tool", there ? 1.0 : 0.0, "", 1, 1);
  experiment_.check_at_most("push" + tag_, "speed of a body pushed by 0.5 N, share off",
                            std::abs(speed / truth_m_s - 1.0), "", bars_.force_share);
  experiment_.check_at_most("push_load" + tag_, "gravity and the floor's force on it, told together", load_n, "N",
                            bars_.force_share * 0.5 * 9.81);
}

}  // namespace tools
