#pragma once
/// @file engine_suite.hpp
/// The cases of the conformance suite of worlds (tests/conformance/worlds), asked of an external engine.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <string>

#include "tools/evaluation/conformance/outside_engine.hpp"
#include "tools/evaluation/shared/experiment.hpp"

namespace tools {

/// One process of an engine, and the cases that it is asked. One thread.
class EngineSuite {
 public:
  /// Starts the engine. @param bodies YAML of the scene's. Throws EngineFailed, rtbus::config::Error.
  EngineSuite(const EngineFile& engine, Experiment& experiment, double step_s, const std::string& bodies);

  /// Runs a case again when this machine paused in it.
  void run(const std::function<void()>& one);

  // Each case adds its checks to the experiment.
  void free_air();
  void follows();
  void wall();
  void does_not_tunnel();
  /// What moves the tool is what its answers tell: m·Δv/h = F_spring + F_contact, in the air, at and off the wall.
  void momentum();
  void friction();
  void reset();
  void stiffnesses();
  void hostile();
  /// A tool that begins inside a body gets out.
  void leaves();
  /// Position, velocity and force after 500 random targets.
  std::array<double, 9> wander();
  /// Contacts that are told while the haptic loop simulates the tool.
  void contacts();
  /// The hand's impulses arrive at the body, whole: 0.5 N for 0.2 s at 0.5 kg on a floor without friction.
  void push();

 private:
  [[nodiscard]] double floor_m() const { return file_.floor_m.value_or(0.0); }
  [[nodiscard]] int steps(double seconds) const {
    return std::max(100, static_cast<int>(std::lround(seconds / step_s_)));
  }
  void begin(const Eigen::Vector3d& at) {
    engine_.reset();
    (void)engine_.step({at});
  }
  rtbus::ProxyState hold(const OutsideHand& hand, int count) {
    rtbus::ProxyState last;
    for (int i = 0; i < count; ++i) last = engine_.step(hand);
    return last;
  }

  const EngineFile& file_;
  const EngineTolerances& bars_;
  Experiment& experiment_;
  OutsideEngine engine_;
  double step_s_;
  std::string tag_;
};

}  // namespace tools
