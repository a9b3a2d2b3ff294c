#include "tools/evaluation/overhead/overhead_parts.hpp"

#include <unistd.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>

#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/common/run_progress.hpp"

namespace tools {

namespace {

constexpr const char* kSoftAside =
    "scene.soft_bodies=[{name: aside, mesh: {ball: {radius_m: 0.02, nodes: 20}}, position_m: [1, 0.021, 0], mass_kg: "
    "0.02}]";
constexpr double kAsleep_s = 1.2;  // bodies that rest fall asleep after 0.5 s
constexpr double kPushed_s = 0.8;  // 15 mm at 20 mm/s

/// The same way to run a session, run once.
bool same(const LiveVariant& a, const LiveVariant& b) {
  return a.session_file == b.session_file && a.assignments == b.assignments && a.physics == b.physics &&
         a.observe_telemetry == b.observe_telemetry && a.observe_bodies == b.observe_bodies && a.record == b.record &&
         a.settle_s == b.settle_s;
}

std::size_t index_of(std::vector<LiveVariant>& variants, const LiveVariant& wanted) {
  const auto found =
      std::find_if(variants.begin(), variants.end(), [&](const LiveVariant& each) { return same(each, wanted); });
  if (found != variants.end()) return static_cast<std::size_t>(found - variants.begin());
  variants.push_back(wanted);
  return variants.size() - 1;
}

LiveVariant with(LiveVariant variant, const std::vector<std::string>& assignments) {
  variant.assignments.insert(variant.assignments.end(), assignments.begin(), assignments.end());
  return variant;
}

Spread spread_of(std::vector<double> values) {
  constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();
  if (values.empty()) return {kNothing, kNothing, kNothing};
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  const double median = n % 2 == 1 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
  return {median, values.front(), values.back()};
}

}  // namespace

OverheadPlan overhead_plan(const OverheadOptions& options) {
  OverheadPlan plan;
  const auto part = [&plan](const char* session, const char* name, const LiveVariant& left_out,
                            const LiveVariant& forced_on, const PartSigns& signs) {
    const std::size_t without = index_of(plan.variants, left_out);
    plan.parts.push_back({session, name, {}, without, index_of(plan.variants, forced_on), signs});
  };
  const auto absent = [&plan](const char* session, const char* name, const char* why, const LiveVariant& without,
                              const PartSigns& signs = {}) {
    const std::size_t index = index_of(plan.variants, without);
    plan.parts.push_back({session, name, why, index, index, signs});
  };
  const auto recorded = [](LiveVariant variant) { return variant.record = true, variant; };
  const auto looked_at = [](LiveVariant variant) { return variant.observe_bodies = true, variant; };
  const auto followed = [](LiveVariant variant) { return variant.observe_telemetry = true, variant; };
  const PartSigns recorder{
      .library = "hdf5", .silent_topic = "haptic0.telemetry", .low_hz = 900, .high_hz = 1010, .process = true};

  const PartSigns soft_solver{.library = "bulletsoftbody", .topic = "physics.soft_nodes"};
  const PartSigns usb{.library = "libusb", .thread = "usb_io", .topic = "haptic0.link_stats"};
  constexpr const char* kAlways = "in every session: overhead_passivity";
  constexpr const char* kNoTorque = "3 actuated axes: there is no such code";

  const LiveVariant wall{.session_file = options.wall_file};
  LiveVariant direct = with(wall, {"haptic.0.method=direct"});
  direct.physics = false;
  part("wall", "engine (Bullet)", wall, with(wall, {"physics.engine=bullet"}), {.library = "bullet"});
  absent("wall", "soft solver", "nothing is soft", wall, soft_solver);
  part("wall", "physics process", direct, wall,
       {.thread = "physics_step", .topic = "physics.proxy_state.haptic0", .process = true});
  absent("wall", "torque path", kNoTorque, wall);
  absent("wall", "passivity", kAlways, wall);
  absent("wall", "body poses", "nothing moves", wall, {.topic = "physics.body_poses"});
  if (options.usb) {
    part("wall", "USB (virtual PHANToM)", wall,
         with(wall, {"haptic.0.device=devices/virtual_phantom.yaml", "haptic.0.clock=device"}), usb);
  } else {
    absent("wall", "USB", "not in this build", wall, usb);
  }
  part("wall", "plant process", wall, with(wall, {"haptic.0.device.process=own"}), {.process = true});
  part("wall", "telemetry", wall, followed(wall),
       {.silent_topic = "haptic0.telemetry", .low_hz = 900, .high_hz = 1010});
  if (options.recorder) part("wall", "recorder", wall, recorded(wall), recorder);
  absent("wall", "deactivation", "nothing moves", wall);

  // Pushed from the beginning on; and with no hand near: it rests.
  const LiveVariant untouched{.session_file = options.stack_file};
  LiveVariant stack = with(untouched, {"haptic.0.device.hand.start_s=0", "haptic.0.device.hand.speed_m_s=0.02"});
  stack.settle_s = kPushed_s;
  LiveVariant asleep = with(untouched, {"haptic.0.mapping.offset_m=[0, 0.3, 0.3]"});
  asleep.settle_s = kAsleep_s;
  absent("stack_125", "engine (Bullet)", "cubes move: no other engine can", stack);
  // A small ball that nothing touches: the solver, and hardly a body.
  part("stack_125", "soft solver", stack, with(stack, {kSoftAside}),
       {.library = "bulletsoftbody", .topic = "physics.soft_nodes"});
  absent("stack_125", "physics process", "the cubes live there", stack);
  absent("stack_125", "torque path", kNoTorque, stack);
  absent("stack_125", "passivity", kAlways, stack);
  // Two samples of 64 bodies make a frame.
  part("stack_125", "body poses", stack, looked_at(stack),
       {.silent_topic = "physics.body_poses", .low_hz = 40, .high_hz = 62});
  absent("stack_125", "USB", "does not meet the scene: as wall", stack, usb);
  part("stack_125", "contact constraints", stack, with(stack, {"physics.contacts=on"}),
       {.topic = "physics.contacts.haptic0"});
  if (options.recorder) part("stack_125", "recorder", stack, recorded(stack), recorder);
  // Left out: what costs the steps of bodies that rest.
  part("stack_125", "no deactivation", asleep, with(asleep, {"scene.deactivation.enabled=false"}), {.step_ratio = 5.0});

  const LiveVariant soft{.session_file = options.soft_file};
  absent("soft", "engine (Bullet)", "no other engine knows soft bodies", soft);
  part("soft", "soft solver (five bodies)", with(soft, {"scene.soft_bodies=[]"}), soft,
       {.library = "bulletsoftbody", .topic = "physics.soft_nodes", .step_ratio = 5.0});
  absent("soft", "physics process", "the bodies live there", soft);
  absent("soft", "torque path", kNoTorque, soft);
  absent("soft", "passivity", kAlways, soft);
  // 2265 nodes, 256 to a sample: nine make a frame.
  part("soft", "soft nodes", soft, looked_at(soft),
       {.silent_topic = "physics.soft_nodes", .low_hz = 180, .high_hz = 280});
  absent("soft", "USB", "does not meet the scene: as wall", soft, usb);
  if (options.recorder) part("soft", "recorder", soft, recorded(soft), recorder);
  absent("soft", "deactivation", "soft bodies do not sleep", soft);
  return plan;
}

void measure_parts(OverheadPlan& plan, const OverheadOptions& options) {
  const std::size_t runs = plan.variants.size() * static_cast<std::size_t>(options.rounds);
  RunProgress progress(::isatty(STDERR_FILENO) == 1, false);
  for (int round = 0; round < options.rounds; ++round) {
    std::vector<std::optional<LiveFigures>> figures(plan.variants.size());
    for (std::size_t i = 0; i < plan.variants.size() && !interrupted(); ++i) {
      const std::size_t which = round % 2 == 0 ? i : plan.variants.size() - 1 - i;
      const std::size_t done = static_cast<std::size_t>(round) * plan.variants.size() + i;
      progress.show_share(static_cast<double>(done) / static_cast<double>(runs), "runs of real processes");
      // A second time when it did not run through: a machine that is busy with others may keep a node from starting.
      for (int tries = 0; tries < 2 && !figures[which] && !interrupted(); ++tries) {
        figures[which] = run_live(plan.variants[which], options.seconds);
      }
    }
    for (OverheadPart& part : plan.parts) {
      if (!figures[part.left_out] || !figures[part.forced_on]) continue;
      part.without.push_back(*figures[part.left_out]);
      if (part.absent.empty()) part.with.push_back(*figures[part.forced_on]);
    }
  }
  progress.clear();
}

Spread left_out(const OverheadPart& part, const LiveFigure& figure) {
  std::vector<double> values;
  for (const LiveFigures& each : part.without) values.push_back(figure(each));
  return spread_of(std::move(values));
}

Spread saving(const OverheadPart& part, const LiveFigure& figure) {
  std::vector<double> values;
  for (std::size_t i = 0; i < part.with.size(); ++i) values.push_back(figure(part.with[i]) - figure(part.without[i]));
  return spread_of(std::move(values));
}

}  // namespace tools
