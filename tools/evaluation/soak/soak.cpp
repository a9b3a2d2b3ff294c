#include "tools/evaluation/soak/soak.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "drivers/registry/registry.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/evaluation/soak/soak_session.hpp"

namespace tools {

namespace {

/// One session of a soak.
struct Part {
  const char* name;       ///< In tables and checks: its method, or its device.
  double share;           ///< Of the time.
  const char* session;    ///< Beside that of the others; empty: that one, with the method.
  const char* driver;     ///< It is left out where this driver was not built.
  const char* unit;       ///< The virtual device below `haptic.0.device`,
  const char* fault;      ///< and how it fails again and again.
  const char* weight[2];  ///< Settings below `haptic.0.device` of an arm without weight: its motors carry it else.
};
// An arm that was unplugged may have moved: its force stays away until somebody homes it.
constexpr Part kParts[] = {
    {"remote_virtual_coupling", 0.35, "", "", "", "", {}},
    {"local_contact", 0.35, "", "", "", "", {}},
    {"falcon",
     0.1,
     "wall_virtual_falcon.yaml",
     "falcon",
     "usb.virtual.",
     "unplug_at_s=0",
     {"grip_mass_kg=0", "usb.virtual.mechanics.gravity_m_s2=[0, 0, 0]"}},
    {"arm", 0.1, "wall_virtual_phantom.yaml", "phantom", "usb.virtual.", "late_reply=1", {}},
    {"omega", 0.05, "wall_virtual_omega.yaml", "force_dimension", "virtual.", "unplug_at_s=0", {}},
    {"inverse3", 0.05, "wall_virtual_inverse3.yaml", "haply", "virtual.", "unplug_at_s=0", {}},
};
/// Memory that a program may hold more than at first: pages that it touches later, and what the allocator keeps.
constexpr double kMoreMemory_mib = 8.0;
/// Back-off of 0.5 s at most, start of the node, ramp; the rest is the machine's.
constexpr double kReturn_s = 5.0;
/// A device that was pulled out is brought up again: a Falcon takes its firmware, and its hand homes it.
constexpr double kReplugged_s = 10.0;
/// 0.1 s: the statistics are told five times a second, and a pause of the machine may delay what they tell.
constexpr double kTicksTold = 100.0;
/// A hand that is let go sinks into the wall, and the force that comes back lifts it out again: by the energy of the
/// spring, ½·400 N/m·(6 mm)² = 7 mJ. Twice that, since the ramp lets it sink and rise once more.
constexpr double kReturned_j = 0.015;
/// In a life of a loop that faults end now and then. A device that fails again and again in one life gives that often.
constexpr double kGiven_j = 0.05;

void check(const Part& part, const SoakOutcome& out, const MachineLoad& during, Experiment& experiment) {
  const bool own_plant = *part.driver == '\0';
  const std::string id = std::string("soak.") + part.name;
  UseGrowth most;
  for (const auto& [name, growth] : out.growth) {
    most.resident_kib = std::max(most.resident_kib, growth.resident_kib);
    most.descriptors = std::max(most.descriptors, growth.descriptors);
    most.threads = std::max(most.threads, growth.threads);
  }
  const std::string says = std::string(part.name) + ": ";
  if (!out.problem.empty()) experiment.note(part.name + (": " + out.problem));
  experiment.check_between(id + ".lived", says + "problems: a session that could not go on",
                           out.problem.empty() ? 0.0 : 1.0, "", 0.0, 0.0, during);
  experiment.check_between(id + ".force", says + "samples of a force above the device's limit",
                           static_cast<double>(out.above_limit), "", 0.0, 0.0);
  experiment.check_at_most(id + ".return", says + "slowest return of the force after an event", out.slowest_return_s,
                           "s", own_plant ? kReturn_s : kReplugged_s, during);
  // A device that paces its loop has a rate of its own.
  if (own_plant) {
    experiment.check_at_most(id + ".ticks",
                             says + "ticks that passed in a life of the loop, neither served nor counted as overrun",
                             out.ticks_not_told, "", kTicksTold, during);
  }
  experiment.check_at_least(id + ".returned", says + "least energy of the hand since an event began",
                            out.least_since_event_j, "J", -kReturned_j);
  if (own_plant) {
    experiment.check_at_least(id + ".energy", says + "least energy that the hand had put in in a life of the loop",
                              out.least_absorbed_j, "J", -kGiven_j);
  }
  experiment.check_at_most(id + ".memory", says + "memory of a program more than at first",
                           static_cast<double>(most.resident_kib) / 1024.0, "MiB", kMoreMemory_mib);
  experiment.check_between(id + ".descriptors", says + "descriptors of a program more than at first", most.descriptors,
                           "", 0.0, 0.0);
  experiment.check_between(id + ".threads", says + "threads of a program more than at first", most.threads, "", 0.0,
                           0.0);
  experiment.check_between(id + ".segments", says + "segments more than at first, and left behind",
                           out.segments_more + out.left_over, "", 0.0, 0.0);
  experiment.check_between(id + ".end", says + "exit status", out.exit_status, "", 0.0, 0.0);
}

}  // namespace

void evaluate_soak(const SoakOptions& options, Experiment& experiment) {
  Table events{"soak_events", {"session", "event", "times"}, {}};
  Table uses{"soak_uses", {"session", "program", "memory more [MiB]", "descriptors more", "threads more"}, {}};
  Table loops{
      "soak_loops", {"session", "ticks due", "served", "overruns", "peak [N]", "slowest return [s]", "after"}, {}};
  std::uint64_t seed = options.seed;
  for (const Part& part : kParts) {
    if (interrupted()) break;
    const bool own_plant = *part.driver == '\0';
    if (!own_plant && !drivers::driver_present(part.driver)) {
      experiment.note(std::string(part.name) + ": left out, since this build has no driver for it");
      continue;
    }
    SoakSetup setup;
    setup.program = options.program;
    setup.name = "soak-" + std::to_string(getpid());
    setup.seconds = options.minutes * 60.0 * part.share;
    setup.seed = seed++;
    if (own_plant) {
      setup.session_file = options.session_file;
      setup.assignments = {std::string("haptic.0.method=") + part.name};
    } else {
      const std::string device = "haptic.0.device.", unit = device + part.unit;
      setup.session_file = std::filesystem::path(options.session_file).replace_filename(part.session);
      setup.trigger = experiment.folder() / (setup.name + ".fault");
      setup.assignments = {unit + "publish_state=true", unit + "faults.trigger=" + setup.trigger,
                           unit + "faults." + part.fault};
      for (const char* const each : part.weight) {
        if (each != nullptr) setup.assignments.push_back(device + each);
      }
    }
    std::fprintf(stderr, "soak: %s, %.0f s, seed %llu\n", part.name, setup.seconds,
                 static_cast<unsigned long long>(setup.seed));
    const LoadMeter meter;
    const SoakOutcome out = run_soak_session(setup);
    for (const auto& [name, times] : out.events) {
      events.rows.push_back({std::string(part.name), name, static_cast<double>(times)});
    }
    for (const auto& [name, growth] : out.growth) {
      uses.rows.push_back({std::string(part.name), name, static_cast<double>(growth.resident_kib) / 1024.0,
                           static_cast<double>(growth.descriptors), static_cast<double>(growth.threads)});
    }
    loops.rows.push_back({std::string(part.name), static_cast<double>(out.due), static_cast<double>(out.ticks),
                          static_cast<double>(out.overruns), out.peak_n, out.slowest_return_s, out.slowest_after});
    check(part, out, meter.read(), experiment);
  }
  experiment.add_table(std::move(events));
  experiment.add_table(std::move(uses));
  experiment.add_table(std::move(loops));
}

}  // namespace tools
