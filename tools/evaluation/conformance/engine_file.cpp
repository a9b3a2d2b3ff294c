#include "tools/evaluation/conformance/engine_file.hpp"

#include <filesystem>

#include "rtbus/config/document.hpp"

namespace tools {

namespace {

EngineTolerances read_tolerances(rtbus::config::Map& map) {
  EngineTolerances out;
  const auto length = [&map](const char* key, double& value) { value = map.number(key, {0.0, 1.0}, value); };
  length("free_m", out.free_m);
  length("free_force_n", out.free_force_n);
  length("depth_m", out.depth_m);
  length("force_share", out.force_share);
  length("hard_depth_m", out.hard_depth_m);
  length("momentum_n", out.momentum_n);
  length("friction_share", out.friction_share);
  length("slip_share", out.slip_share);
  length("gap_m", out.gap_m);
  length("normal", out.normal);
  length("rounded_edge_m", out.rounded_edge_m);
  out.repeatable = map.boolean("repeatable", out.repeatable);
  map.finish();
  return out;
}

/// A file beside the engine's file is meant with its whole path, whatever the folder that the suite runs in.
std::string beside(const std::string& part, const std::string& file) {
  std::error_code failed;
  const auto path = std::filesystem::absolute(file, failed).parent_path() / part;
  return std::filesystem::is_regular_file(path, failed) ? path.lexically_normal().string() : part;
}

}  // namespace

EngineFile read_engine_file(const std::string& file) {
  rtbus::config::Map map = rtbus::config::load(file);
  (void)map.choice("schema", {"engine/1"});
  EngineFile out;
  out.file = file;
  out.name = map.text("name");
  out.engine = map.text("engine", "external");
  for (const std::string& part : map.texts("command")) out.command.push_back(beside(part, file));
  if (out.engine == "external" && out.command.empty()) {
    map.fail("command", "is missing: the program that is the engine, for example [python3, my_engine.py]");
  }
  out.gives_bodies = map.choice("gives", {"tool", "bodies"}, "tool") == "bodies";
  out.reads_scenes = map.boolean("reads_scenes", false);
  if (auto floor = map.optional_map("floor")) {
    if (out.reads_scenes) map.fail("floor", "goes with a world of its own, not with reads_scenes: true; leave it out");
    out.floor_m = floor->number("height_m", {-10.0, 10.0}, 0.0);
    out.floor_friction = floor->number("friction", {0.0, 10.0}, out.floor_friction);
    floor->finish();
  }
  if (out.reads_scenes) out.floor_m = 0.0;
  if (auto tolerances = map.optional_map("tolerances")) out.tolerances = read_tolerances(*tolerances);
  map.finish();
  return out;
}

}  // namespace tools
