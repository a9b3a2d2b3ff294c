#pragma once
/// @file outside_world.hpp
/// An engine of ours behind the interface of external engines: physics::ExternalWorld before it, and a thread that does
/// what a stranger's program does with what it is told there, and no more.
#include <memory>
#include <thread>

#include "physics_node/external/external_world.hpp"

namespace tools {

class OutsideWorld final : public physics::World {
 public:
  explicit OutsideWorld(std::unique_ptr<physics::World> engine)
      : engine_(std::move(engine)), helper_(engine_->bodies(), true), program_([this] { run(); }) {}
  ~OutsideWorld() override {
    helper_.close();
    program_.join();
  }

  std::size_t add_proxy(const physics::ProxyParameters& parameters) override {
    (void)engine_->add_proxy(parameters);
    return helper_.add_proxy(parameters);
  }
  void reset_proxy(std::size_t proxy, const Eigen::Vector3d& at) override { helper_.reset_proxy(proxy, at); }
  void release_proxy(std::size_t proxy) override { helper_.release_proxy(proxy); }
  void place_proxy(std::size_t proxy, const Eigen::Vector3d& at, const Eigen::Vector3d& velocity) override {
    helper_.place_proxy(proxy, at, velocity);
  }
  void apply_hand_force(std::size_t proxy, std::size_t body, const Eigen::Vector3d& force,
                        const Eigen::Vector3d& torque) override {
    helper_.apply_hand_force(proxy, body, force, torque);
  }
  void set_proxy_target(std::size_t proxy, const physics::ProxyTarget& target) override {
    helper_.set_proxy_target(proxy, target);
  }
  void step(double step_s) override { helper_.step(step_s); }
  [[nodiscard]] physics::ProxyReadout proxy(std::size_t proxy) const override { return helper_.proxy(proxy); }
  void contacts(std::size_t proxy, double radius_m, physics::ContactSet& out) const override {
    helper_.contacts(proxy, radius_m, out);
  }
  [[nodiscard]] std::size_t bodies() const noexcept override { return helper_.bodies(); }
  [[nodiscard]] physics::BodyPose body_pose(std::size_t body) const override { return helper_.body_pose(body); }
  [[nodiscard]] std::size_t awake_bodies() const noexcept override { return helper_.awake_bodies(); }
  [[nodiscard]] std::size_t solved_contacts() const noexcept override { return 0; }
  [[nodiscard]] std::vector<std::string> warnings(double) const override { return {}; }

 private:
  static constexpr double kReach_m = 0.05;

  void run() {
    constexpr std::uint64_t kForever_ns = 1ULL << 62;
    while (const auto step_s = helper_.wait_for_step(kForever_ns)) {
      const auto& hands = helper_.hands();
      for (std::size_t i = 0; i < hands.size(); ++i) tell(i, hands[i]);
      engine_->step(*step_s);
      physics::ExternalAnswer answer;
      answer.tools.resize(hands.size());
      for (std::size_t i = 0; i < hands.size(); ++i) ask(i, answer);
      helper_.finish(answer);
    }
  }

  void tell(std::size_t i, const physics::ExternalHand& hand) {
    if (hand.reset) engine_->reset_proxy(i, hand.target.position_m);
    switch (hand.mode) {
      case physics::ToolMode::kAway:
        engine_->release_proxy(i);
        break;
      case physics::ToolMode::kSpring:
        engine_->set_proxy_target(i, hand.target);
        break;
      case physics::ToolMode::kPlaced:
        engine_->place_proxy(i, hand.target.position_m, hand.target.velocity_m_s);
        for (const auto& push : hand.pushes) engine_->apply_hand_force(i, push.body, push.force_n, push.torque_n_m);
        break;
    }
  }

  void ask(std::size_t i, physics::ExternalAnswer& answer) {
    physics::ContactSet near;
    engine_->contacts(i, kReach_m, near);
    answer.tools[i].readout = engine_->proxy(i);
    answer.tools[i].set = true;
    for (const physics::BodyBehind& body : near.bodies) {
      helper_.state_of_bodies()[body.body].behind = body;
      helper_.state_of_bodies()[body.body].pose = engine_->body_pose(body.body);
    }
    for (physics::Contact contact : near.contacts) {
      contact.row = near.bodies[contact.row].body;
      answer.tools[i].contacts.push_back(contact);
    }
    for (const physics::Support& support : near.supports) {
      answer.supports.push_back({near.bodies[support.row].body, support});
    }
  }

  std::unique_ptr<physics::World> engine_;
  physics::ExternalWorld helper_;
  std::thread program_;  // last: uses both
};

}  // namespace tools
