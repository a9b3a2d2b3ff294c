#pragma once
/// @file outside_engine.hpp
/// An external engine, driven from outside and step by step: a hand of the suite's own publishes device states, and the
/// engine makes one step for each (`physics.step_on: packet`).
#include <array>
#include <optional>
#include <stdexcept>
#include <string>

#include <Eigen/Core>

#include "rtbus/contact_messages.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/publication.hpp"
#include "rtbus/subscription.hpp"
#include "tools/cli/run/supervisor.hpp"
#include "tools/evaluation/conformance/engine_file.hpp"

namespace tools {

/// The engine did not answer, ended, or refused the session; with what it said.
struct EngineFailed : std::runtime_error {
  using std::runtime_error::runtime_error;
};
/// This machine stopped for so long that the engine took the hand for gone. The case must be run again.
struct HandPaused : std::runtime_error {
  explicit HandPaused(double ms) : std::runtime_error("this machine paused"), pause_ms(ms) {}
  double pause_ms;
};

/// Of the tool, in all sessions of the suite.
inline constexpr double kToolMass_kg = 0.1, kToolRadius_m = 0.01, kToolFriction = 0.8, kToolStiffness_n_per_m = 200.0;
/// Contacts are asked for as far as this from the tool's surface.
inline constexpr double kContactRadius_m = 0.005;

struct OutsideSetup {
  double step_s = 1e-3;  ///< At most 1/15.
  std::string bodies;    ///< YAML of the scene's bodies, a flow list.
  std::string folder;    ///< For the session file.
};

/// What the hand does in the next step.
struct OutsideHand {
  Eigen::Vector3d target_m = Eigen::Vector3d::Zero(), velocity_m_s = Eigen::Vector3d::Zero();
  double stiffness_n_per_m = kToolStiffness_n_per_m;  ///< The damping follows with its square root.
  bool placed = false;                                ///< The tool is at the target and touches nothing.
  std::uint32_t pushed_body = 0;
  Eigen::Vector3d impulse_n_s = Eigen::Vector3d::Zero();  ///< Sum of all on that body since reset(); with `placed`.
};

/// Not thread-safe. Ends the engine and its topics on destruction.
class OutsideEngine {
 public:
  /// Starts the engine. Throws EngineFailed, rtbus::config::Error.
  OutsideEngine(const EngineFile& engine, const OutsideSetup& setup);
  ~OutsideEngine();
  OutsideEngine(const OutsideEngine&) = delete;
  OutsideEngine& operator=(const OutsideEngine&) = delete;

  /// The next step begins with the tool at the target, at rest.
  void reset() noexcept { ++epoch_; }
  /// One step. Throws EngineFailed, HandPaused.
  rtbus::ProxyState step(const OutsideHand& hand);
  /// Contacts of the last step, whose hand was `placed`. Throws EngineFailed.
  rtbus::ProxyContacts contacts();

  [[nodiscard]] double step_s() const noexcept { return setup_.step_s; }

 private:
  std::string write_session() const;
  rtbus::DeviceState state_of(const OutsideHand& hand) const;
  void look_after();
  void publish(const OutsideHand& hand);

  const EngineFile& engine_;
  OutsideSetup setup_;
  rtbus::Session session_;
  std::optional<rtbus::Publication<rtbus::DeviceState>> hand_;
  std::optional<rtbus::Subscription<rtbus::ProxyState>> answers_;
  std::optional<rtbus::Subscription<rtbus::ProxyContacts>> contacts_;
  Supervisor supervisor_;
  std::uint32_t epoch_ = 1;
  std::uint64_t published_ns_ = 0, sent_ = 0, looked_ns_ = 0, step_index_ = 0;
};

}  // namespace tools
