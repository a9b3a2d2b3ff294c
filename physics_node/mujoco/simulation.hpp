#pragma once
/// @file simulation.hpp
/// MuJoCo's model and data behind what the engine's loop asks for. Frame W, SI units. One thread.
#include <mujoco/mujoco.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "physics_node/external/rtbus_engine.h"
#include "physics_node/mujoco/mjcf.hpp"
#include "rtbus/config/scene.hpp"

namespace mujoco {

/// MuJoCo's errors end this process with status 1, and its warnings go to stderr. Without this an error prints "Press
/// Enter to exit" and waits for a keyboard, and a warning writes a file into the working folder.
void take_errors();

class Simulation {
 public:
  /// Throws rtbus::config::Error.
  Simulation(const rtbus::config::Scene& scene, const std::vector<ToolShape>& tools, double step_s, double reach_m);

  /// What a hand wants of its tool in the next step.
  void set_hand(std::size_t tool, const rtbus_engine_hand& hand);
  /// Advances by one step, in parts of at most kLongestPart_s.
  void step();

  /// After step().
  [[nodiscard]] rtbus_engine_tool tool(std::size_t tool) const;
  [[nodiscard]] std::size_t bodies() const noexcept { return bodies_.size(); }
  [[nodiscard]] rtbus_engine_body body(std::size_t body) const;
  /// Contacts of a tool within the reach.
  [[nodiscard]] std::vector<rtbus_engine_contact> contacts(std::size_t tool) const;
  [[nodiscard]] const std::vector<rtbus_engine_support>& supports() const noexcept { return supports_; }
  /// Contacts that MuJoCo had no memory for, so far.
  [[nodiscard]] int overflows() const noexcept { return overflows_; }

  static constexpr double kLongestPart_s = 1e-3;

 private:
  struct Tool {
    int geom = -1, dof = -1, position = -1;
    ToolShape shape;
    rtbus_engine_hand hand{};
    Eigen::Vector3d previous_target_m = Eigen::Vector3d::Zero(), contact_force_n = Eigen::Vector3d::Zero();
    Eigen::Vector3d target_m = Eigen::Vector3d::Zero(),
                    spring_force_n = Eigen::Vector3d::Zero();  ///< Of the part; mean.
    std::uint32_t contacts = 0;
  };
  struct Body {
    int id = 0, geom = -1;  ///< Static ones belong to the world, MuJoCo's body 0.
    bool dynamic = false;
    Eigen::Vector3d position_m = Eigen::Vector3d::Zero();  ///< Of a static one; likewise its orientation.
    Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
    double friction = 0.0, linear_damping_per_s = 0.0, angular_damping_per_s = 0.0;
    Eigen::Vector3d external_force_n = Eigen::Vector3d::Zero(), external_torque_n_m = Eigen::Vector3d::Zero();
    Eigen::Vector3d friction_force_n = Eigen::Vector3d::Zero(), friction_torque_n_m = Eigen::Vector3d::Zero();
    double friction_bound_n = 0.0;
  };
  void place(Tool& tool, const Eigen::Vector3d& position_m, const Eigen::Vector3d& velocity_m_s);
  void pull(Tool& tool, double done);
  void push_bodies();
  void find_contacts();
  void advance();
  void take_tool_forces(double share);
  void take_spring_forces(double share);
  void take_loads();
  void take_axes(int id, rtbus_engine_body& out) const;
  void add_load(std::size_t body, int contact, double sign, const mjtNum* force);
  void add_support(std::size_t body, std::size_t other, int contact, double sign, double force_n);
  /// Tool of a geom, or −1.
  [[nodiscard]] int tool_of(int geom) const;
  [[nodiscard]] double friction_of(int geom) const;

  std::unique_ptr<mjModel, void (*)(mjModel*)> model_;
  std::unique_ptr<mjData, void (*)(mjData*)> data_;
  std::vector<Tool> tools_;
  std::vector<Body> bodies_;
  std::vector<int> body_of_geom_, tool_of_geom_;  ///< −1: none.
  std::vector<rtbus_engine_support> supports_;
  std::vector<std::size_t> support_other_;  ///< Likewise: what holds.
  Eigen::Vector3d gravity_m_s2_;
  int parts_ = 1;
  int overflows_ = 0;
};

}  // namespace mujoco
