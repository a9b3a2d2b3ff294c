/// draw_case(): what a number stands for.
#include <algorithm>
#include <array>
#include <cmath>

#include "haptic_node/rendering/registry.hpp"
#include "tools/evaluation/stability/stability_case.hpp"

namespace tools {

namespace {

constexpr double kDeviceMassKg = 0.041;                    // of phantom_desktop
constexpr double kSoftNPerM = 100.0, kStiffNPerM = 700.0;  // the presets light and firm
constexpr double kPressForceN = 1.6;                       // standing still; above 1.75 N the motors get too warm
constexpr double kMaxFallMS = 10.0;

double critical_damping(double stiffness) { return 2.0 * std::sqrt(stiffness * kDeviceMassKg); }

void draw_envelope(Random& random, StabilityCase& out) {
  using E = StabilityEnvelope;
  out.envelope = true;
  out.stiffness_n_per_m = random.log_between(10.0, E::kMaxStiffnessNPerM);
  out.damping_n_s_per_m =
      random.chance(0.3) ? 0.0 : random.log_between(0.01, 1.5 * critical_damping(out.stiffness_n_per_m));
  out.physics_hz = random.log_between(E::kMinPhysicsHz, E::kMaxPhysicsHz);
  out.proxy_kg = random.log_between(0.001, E::kMaxMassRatio * kDeviceMassKg);
  out.body_ratio = random.log_between(1.0 / E::kMaxMassRatio, E::kMaxMassRatio);
  out.friction = random.between(0.0, 2.0);
  out.speed_m_s = random.log_between(0.02, E::kMaxHandSpeedMS);
  out.jitter_s = random.chance(0.5) ? 0.0 : random.between(0.0, E::kMaxJitterS);
  out.lost_share = random.chance(0.4) ? 0.0 : random.between(0.0, E::kMaxLostShare);
}

void draw_wide(Random& random, double max_speed_m_s, StabilityCase& out) {
  out.stiffness_n_per_m = random.log_between(10.0, 20000.0);
  out.damping_n_s_per_m =
      random.chance(0.3) ? 0.0 : random.log_between(0.01, 3.0 * critical_damping(out.stiffness_n_per_m));
  out.stiff_device = random.chance(0.5);
  out.physics_hz = random.log_between(5.0, 1000.0);
  out.haptic_hz = random.chance(0.4) ? 1000.0 : random.log_between(500.0, 10000.0);
  out.proxy_kg = random.log_between(0.001, 10.0);
  out.body_ratio = random.log_between(1e-3, 1e3);
  out.friction = random.between(0.0, 2.0);
  out.speed_m_s = random.log_between(0.02, max_speed_m_s);
  out.quantum_m = random.chance(0.2) ? 0.0 : random.log_between(1e-6, 1e-4);
  out.scale = random.chance(0.5) ? 1.0 : random.log_between(0.05, 500.0);
  out.jitter_s = random.chance(0.5) ? 0.0 : random.log_between(1e-4, 0.05);
  out.lost_share = random.chance(0.4) ? 0.0 : random.between(0.0, 0.5);
  if (random.chance(0.25)) out.loop_pause_s = random.log_between(0.005, 0.2);
  if (random.chance(0.25)) out.physics_pause_s = random.log_between(0.05, 0.5);
}

/// Where the hand goes: as deep as it presses with no more than kPressForceN, so that no clamp is its own doing.
void draw_motion(Random& random, StabilityCase& out) {
  const double rendered = std::min(out.stiffness_n_per_m, out.stiff_device ? 20000.0 : 1480.0);
  const double hand = out.hand == StabilityHand::kSoft ? kSoftNPerM : kStiffNPerM;
  const double softness_m_per_n = 1.0 / rendered + 1.0 / hand;
  out.depth_m = std::clamp(random.between(0.05, 1.0) * kPressForceN * softness_m_per_n, 0.5e-3, 0.04);
  if (out.task == StabilityTask::kDeep) out.depth_m = random.log_between(1e-3, 0.03);
  out.height_m = random.log_between(1e-3, 0.045);
  // No motion longer than a second.
  if (out.hand != StabilityHand::kNone) {
    out.height_m = std::min(out.height_m, std::max(1e-3, out.speed_m_s - out.depth_m));
  }
}

/// A task on a body that rests, or among bodies that a hand moves.
void draw_task(Random& random, bool bullet, int boxes, StabilityCase& out) {
  if (bullet) {
    out.task = random.chance(0.5) ? StabilityTask::kBlock : StabilityTask::kStack;
    if (out.task == StabilityTask::kBlock && out.hand == StabilityHand::kNone) out.hand = StabilityHand::kStiff;
    out.boxes = 1 + random.below(boxes);
  } else if (out.hand == StabilityHand::kNone) {
    out.task = random.chance(0.75) ? StabilityTask::kDrop : StabilityTask::kDeep;
    out.shape = random.chance(0.75) ? StabilityShape::kPlane : StabilityShape::kBox;
  } else {
    constexpr std::array tasks{StabilityTask::kPress, StabilityTask::kRub, StabilityTask::kFree, StabilityTask::kDeep};
    out.task = tasks[static_cast<std::size_t>(random.below(4))];
    out.shape = static_cast<StabilityShape>(random.below(3));
  }
}

#if RTBUS_WITH_BULLET
constexpr bool kBullet = true;
#else
constexpr bool kBullet = false;
#endif

StabilityCase draw_first(std::uint64_t seed) {
  // The methods of that time, in their order.
  constexpr std::array methods{"direct", "virtual_coupling", "remote_virtual_coupling", "interpolation",
                               "interpolation_predicted"};
  Random random(seed);
  StabilityCase out;
  out.seed = seed;
  const double kind = random.fraction();
  if (kind < 0.5) {
    draw_envelope(random, out);
  } else {
    draw_wide(random, 2.0, out);
    if (kind >= 0.75) out.method = methods[static_cast<std::size_t>(random.below(static_cast<int>(methods.size())))];
    out.paper = kind >= 0.88;
  }
  const bool bullet = kBullet && haptic::find_method(out.method)->needs_physics && random.chance(0.12);
  out.hand = static_cast<StabilityHand>(random.below(3));
  draw_task(random, bullet, 4, out);
  draw_motion(random, out);
  out.phase = random.fraction();
  return out;
}

void draw_soft(Random& random, StabilityCase& out) {
  out.task = StabilityTask::kSoft;
  if (out.hand == StabilityHand::kNone) out.hand = StabilityHand::kStiff;
  out.scale = 1.0;
  out.body_ratio = random.log_between(0.02, 0.3) / out.proxy_kg;  // a ball of 20 to 300 g
  out.soft.nodes = 60 + random.below(90);
  out.soft.linear_stiffness = random.log_between(0.005, 1.0);
  out.soft.pose_matching_hz = random.chance(0.3) ? 0.0 : random.log_between(1.0, 200.0);
  out.soft.bulk_modulus_pa = random.chance(0.2) ? 0.0 : random.log_between(10.0, 1e6);
  out.soft.damping_per_s = random.chance(0.3) ? 0.0 : random.log_between(0.1, 100.0);
  out.soft.iterations = 1 + random.below(4);
}

/// A body at up to kMaxFallMS, which has to fall until forces are there.
void draw_fall(Random& random, StabilityCase& out) {
  out.task = StabilityTask::kFall;
  out.scale = std::min(out.scale, 10.0);  // as far as gravity can be scaled with it
  out.speed_m_s = random.between(std::min(9.81 * out.start_s() + 0.1, 0.99 * kMaxFallMS), kMaxFallMS);
}

StabilityCase draw_second(std::uint64_t seed) {
  constexpr std::array improved{"direct", "virtual_coupling", "interpolation", "interpolation_predicted"};
  constexpr std::array published{"direct", "virtual_coupling", "remote_virtual_coupling", "interpolation",
                                 "interpolation_predicted"};
  const auto one_of = [](const auto& names, Random& random) {
    return names[static_cast<std::size_t>(random.below(static_cast<int>(names.size())))];
  };
  Random random(seed);
  StabilityCase out;
  out.seed = seed;
  const double kind = random.fraction();
  if (kind < 0.60) {
    draw_envelope(random, out);
    if (kind >= 0.35) out.method = StabilityEnvelope::kLocal;
  } else {
    draw_wide(random, 10.0, out);
    out.paper = kind >= 0.93;
    if (kind >= 0.77) out.method = StabilityEnvelope::kLocal;
    if (kind >= 0.87) out.method = one_of(improved, random);
    if (out.paper) out.method = one_of(published, random);
  }
  const bool bodies = kBullet && haptic::find_method(out.method)->needs_physics;
  out.hand = static_cast<StabilityHand>(random.below(3));
  const double share = random.fraction();
  if (bodies && !out.envelope && share < 0.08 && out.method != StabilityEnvelope::kLocal) {
    draw_soft(random, out);
  } else if (bodies && !out.envelope && share >= 0.08 && share < 0.16) {
    draw_fall(random, out);
  } else {
    draw_task(random, bodies && share >= 0.88, out.envelope ? 4 : 8, out);
  }
  draw_motion(random, out);
  if (out.task == StabilityTask::kSoft) out.depth_m = random.between(0.1, 1.0) * 0.04;  // its whole height
  out.phase = random.fraction();
  constexpr std::array iterations{4, 10, StabilityEnvelope::kIterations};
  out.solver_iterations = out.envelope ? StabilityEnvelope::kIterations : one_of(iterations, random);
  return out;
}

/// Among bodies that forces move, all kinds alike often.
void draw_moving_task(Random& random, StabilityCase& out) {
  constexpr std::array tasks{StabilityTask::kBlock, StabilityTask::kTip,   StabilityTask::kTable,
                             StabilityTask::kStack, StabilityTask::kPlate, StabilityTask::kSecondHand,
                             StabilityTask::kSoft,  StabilityTask::kFall};
  const int kinds = static_cast<int>(tasks.size()) - (out.envelope ? 1 : 0);  // what falls is faster than a hand
  out.task = tasks[static_cast<std::size_t>(random.below(kinds))];
  out.body = static_cast<StabilityBody>(random.below(3));
  out.boxes = 1 + random.below(out.envelope ? 4 : 8);
  const bool pushes = out.along_z() || out.task == StabilityTask::kPlate;
  if (pushes && out.hand == StabilityHand::kNone) out.hand = StabilityHand::kStiff;
  if (out.task == StabilityTask::kSoft) {
    draw_soft(random, out);
    if (out.envelope) out.soft.iterations = 4;
  }
  if (out.task == StabilityTask::kFall) draw_fall(random, out);
}

StabilityCase draw_third(std::uint64_t seed) {
  constexpr std::array tasks{StabilityTask::kPress, StabilityTask::kRub, StabilityTask::kFree, StabilityTask::kDeep};
  Random random(seed);
  StabilityCase out;
  out.seed = seed;
  const double kind = random.fraction();
  out.method = kind < 0.5 || (kind >= 0.75 && kind < 0.9) ? StabilityEnvelope::kDefault : StabilityEnvelope::kLocal;
  if (kind < 0.75) {
    draw_envelope(random, out);
    if (random.chance(0.2))
      out.body_ratio = random.log_between(StabilityEnvelope::kLightestBody, 1.0 / StabilityEnvelope::kMaxMassRatio);
  } else {
    draw_wide(random, 10.0, out);
  }
  out.hand = static_cast<StabilityHand>(random.below(3));
  if (kBullet && random.chance(0.5)) {
    draw_moving_task(random, out);
  } else {
    out.shape = static_cast<StabilityShape>(random.below(kBullet ? 5 : 3));
    out.task = tasks[static_cast<std::size_t>(random.below(4))];
    const bool lets_go = out.hand == StabilityHand::kNone && out.task != StabilityTask::kDeep;
    // A surface has no inside.
    if (lets_go || (out.shape == StabilityShape::kMesh && out.task == StabilityTask::kDeep)) {
      out.task = StabilityTask::kDrop;
      out.hand = StabilityHand::kNone;
    }
  }
  draw_motion(random, out);
  if (out.task == StabilityTask::kSoft) out.depth_m = random.between(0.1, 1.0) * 0.04;  // its whole height
  out.phase = random.fraction();
  constexpr std::array iterations{4, 10, StabilityEnvelope::kIterations};
  out.solver_iterations =
      out.envelope ? StabilityEnvelope::kIterations : iterations[static_cast<std::size_t>(random.below(3))];
  return out;
}

}  // namespace

StabilityCase draw_case(std::uint64_t seed) {
  if (seed < kSecondGeneration) return draw_first(seed);
  return seed < kThirdGeneration ? draw_second(seed) : draw_third(seed);
}

}  // namespace tools
