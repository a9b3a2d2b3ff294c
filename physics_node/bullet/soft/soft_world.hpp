#pragma once
/// @file soft_world.hpp
/// The engine `bullet` for scenes with soft bodies: a module of its own, which maps Bullet's soft-body library.
#include <memory>
#include <string>
#include <vector>

#include "physics_node/bullet/bullet_world.hpp"
#include "physics_node/bullet/nearest.hpp"
#include "physics_node/bullet/soft/soft_dynamics.hpp"
#include "physics_node/bullet/soft/soft_made.hpp"
#include "physics_node/bullet/soft/soft_patch.hpp"
#include "physics_node/bullet/soft/soft_probe.hpp"

namespace physics::bullet {

/// Rigid bodies and proxies are those of BulletWorld. Soft bodies meet them by their nodes, which are balls of the
/// margin's radius: distances and normals are exact (nearest_points()), friction is Coulomb's. Soft bodies meet each
/// other as Bullet has it, nodes against faces or convex parts against each other.
///
/// One step: forces on nodes, rigid bodies solved and moved, then the positions of the nodes solved together with their
/// contacts, which push the rigid bodies. A proxy has been moved by then: it is moved on by what its contacts with soft
/// bodies changed of its velocity, so that it stands where the nodes have made room for it.
///
/// A placed proxy has no contacts with nodes. contacts() lists one patch of nodes (SoftPatch) of each near soft body,
/// as a contact with a compliance, after the rigid bodies and numbered after them. apply_hand_force() applies the
/// hand's force to the nodes of that patch.
///
/// Whatever the settings, numbers stay finite: links, pose matching and contacts move nodes by a share of what is
/// wrong, the explicit pressure is lowered to what the step carries, and a body that is unsound all the same is put
/// back.
class SoftWorld final : public BulletWorld {
 public:
  SoftWorld(const rtbus::config::Scene& scene, const EngineSettings& settings);
  ~SoftWorld() override;

  void apply_hand_force(std::size_t proxy, std::size_t body, const Eigen::Vector3d& force_n,
                        const Eigen::Vector3d& torque_n_m) override;
  [[nodiscard]] std::size_t soft_nodes() const noexcept override { return nodes_.size(); }
  [[nodiscard]] Eigen::Vector3d soft_node(std::size_t node) const override;
  [[nodiscard]] std::uint64_t recoveries() const noexcept override { return recoveries_; }
  [[nodiscard]] std::size_t awake_bodies() const noexcept override {
    return BulletWorld::awake_bodies() + bodies_.size();
  }
  [[nodiscard]] std::size_t solved_contacts() const noexcept override;
  [[nodiscard]] std::vector<std::string> warnings(double longest_step_s) const override;

 private:
  /// One placed proxy and one soft body.
  struct Followed {
    SoftPatch patch;
    Eigen::Vector3d asked_n = Eigen::Vector3d::Zero();   ///< For the next step …
    Eigen::Vector3d pushed_n = Eigen::Vector3d::Zero();  ///< … and in the last one.
    double compliance_m_per_n = 0.0;                     ///< 0: not measured yet.
    bool probed = false;                                 ///< The body's probe is on this patch.
  };
  using Probe = std::unique_ptr<SoftProbe>;
  void before_dynamics(double h) override;
  void after_dynamics(double h) override;
  void collide();
  void collide_with_body(btSoftBody& soft, const SceneBody& body, double hardness);
  void collide_with_proxy(btSoftBody& soft, BulletProxy& proxy, double hardness);
  void collide_with_fixed(btSoftBody& copy, const MadeSoftBody& made);
  [[nodiscard]] PatchBall ball_of(const BulletProxy& proxy, const MadeSoftBody& made) const;
  [[nodiscard]] Followed& follow(std::size_t proxy, std::size_t soft);
  void push_patches();
  void follow_patches(double h);
  void add_more_contacts(std::size_t index, double radius_m, ContactSet& out) const override;
  void note_velocities();
  void add_contact(btSoftBody& soft, btSoftBody::Node& node, btRigidBody& rigid, const Eigen::Vector3d& normal,
                   double gap, double hardness);

  SoftDynamics& soft_dynamics_;
  std::vector<std::unique_ptr<MadeSoftBody>> bodies_;
  std::vector<const btSoftBody::Node*> nodes_;  // of all bodies, in order
  std::vector<btVector3> velocities_;           // of the proxies, with which they were moved
  std::vector<Followed> followed_;              // by proxy, then by body; empty until a proxy is placed
  std::vector<Probe> probes_;                   // of each body, made when a placed proxy first comes near
  std::vector<NearPoint> near_;                 // kept for its memory
  double h_ = 1e-3;
  std::uint64_t recoveries_ = 0;
};

}  // namespace physics::bullet
