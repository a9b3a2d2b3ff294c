/// Plans of hostile physics, drawn and changed by numbers.
#include <algorithm>
#include <cstdio>
#include <iterator>

#include "tools/evaluation/worst_physics/hostile_physics.hpp"

namespace tools {

namespace {

constexpr double kStiffnesses[] = {200.0, 400.0, 800.0, 1480.0};

/// One group of figures of the plan, drawn anew.
void draw(int group, Random& random, HostilePlan& plan) {
  const auto sometimes = [&random](double share, double low, double high) {
    return random.chance(share) ? random.log_between(low, high) : 0.0;
  };
  switch (group) {
    case 0:
      plan.stiffness_n_per_m = kStiffnesses[random.below(4)];
      plan.hand_n_per_m = random.chance(0.1) ? 0.0 : random.log_between(30.0, 1500.0);
      plan.hand_n_s_per_m = random.log_between(0.2, 8.0);
      plan.hand_kg = random.log_between(0.02, 0.3);
      break;
    case 1:
      plan.push = static_cast<HostilePlan::Push>(random.below(random.chance(0.5) ? 2 : 6));
      plan.frequency_hz = random.log_between(0.5, 40.0);
      plan.change_s = random.log_between(1e-3, 5.0);
      break;
    case 2:
      plan.force_n = random.log_between(0.3, 12.0);
      break;
    case 3:
      plan.speed_m_s = random.between(0.3, 2.5);
      break;
    case 4:
      plan.lie_j = sometimes(0.9, 1e-5, 1.0);
      plan.lie_alternates = random.chance(0.2);
      plan.free_share = random.chance(0.3) ? 0.0 : random.fraction();
      break;
    case 5:
      plan.wild_share = sometimes(0.2, 1e-4, 1.0);
      plan.insane_share = sometimes(0.1, 1e-4, 0.05);
      break;
    case 6:
      plan.age_s = sometimes(0.2, 1e-3, 0.2);
      plan.step_s = random.chance(0.6) ? 1e-3 : random.log_between(1e-9, 3600.0);
      break;
    case 7:
      plan.silent_every_s = sometimes(0.15, 0.05, 2.0);
      plan.silent_s = random.log_between(0.01, 0.5);
      break;
    case 8:
      plan.plate_s = random.log_between(1e-3, 0.05);
      plan.kinematic_share = random.chance(0.6) ? 1.0 : random.fraction();
      plan.friction = sometimes(0.7, 0.1, 10.0);
      break;
    case 9:
      plan.flip_share = sometimes(0.15, 0.01, 1.0);
      plan.jump_m = sometimes(0.2, 1e-5, 1.0);
      plan.rename_share = sometimes(0.2, 0.01, 1.0);
      break;
    case 10:
      plan.inverse_mass_per_kg = random.log_between(1e-9, 1e9);
      plan.compliance_m_per_n = sometimes(0.2, 1e-6, 1.0);
      plan.contacts = random.chance(0.6) ? 1 : 1 + random.below(16);
      plan.supports = random.chance(0.8) ? 0 : random.below(33);
      break;
    default:
      break;
  }
}
constexpr int kGroups = 11;

/// Some figures that matter to the energy, changed a little.
void nudge(Random& random, HostilePlan& plan) {
  double* const figures[] = {&plan.force_n, &plan.speed_m_s,    &plan.hand_n_s_per_m, &plan.hand_n_per_m,
                             &plan.hand_kg, &plan.frequency_hz, &plan.lie_j,          &plan.plate_s};
  for (int i = random.below(3); i >= 0; --i)
    *figures[random.below(std::size(figures))] *= random.log_between(0.8, 1.25);
}

/// A hand of mass and stiffness that turns the tip around at this rate, and whose damping takes what the force gives.
void circle(HostilePlan& plan) {
  constexpr double kTipMass_kg = 0.041, kContinuous_n = 1.75;  // phantom_desktop (drivers/simulated/models.cpp)
  constexpr double kTurning_rad_s = 45.0;                      // 42 mm at that speed: within the workspace
  plan.push = HostilePlan::Push::kAlong;
  plan.force_n = kContinuous_n;
  plan.speed_m_s = 1.9;
  plan.free_share = 0.0;
  plan.hand_n_per_m = (plan.hand_kg + kTipMass_kg) * kTurning_rad_s * kTurning_rad_s;
  plan.hand_n_s_per_m = plan.force_n / plan.speed_m_s;
}

}  // namespace

HostilePlan hostile_plan(const std::string& method, std::span<const std::uint64_t> lineage) {
  HostilePlan plan;
  plan.method = method;
  Random random(lineage.front());
  if (lineage.front() == kCircling) {
    circle(plan);
  } else {
    for (int group = 0; group < kGroups; ++group) draw(group, random, plan);
  }
  for (const std::uint64_t number : lineage.subspan(1)) {
    Random change(number);
    if (change.chance(0.5)) {
      nudge(change, plan);
      continue;
    }
    for (int i = change.below(2); i >= 0; --i) draw(change.below(kGroups), change, plan);
  }
  return plan;
}

std::string describe(const HostilePlan& plan) {
  static const char* const kPushes[] = {"along the motion", "the faster the more", "as a sine", "as a walk", "in jumps",
                                        "steadily"};
  char text[480];
  std::snprintf(text, sizeof text,
                "%s, hand %.3g N/m %.2g N s/m %.2g kg, K %.4g N/m: pushes %s with %.3g N up to %.3g m/s (%.3g Hz, "
                "changes after %.3g s), claims "
                "%.3g J%s, wild %.2g, insane %.2g, age %.3g s, step %.3g s, silent %.3g of %.3g s, %d contacts, "
                "kinematic %.2g, friction %.3g, 1/m %.3g /kg, gaps jump %.3g m, flips %.2g",
                plan.method.c_str(), plan.hand_n_per_m, plan.hand_n_s_per_m, plan.hand_kg, plan.stiffness_n_per_m,
                kPushes[static_cast<std::size_t>(plan.push)], plan.force_n, plan.speed_m_s, plan.frequency_hz,
                plan.change_s, plan.lie_j, plan.lie_alternates ? " to and fro" : "", plan.wild_share, plan.insane_share,
                plan.age_s, plan.step_s, plan.silent_s, plan.silent_every_s, plan.contacts, plan.kinematic_share,
                plan.friction, plan.inverse_mass_per_kg, plan.jump_m, plan.flip_share);
  return text;
}

}  // namespace tools
