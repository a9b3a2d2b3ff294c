#pragma once
/// @file engine_file.hpp
/// ENGINE.yaml (schema engine/1): an external engine, what it gives, and how exact it means to be. Every key with its
/// unit and default: config/README.md.
#include <optional>
#include <string>
#include <vector>

namespace tools {

/// How far an answer may be from the truth. Defaults: those of our own engines.
struct EngineTolerances {
  double free_m = 1e-5;          ///< Tool from its target in free air.
  double free_force_n = 2e-3;    ///< Of its spring there.
  double depth_m = 1e-4;         ///< Tool in a wall, held 10 mm beyond touching at 200 N/m.
  double force_share = 0.01;     ///< Of the wall's force, and of a push on a body.
  double hard_depth_m = 1e-3;    ///< Tool in a wall that it is pulled into at 2000 N/m and 20 steps a second.
  double momentum_n = 1e-3;      ///< m·dv/dt of the tool against the forces that the answer tells.
  double friction_share = 0.02;  ///< Above μ·N.
  double slip_share = 0.05;      ///< Below μ·N while it slides.
  double gap_m = 1e-6;           ///< Of a contact, and where its point lies.
  double normal = 3e-5;          ///< Length of the difference of two unit vectors.
  double rounded_edge_m = 0.0;   ///< An engine may round edges of boxes: gaps there may be larger by this.
  bool repeatable = true;        ///< Two runs give the same bits.
};

struct EngineFile {
  std::string file;
  std::string name;
  std::string engine;                ///< `physics.engine`: "external", or one of ours in a program of its own.
  std::vector<std::string> command;  ///< With `external`.
  bool gives_bodies = false;
  bool reads_scenes = false;      ///< It simulates the session's scene, not a world of its own.
  std::optional<double> floor_m;  ///< Height of a flat floor around x = z = 0.
  double floor_friction = 0.5;    ///< To be multiplied with the tool's.
  EngineTolerances tolerances;
};

/// Throws rtbus::config::Error.
[[nodiscard]] EngineFile read_engine_file(const std::string& file);

}  // namespace tools
