#include "tools/evaluation/conformance/engine_checks.hpp"

#include <array>
#include <cstdio>
#include <string>

#include "tools/evaluation/conformance/engine_suite.hpp"

namespace tools {

namespace {

/// The scene of tests/conformance/worlds: a floor, a ball and a block, all static with friction 0.5.
constexpr const char* kFloor = "{name: floor, type: static, shape: {plane: {}}, friction: 0.5}";
constexpr const char* kBall =
    "{name: ball, type: static, shape: {sphere: {radius_m: 0.05}}, position_m: [0.1, 0.05, 0], friction: 0.5}";
constexpr const char* kBlock =
    "{name: block, type: static, shape: {box: {size_m: [0.1, 0.1, 0.1]}}, position_m: [-0.1, 0.05, 0], friction: 0.5}";
constexpr const char* kFreeBlock =
    "{name: free, type: dynamic, mass_kg: 0.5, shape: {box: {size_m: [0.06, 0.04, 0.04]}}, position_m: [0, 0.02, 0], "
    "friction: 0}";

std::string cluttered() { return std::string(kFloor) + ", " + kBall + ", " + kBlock; }

void check_tool(const EngineFile& engine, Experiment& experiment, double step_s) {
  EngineSuite suite(engine, experiment, step_s, cluttered());
  const auto run = [&suite](void (EngineSuite::*one)()) { suite.run([&] { (suite.*one)(); }); };
  run(&EngineSuite::free_air);
  run(&EngineSuite::follows);
  run(&EngineSuite::reset);
  run(&EngineSuite::stiffnesses);
  run(&EngineSuite::hostile);
  if (!engine.floor_m) return;
  run(&EngineSuite::wall);
  run(&EngineSuite::leaves);
  if (step_s > 0.02) run(&EngineSuite::does_not_tunnel);
  if (step_s < 0.02) run(&EngineSuite::momentum);
  if (step_s < 2e-3) {
    run(&EngineSuite::friction);
  } else if (engine.gives_bodies) {
    run(&EngineSuite::contacts);
  }
}

void check_repeats(const EngineFile& engine, Experiment& experiment) {
  std::array<double, 9> last[2];
  for (auto& out : last) {
    EngineSuite suite(engine, experiment, 2e-3, cluttered());
    suite.run([&] { out = suite.wander(); });
  }
  const bool same = last[0] == last[1];
  experiment.check_between("repeats", "two runs that end in other bits", same ? 0.0 : 1.0, "", 0, 0);
}

}  // namespace

void check_engine(const EngineFile& engine, Experiment& experiment) {
  try {
    for (const double step_s : {1e-3, 1e-2, 5e-2}) {
      std::fprintf(stderr, "conformance: %s, steps of %g ms\n", engine.name.c_str(), 1e3 * step_s);
      check_tool(engine, experiment, step_s);
    }
    if (engine.tolerances.repeatable) check_repeats(engine, experiment);
    if (engine.gives_bodies && engine.reads_scenes) {
      EngineSuite suite(engine, experiment, 1e-2, std::string(kFloor) + ", " + kFreeBlock);
      suite.run([&suite] { suite.push(); });
    }
  } catch (const EngineFailed& failed) {
    experiment.note(failed.what());
    experiment.check_between("answers", "the engine answers to the end", 0.0, "", 1.0, 1.0);
  } catch (const HandPaused& paused) {
    MachineLoad load;
    load.pause_ms = paused.pause_ms;
    experiment.note("this machine paused for more than 80 ms in each of five tries of a case");
    experiment.check_between("answers", "the engine answers to the end", 0.0, "", 1.0, 1.0, load);
  }
  if (!engine.floor_m) experiment.note("no floor: walls, friction and contacts were not asked for");
  if (!engine.gives_bodies) experiment.note("gives: tool: contacts and pushes of bodies were not asked for");
  if (!engine.reads_scenes) experiment.note("reads_scenes: false: balls, blocks and pushed bodies were not asked for");
}

}  // namespace tools
