/// Claim l of `rtbus evaluate local-contact`: a block that friction holds stands under a hand.
#include <cmath>
#include <memory>
#include <utility>

#include "tools/cli/common/formatted.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/evaluation/local_contact/local_contact.hpp"
#include "tools/evaluation/shared/method_settings.hpp"
#include "tools/harness/forwarding_world.hpp"
#include "tools/harness/harness.hpp"

namespace tools {

namespace {

using Eigen::Vector3d;
using Settings = std::vector<std::string>;

/// A block of 0.3 kg, friction of the pair 0.3. The hand pushes 8 mm above its centre by 80 % of the bound.
constexpr double kBound_n = 0.3 * 0.3 * 9.81, kPushShare = 0.8;
constexpr double kStops_s = 0.8, kSettles_s = 0.7, kWatched_s = 4.0;
constexpr double kMoreThanBullet_um = 2.0, kForceKept = 0.98;
constexpr std::size_t kBlock = 1;

Settings block_settings() {
  return {"scene.bodies.1.mass_kg=0.3",
          "scene.bodies.0.friction=0.5",
          "scene.bodies.1.friction=0.6",
          "haptic.0.coupling.stiffness_n_per_m=800",
          "haptic.0.mapping.offset_m=[0, 0.028, 0]",
          "haptic.0.device.mechanics.position_quantum_m=0"};
}

/// @param goes_m From 8 mm before the block.
std::string hand_that_goes(double goes_m) {
  return formatted(
      "haptic.0.device.hand={type: push, impedance: firm, start_m: [0, 0, 0.008], direction: [0, 0, -1], "
      "distance_m: %g, speed_m_s: 0.01, start_s: 0.2}",
      goes_m);
}

/// Its block is pushed at the centre by a steady force: what the engine by itself lets it creep.
class SteadilyPushed final : public ForwardingWorld {
 public:
  SteadilyPushed(std::unique_ptr<physics::World> world, Vector3d force_n)
      : ForwardingWorld(std::move(world)), force_n_(std::move(force_n)) {}

  void apply_hand_force(std::size_t, std::size_t, const Vector3d&, const Vector3d&) override {}
  void step(double step_s) override {
    world().apply_hand_force(0, kBlock, force_n_, Vector3d::Zero());
    ForwardingWorld::step(step_s);
  }

 private:
  Vector3d force_n_;
};

struct Standing {
  double before_n = 0.0, after_n = 0.0;  ///< On the hand.
  double way_um = 0.0;                   ///< Of the block, in kWatched_s.
};

Standing watch(const LocalContactOptions& options, const Settings& more, const HarnessOptions& around) {
  std::vector<rtbus::config::Override> overrides;
  for (const Settings& settings : {block_settings(), more, options.assignments}) {
    for (const std::string& text : settings) overrides.push_back(rtbus::config::parse_override(text));
  }
  auto session = rtbus::config::load_session(options.config_folder + "/free_block.yaml", overrides);
  Harness harness(session, around);
  double force_n = 0.0;
  const auto run = [&](double seconds) {
    harness.run(seconds, [&](const rtbus::Telemetry& tick) { force_n = norm(tick.force_n); });
    return harness.stepper()->world().body_pose(kBlock).position_m;
  };
  Standing out;
  const Vector3d before = run(kStops_s + kSettles_s);
  out.before_n = force_n;
  out.way_um = 1e6 * (run(kWatched_s) - before).norm();
  out.after_n = force_n;
  return out;
}

}  // namespace

void claim_friction(const LocalContactOptions& options, Experiment& experiment) {
  Table table{"local_contact_friction",
              {"physics [Hz]", "method", "push [N]", "4 s later [N]", "block moved [um]", "bare Bullet [um]"},
              {}};
  const Vector3d steady_n(0.0, 0.0, -kPushShare * kBound_n);
  const HarnessOptions bare{.around_world = [&](std::unique_ptr<physics::World> world) {
    return std::make_unique<SteadilyPushed>(std::move(world), steady_n);
  }};
  for (const double physics_hz : {1000.0, 100.0, 43.0, 18.0}) {
    if (interrupted()) return;
    if (options.quick && physics_hz == 43.0) continue;
    const std::string rate = physics_hz == 1000.0 ? "null" : formatted("%g", physics_hz);
    const Standing alone =
        watch(options, {"haptic.0.method=local_contact", "physics.throttle_hz=" + rate, hand_that_goes(1e-4)}, bare);
    for (const char* const method : kAllCompared) {
      Settings settings = method_settings(method);
      settings.push_back("physics.throttle_hz=" + rate);
      settings.push_back(hand_that_goes(0.00493));
      const Standing felt = watch(options, settings, {});
      table.rows.push_back({physics_hz, std::string(method), felt.before_n, felt.after_n, felt.way_um, alone.way_um});
      if (std::string(method) != kLocalContact && std::string(method) != kRemoteCoupling) continue;
      const std::string id = std::string("local-contact.friction.") + method + formatted(".%ghz", physics_hz);
      const std::string what =
          std::string(method) +
          formatted(", a block pressed at 80 %% of its friction for 4 s, physics %g Hz: ", physics_hz);
      experiment.check_between(id + ".push", what + "push", felt.before_n / kBound_n, "of the bound", kPushShare - 0.03,
                               kPushShare + 0.03);
      experiment.check_at_most(id, what + "way beyond that of bare Bullet", felt.way_um - alone.way_um, "um",
                               kMoreThanBullet_um);
      experiment.check_at_least(id + ".force", what + "force that is left", felt.after_n / felt.before_n, "1",
                                kForceKept);
    }
  }
  experiment.add_table(std::move(table));
}

}  // namespace tools
