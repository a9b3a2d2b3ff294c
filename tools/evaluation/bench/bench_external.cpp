#include "tools/evaluation/bench/bench_external.hpp"

#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tools/cli/common/find_config.hpp"
#include "tools/evaluation/bench/external_force.hpp"
#include "tools/evaluation/faults/python_engine.hpp"
#include "tools/evaluation/overhead/live_pair.hpp"

namespace tools {

namespace {

namespace fs = std::filesystem;

constexpr double kMostInC_us = 100.0, kMostInPython_us = 500.0;
constexpr double kLeastInC_hz = 2000.0, kLeastInPython_hz = 1000.0;

constexpr const char* kEmptyWorld = R"(import rtbus

with rtbus.Engine() as engine:
    for step in engine:
        for hand in step.hands:
            hand.move(hand.target, (0.0, 0.0, 0.0))
)";

struct Candidate {
  std::string name;
  std::string command;  ///< Empty: the engine in the physics node.
  double most_us = 0.0, least_hz = 0.0;
};

std::vector<Candidate> candidates(Experiment& experiment) {
  std::vector<Candidate> out{{"in physics_node", ""}};
  for (const auto& [name, program] : {std::pair{"C", "/empty_engine"}, std::pair{"C++", "/empty_engine_cpp"}}) {
    const std::string path = folder_of_this_program() + program;
    if (std::error_code failed; fs::exists(path, failed)) {
      out.push_back({name, "[" + path + "]", kMostInC_us, kLeastInC_hz});
    } else {
      experiment.note(path + " is not there: no engine in " + name);
    }
  }
  if (const std::string why = why_no_python_engine(); !why.empty()) {
    experiment.note(why);
    return out;
  }
  const std::string script = (fs::absolute(experiment.folder()) / "empty_engine.py").string();
  std::ofstream(script) << kEmptyWorld;
  out.push_back({"Python", "[/usr/bin/python3, " + script + "]", kMostInPython_us, kLeastInPython_hz});
  return out;
}

std::optional<LiveFigures> measure(const Candidate& candidate, const BenchExternalOptions& options, bool free) {
  LiveVariant variant{options.session_file};
  variant.assignments = {"haptic.0.method=remote_virtual_coupling"};
  if (!candidate.command.empty()) {
    variant.assignments.insert(variant.assignments.end(),
                               {"physics.engine=external", "physics.command=" + candidate.command});
  }
  variant.assignments.push_back("physics.rate_hz=500");
  if (free) variant.assignments.push_back("physics.pace=free");
  return run_live(variant, options.seconds);
}

}  // namespace

void bench_external(const BenchExternalOptions& options, Experiment& experiment) {
  Table table{"answer", {"engine", "answer p50 [us]", "p99 [us]", "steps per second, pace: free"}, {}};
  double inside_us = 0.0;
  for (const Candidate& candidate : candidates(experiment)) {
    const auto paced = measure(candidate, options, false), free = measure(candidate, options, true);
    if (!paced || !free) {
      experiment.note(candidate.name + " did not run");
      experiment.check_between(candidate.name + ".ran", candidate.name + ": ran", 0.0, "", 1.0, 1.0);
      continue;
    }
    double steps_hz = 0.0;
    for (const auto& [topic, rate_hz] : free->topics_hz) {
      if (topic.starts_with("physics.proxy_state.")) steps_hz = rate_hz;
    }
    table.rows.push_back({candidate.name, paced->step_us, paced->step_p99_us, steps_hz});
    if (candidate.command.empty()) {
      inside_us = paced->step_us;
      continue;
    }
    experiment.check_at_most(candidate.name + ".adds", candidate.name + ": what an answer takes more, p50",
                             paced->step_us - inside_us, "us", candidate.most_us);
    experiment.check_at_least(candidate.name + ".steps", candidate.name + ": steps of an empty world", steps_hz, "1/s",
                              candidate.least_hz);
  }
  experiment.add_table(std::move(table));
#if RTBUS_WITH_BULLET
  check_external_forces(external_forces(options.block_file), experiment);
#else
  experiment.note("built without Bullet: the force of the free block was not compared");
#endif
  experiment.note("pace: free waits 50 us between two steps: at most 20 000 a second");
}

}  // namespace tools
