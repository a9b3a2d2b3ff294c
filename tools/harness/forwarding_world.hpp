#pragma once
/// @file forwarding_world.hpp
/// A world that does what another one does, for HarnessOptions::around_world: what a derived class does not change goes
/// through.
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "physics_node/engine/world.hpp"

namespace tools {

class ForwardingWorld : public physics::World {
 public:
  explicit ForwardingWorld(std::unique_ptr<physics::World> world) : world_(std::move(world)) {}

  std::size_t add_proxy(const physics::ProxyParameters& parameters) override { return world_->add_proxy(parameters); }
  void reset_proxy(std::size_t proxy, const Eigen::Vector3d& position_m) override {
    world_->reset_proxy(proxy, position_m);
  }
  void release_proxy(std::size_t proxy) override { world_->release_proxy(proxy); }
  void place_proxy(std::size_t proxy, const Eigen::Vector3d& position_m, const Eigen::Vector3d& velocity_m_s) override {
    world_->place_proxy(proxy, position_m, velocity_m_s);
  }
  void drive_tool(std::size_t proxy, const physics::ProxyTarget& target) override { world_->drive_tool(proxy, target); }
  void tool_reaction(std::size_t proxy, double radius_m, double ahead_s, const Eigen::Vector3d& velocity_m_s,
                     physics::ToolReaction& out) override {
    world_->tool_reaction(proxy, radius_m, ahead_s, velocity_m_s, out);
  }
  void apply_hand_force(std::size_t proxy, std::size_t body, const Eigen::Vector3d& force_n,
                        const Eigen::Vector3d& torque_n_m) override {
    world_->apply_hand_force(proxy, body, force_n, torque_n_m);
  }
  void set_proxy_target(std::size_t proxy, const physics::ProxyTarget& target) override {
    world_->set_proxy_target(proxy, target);
  }
  void set_body_target(std::size_t body, const physics::BodyTarget& target) override {
    world_->set_body_target(body, target);
  }
  void step(double step_s) override { world_->step(step_s); }
  [[nodiscard]] physics::ProxyReadout proxy(std::size_t proxy) const override { return world_->proxy(proxy); }
  void contacts(std::size_t proxy, double radius_m, physics::ContactSet& out) const override {
    world_->contacts(proxy, radius_m, out);
  }
  [[nodiscard]] std::size_t bodies() const noexcept override { return world_->bodies(); }
  [[nodiscard]] physics::BodyPose body_pose(std::size_t body) const override { return world_->body_pose(body); }
  [[nodiscard]] std::size_t soft_nodes() const noexcept override { return world_->soft_nodes(); }
  [[nodiscard]] Eigen::Vector3d soft_node(std::size_t node) const override { return world_->soft_node(node); }
  [[nodiscard]] std::uint64_t recoveries() const noexcept override { return world_->recoveries(); }
  [[nodiscard]] std::size_t awake_bodies() const noexcept override { return world_->awake_bodies(); }
  [[nodiscard]] std::size_t solved_contacts() const noexcept override { return world_->solved_contacts(); }
  [[nodiscard]] std::vector<std::string> warnings(double longest_step_s) const override {
    return world_->warnings(longest_step_s);
  }

 protected:
  [[nodiscard]] physics::World& world() noexcept { return *world_; }

 private:
  std::unique_ptr<physics::World> world_;
};

}  // namespace tools
