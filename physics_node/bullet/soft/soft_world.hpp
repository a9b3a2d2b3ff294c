#pragma once
/// @file soft_world.hpp
/// The engine `bullet` for scenes with soft bodies: a module of its own, which maps Bullet's soft-body library.
#include <array>
#include <memory>
#include <string>
#include <vector>

#include "physics_node/bullet/bullet_world.hpp"
#include "physics_node/bullet/nearest.hpp"
#include "physics_node/bullet/soft/soft_dynamics.hpp"
#include "physics_node/bullet/soft/soft_made.hpp"
#include "physics_node/bullet/soft/tool_ahead.hpp"

namespace physics::bullet {

/// Rigid bodies and proxies are those of BulletWorld. Soft bodies meet them by their nodes, which are balls of the
/// margin's radius: distances and normals are exact (nearest_points()), friction is Coulomb's. Soft bodies meet each
/// other as Bullet has it, nodes against faces or convex parts against each other.
///
/// One step: forces on nodes, rigid bodies solved and moved, then the positions of the nodes solved together with their
/// contacts, which push the rigid bodies. A proxy has been moved by then: it is moved on by what its contacts with soft
/// bodies changed of its velocity, so that it stands where the nodes have made room for it.
///
/// The tool of a placed proxy meets the nodes in the same way. What it bears is told (tool_reaction()) for now, and for
/// later: copies of the near bodies go on with the tool as it goes (ToolAhead). A second course beside that one
/// measures the stiffness. contacts() lists the nearest node of each near soft body after the rigid bodies, and numbers
/// it after them.
///
/// Where no hand and no rigid body moves (RestWatch), what is told of a tool says so.
///
/// Whatever the settings, numbers stay finite: links, pose matching and contacts move nodes by a share of what is
/// wrong, the explicit pressure is lowered to what the step carries, and a body that is unsound all the same is put
/// back.
class SoftWorld final : public BulletWorld {
 public:
  SoftWorld(const rtbus::config::Scene& scene, const EngineSettings& settings);
  ~SoftWorld() override;

  void tool_reaction(std::size_t proxy, double radius_m, double ahead_s, const Eigen::Vector3d& velocity_m_s,
                     ToolReaction& out) override;
  [[nodiscard]] std::size_t soft_nodes() const noexcept override { return nodes_.size(); }
  [[nodiscard]] Eigen::Vector3d soft_node(std::size_t node) const override;
  [[nodiscard]] std::uint64_t recoveries() const noexcept override { return recoveries_; }
  [[nodiscard]] std::size_t awake_bodies() const noexcept override {
    return BulletWorld::awake_bodies() + bodies_.size();
  }
  [[nodiscard]] std::size_t solved_contacts() const noexcept override;
  [[nodiscard]] std::vector<std::string> warnings(double longest_step_s) const override;

 private:
  /// Of one tool: what was seen ahead.
  struct Seen {
    double along_n_per_m = 0.0, across_n_per_m = 0.0;  ///< 0: not measured yet.
    double measured = 0.0;                             ///< Borne::steps when that was.
    std::uint32_t turn = 0;
    std::unique_ptr<ToolAhead> plain, aside;
  };
  struct NearNode {
    const btSoftBody::Node* node = nullptr;
    Eigen::Vector3d normal = Eigen::Vector3d::UnitY();
    double gap_m = 0.0;
  };
  /// Means around half of the way ahead, and around its end.
  struct Course {
    std::array<ToolReaction::Instant, 2> instants{};
  };
  /// What a tool touched last.
  struct Touched {
    struct Node {
      btSoftBody::Node* node = nullptr;
      double share = 0.0;  ///< Of what the tool bore, 0 to 1.
    };
    std::vector<Node> nodes;
    double since_s = 0.0;  ///< Since it touched any.
  };
  [[nodiscard]] bool anything_yields() const override { return true; }
  [[nodiscard]] bool touched_last(std::size_t tool) const override;
  void before_dynamics(double h) override;
  void after_dynamics(double h) override;
  void collide();
  void note_touched(std::size_t tool);
  void collide_with_body(btSoftBody& soft, const SceneBody& body, double hardness);
  /// @param massless The tool of drive_tool().
  void collide_with_proxy(btSoftBody& soft, BulletProxy& proxy, double hardness, bool massless);
  void collide_with_fixed(MadeSoftBody& copy);
  /// @param radius Of the tool [units].
  [[nodiscard]] NearNode nearest_node(const MadeSoftBody& made, const Eigen::Vector3d& tool_m, double radius) const;
  [[nodiscard]] ToolReaction::Instant instant_at(double after_s, const Eigen::Vector3d& tool_m,
                                                 const Eigen::Vector3d& reaction_n, double radius,
                                                 const std::vector<const MadeSoftBody*>& bodies) const;
  void look_ahead(const BulletProxy& tool, double ahead_s, const Eigen::Vector3d& velocity_m_s,
                  const std::vector<const MadeSoftBody*>& near, double steps, Seen& seen, ToolReaction& out);
  [[nodiscard]] Course run_course(ToolAhead& course, const BulletProxy& tool,
                                  const std::vector<const MadeSoftBody*>& near, int steps, double course_s,
                                  const Eigen::Vector3d& velocity_m_s, const Eigen::Vector3d& aside_m);
  void add_more_contacts(std::size_t index, double radius_m, ContactSet& out) const override;
  void note_velocities();
  void add_contact(btSoftBody& soft, btSoftBody::Node& node, btRigidBody& rigid, const Eigen::Vector3d& normal,
                   double gap, double hardness);

  SoftDynamics& soft_dynamics_;
  std::vector<std::unique_ptr<MadeSoftBody>> bodies_;
  std::vector<const btSoftBody::Node*> nodes_;  // of all bodies, in order
  std::vector<btVector3> velocities_;           // of proxies, then tools, with which they were moved
  std::vector<Seen> seen_;                      // by proxy
  std::vector<Touched> touched_;                // by proxy
  std::vector<int> contacts_before_;            // by body, before those of a tool
  std::vector<NearPoint> near_;                 // kept for its memory
  double h_ = 1e-3;
  std::uint64_t recoveries_ = 0;
};

}  // namespace physics::bullet
