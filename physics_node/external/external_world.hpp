#pragma once
/// @file external_world.hpp
/// A world that somebody else simulates, in another thread of this process. The step thread of the node blocks in
/// step() until that thread has finished the step.
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "physics_node/engine/world.hpp"

namespace physics {

/// What a hand's tool does in a step.
enum class ToolMode : std::uint32_t { kAway = 0, kSpring = 1, kPlaced = 2 };

/// Impulse of a hand on a body, as a force over the step.
struct HandPush {
  std::size_t body = 0;
  Eigen::Vector3d force_n = Eigen::Vector3d::Zero(), torque_n_m = Eigen::Vector3d::Zero();
};

/// A hand, as the engine gets it for a step.
struct ExternalHand {
  ProxyParameters parameters;
  ToolMode mode = ToolMode::kAway;
  bool reset = false;
  ProxyTarget target;
  std::vector<HandPush> pushes;
};

/// A body, as the engine tells it.
struct ExternalBody {
  BodyPose pose;
  BodyBehind behind;  ///< `body` is set here.
  double mass_kg = 0.0;
};

/// What the engine gives back for a step.
struct ExternalAnswer {
  struct Tool {
    ProxyReadout readout;
    bool set = false;
    std::optional<Eigen::Vector3d> spring_force_n;  ///< None: as it is at the end.
    std::vector<Contact> contacts;                  ///< `row` is the body's number.
  };
  struct Support {
    std::size_t body = 0;
    physics::Support support;
  };
  std::vector<Tool> tools;
  std::vector<Support> supports;
};

class ExternalWorld final : public World {
 public:
  ExternalWorld(std::size_t bodies, bool gives_bodies) : bodies_(bodies), gives_bodies_(gives_bodies) {}

  // The engine's thread.
  /// Waits for a step, at most until `deadline_ns`. @returns its length; none: no step was due.
  [[nodiscard]] std::optional<double> wait_for_step(std::uint64_t deadline_ns);
  /// Ends the step.
  void finish(const ExternalAnswer& answer);
  /// Lets the step thread go, now and from now on.
  void close();
  /// Between wait_for_step() and finish(), while the step thread waits.
  [[nodiscard]] const std::vector<ExternalHand>& hands() const noexcept { return hands_; }
  [[nodiscard]] std::vector<ExternalBody>& state_of_bodies() noexcept { return bodies_; }
  [[nodiscard]] const std::vector<ExternalBody>& state_of_bodies() const noexcept { return bodies_; }
  /// A haptic loop simulates its tool, and this engine does not give what that needs: its name; empty: none.
  [[nodiscard]] const std::string& unserved() const noexcept { return unserved_; }

  // World: the step thread.
  std::size_t add_proxy(const ProxyParameters& parameters) override;
  void reset_proxy(std::size_t proxy, const Eigen::Vector3d& position_m) override;
  void release_proxy(std::size_t proxy) override;
  void place_proxy(std::size_t proxy, const Eigen::Vector3d& position_m, const Eigen::Vector3d& velocity_m_s) override;
  void apply_hand_force(std::size_t proxy, std::size_t body, const Eigen::Vector3d& force_n,
                        const Eigen::Vector3d& torque_n_m) override;
  void set_proxy_target(std::size_t proxy, const ProxyTarget& target) override;
  void step(double step_s) override;
  [[nodiscard]] ProxyReadout proxy(std::size_t proxy) const override { return readouts_.at(proxy); }
  void contacts(std::size_t proxy, double radius_m, ContactSet& out) const override;
  [[nodiscard]] std::size_t bodies() const noexcept override { return bodies_.size(); }
  [[nodiscard]] BodyPose body_pose(std::size_t body) const override { return bodies_.at(body).pose; }
  [[nodiscard]] std::size_t awake_bodies() const noexcept override { return bodies_.size(); }
  [[nodiscard]] std::size_t solved_contacts() const noexcept override { return 0; }
  [[nodiscard]] std::vector<std::string> warnings(double) const override { return {}; }

 private:
  void take(const ExternalAnswer& answer);

  std::vector<ExternalHand> hands_;
  std::vector<ProxyReadout> readouts_;
  std::vector<ExternalBody> bodies_;
  bool gives_bodies_;
  std::string unserved_;
  ExternalAnswer answer_;  ///< Of the last step.

  std::mutex mutex_;
  std::condition_variable changed_;
  enum class Turn : std::uint8_t { kNode, kEngine } turn_ = Turn::kNode;
  double step_s_ = 0.0;
  bool closed_ = false;
};

}  // namespace physics
