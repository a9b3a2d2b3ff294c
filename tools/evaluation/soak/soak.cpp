#include "tools/evaluation/soak/soak.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdio>

#include "tools/cli/common/interrupt.hpp"
#include "tools/evaluation/soak/soak_session.hpp"

namespace tools {

namespace {

constexpr const char* kMethods[] = {"remote_virtual_coupling", "local_contact"};
/// Memory that a program may hold more than at first: pages that it touches later, and what the allocator keeps.
constexpr double kMoreMemory_mib = 8.0;
/// Back-off of 0.5 s at most, start of the node, ramp; the rest is the machine's.
constexpr double kReturn_s = 5.0;
/// 0.1 s: the statistics are told five times a second, and a pause of the machine may delay what they tell.
constexpr double kTicksTold = 100.0;
/// A hand that presses and is let go gets back what it has put in. More than this nobody has.
constexpr double kGiven_j = 0.05;

void check(const std::string& method, const SoakOutcome& out, const MachineLoad& during, Experiment& experiment) {
  const std::string id = "soak." + method;
  UseGrowth most;
  for (const auto& [name, growth] : out.growth) {
    most.resident_kib = std::max(most.resident_kib, growth.resident_kib);
    most.descriptors = std::max(most.descriptors, growth.descriptors);
    most.threads = std::max(most.threads, growth.threads);
  }
  if (!out.problem.empty()) experiment.note(method + ": " + out.problem);
  experiment.check_between(id + ".lived", "problems: a session that could not go on", out.problem.empty() ? 0.0 : 1.0,
                           "", 0.0, 0.0, during);
  experiment.check_between(id + ".force", "samples of a force above the device's limit",
                           static_cast<double>(out.above_limit), "", 0.0, 0.0);
  experiment.check_at_most(id + ".return", "slowest return of the force after an event", out.slowest_return_s, "s",
                           kReturn_s, during);
  experiment.check_at_most(id + ".ticks",
                           "ticks that passed in a life of the loop, neither served nor counted as overrun",
                           out.ticks_not_told, "", kTicksTold, during);
  experiment.check_at_least(id + ".energy", "least energy that the hand had put in", out.least_absorbed_j, "J",
                            -kGiven_j);
  experiment.check_at_most(id + ".memory", "memory of a program more than at first",
                           static_cast<double>(most.resident_kib) / 1024.0, "MiB", kMoreMemory_mib);
  experiment.check_between(id + ".descriptors", "descriptors of a program more than at first", most.descriptors, "",
                           0.0, 0.0);
  experiment.check_between(id + ".threads", "threads of a program more than at first", most.threads, "", 0.0, 0.0);
  experiment.check_between(id + ".segments", "segments more than at first, and left behind",
                           out.segments_more + out.left_over, "", 0.0, 0.0);
  experiment.check_between(id + ".end", "exit status", out.exit_status, "", 0.0, 0.0);
}

}  // namespace

void evaluate_soak(const SoakOptions& options, Experiment& experiment) {
  Table events{"soak_events", {"method", "event", "times"}, {}};
  Table uses{"soak_uses", {"method", "program", "memory more [MiB]", "descriptors more", "threads more"}, {}};
  Table loops{
      "soak_loops", {"method", "ticks due", "served", "overruns", "peak [N]", "slowest return [s]", "after"}, {}};
  std::uint64_t seed = options.seed;
  for (const char* method : kMethods) {
    if (interrupted()) break;
    SoakSetup setup;
    setup.program = options.program;
    setup.session_file = options.session_file;
    setup.assignments = {std::string("haptic.0.method=") + method};
    setup.name = "soak-" + std::to_string(getpid());
    setup.seconds = options.minutes * 60.0 / static_cast<double>(std::size(kMethods));
    setup.seed = seed++;
    std::fprintf(stderr, "soak: %s, %.0f s, seed %llu\n", method, setup.seconds,
                 static_cast<unsigned long long>(setup.seed));
    const LoadMeter meter;
    const SoakOutcome out = run_soak_session(setup);
    for (const auto& [name, times] : out.events) {
      events.rows.push_back({std::string(method), name, static_cast<double>(times)});
    }
    for (const auto& [name, growth] : out.growth) {
      uses.rows.push_back({std::string(method), name, static_cast<double>(growth.resident_kib) / 1024.0,
                           static_cast<double>(growth.descriptors), static_cast<double>(growth.threads)});
    }
    loops.rows.push_back({std::string(method), static_cast<double>(out.due), static_cast<double>(out.ticks),
                          static_cast<double>(out.overruns), out.peak_n, out.slowest_return_s, out.slowest_after});
    check(method, out, meter.read(), experiment);
  }
  experiment.add_table(std::move(events));
  experiment.add_table(std::move(uses));
  experiment.add_table(std::move(loops));
}

}  // namespace tools
