#pragma once
/// @file bullet_world.hpp
/// The engine `bullet`: rigid bodies of any shape that move, stack, slide and sleep. Only files of this folder include
/// Bullet; they make a module of their own (module.cpp).
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "physics_node/bullet/bullet_proxy.hpp"
#include "physics_node/bullet/bullet_shapes.hpp"
#include "physics_node/bullet/bullet_solver.hpp"
#include "physics_node/bullet/carried_bodies.hpp"
#include "physics_node/bullet/face_contacts.hpp"
#include "physics_node/bullet/mesh_contacts.hpp"
#include "physics_node/bullet/rest_watch.hpp"
#include "physics_node/engine/contact_set.hpp"
#include "physics_node/engine/engine_module.hpp"

namespace physics::bullet {

/// Lengths are scaled by the smallest body that moves (length_scale()). Contacts are solved by sequential impulses in
/// random order, which makes stacks creep ten times less than a fixed one; the shuffle is seeded per world, so that two
/// runs of a scene are bit-identical. Bodies that overlap are pushed apart, by Bullet's defaults: deeper than a
/// fifteenth of the smallest body as a displacement, which gives no body and no hand any speed; less deep through the
/// velocity. (As a displacement at any depth, stacks crept two to twenty times as far, and ten layers fell over at 2
/// ms.)
///
/// Sleeping. A body slower than both thresholds for deactivation.after_s, with everything it touches, stops costing
/// anything until something awake touches it. Where the scene names no threshold it is 6 % of √(g·e) and of 4.5 % of
/// √(g/e), e being the body's shortest extent: 27 mm/s and 1 rad/s for 20 mm on earth. Without gravity nothing sleeps.
///
/// Kinematic bodies. At the start of a step one is where its motion has it at that time, and moves with the mean
/// velocity of the step: contacts are seen where they are, and carry along at that speed. One that stands still for a
/// step lets its neighbours sleep, one that moves wakes them.
///
/// Tools. A placed proxy is out of the world. Where something yields to it (light bodies, soft/), a tool of its size
/// takes its place there: on a spring, without mass, and it meets nothing else.
///
/// A proxy of radius 0 gets kSmallestRadius of the smallest moving body's shortest extent: Bullet collides spheres, not
/// points. What else Bullet leaves to its users: friction and restitution of a pair are products; hulls turn with the
/// inertia of their bounding box; impacts slower than 2·g·h do not bounce.
class BulletWorld : public World {
 public:
  static constexpr double kSmallestRadius = 0.05;
  static constexpr double kMinStepS = 1e-5, kMaxStepS = 1.0;  ///< Steps are clamped to this.
  /// A stack of ten rests when the step is below this times √(e/g) (measured with 10 iterations; docs/scenes.md).
  static constexpr double kRestingStep = 0.025;

  /// Throws rtbus::config::Error for what Bullet cannot do.
  BulletWorld(const rtbus::config::Scene& scene, const EngineSettings& settings);
  ~BulletWorld() override;

  std::size_t add_proxy(const ProxyParameters& parameters) override;
  void reset_proxy(std::size_t proxy, const Eigen::Vector3d& position_m) override;
  void release_proxy(std::size_t proxy) override;
  void place_proxy(std::size_t proxy, const Eigen::Vector3d& position_m, const Eigen::Vector3d& velocity_m_s) override;
  void drive_tool(std::size_t proxy, const ProxyTarget& target) override;
  void tool_reaction(std::size_t proxy, double radius_m, double ahead_s, const Eigen::Vector3d& velocity_m_s,
                     ToolReaction& out) override;
  void apply_hand_force(std::size_t proxy, std::size_t body, const Eigen::Vector3d& force_n,
                        const Eigen::Vector3d& torque_n_m) override;
  void set_body_target(std::size_t body, const BodyTarget& target) override;
  void set_proxy_target(std::size_t proxy, const ProxyTarget& target) override;
  void step(double step_s) override;
  [[nodiscard]] ProxyReadout proxy(std::size_t proxy) const override;
  void contacts(std::size_t proxy, double radius_m, ContactSet& out) const override;
  [[nodiscard]] std::size_t bodies() const noexcept override { return bodies_.size(); }
  [[nodiscard]] BodyPose body_pose(std::size_t body) const override;
  [[nodiscard]] std::size_t awake_bodies() const noexcept override;
  [[nodiscard]] std::size_t solved_contacts() const noexcept override;
  [[nodiscard]] std::vector<std::string> warnings(double longest_step_s) const override;

 protected:
  /// With another collision configuration and kind of world, for an engine that adds to this one (soft/).
  using MakeDynamics = std::unique_ptr<btDiscreteDynamicsWorld> (*)(btDispatcher*, btBroadphaseInterface*,
                                                                    btConstraintSolver*, btCollisionConfiguration*);
  BulletWorld(const rtbus::config::Scene& scene, const EngineSettings& settings,
              std::unique_ptr<btDefaultCollisionConfiguration> configuration, MakeDynamics make_dynamics);

  /// Around Bullet's own step of `h` seconds, when the proxies have their mass and velocity, and before what became of
  /// them is read.
  virtual void before_dynamics(double h);
  virtual void after_dynamics(double h);

  /// Whether there is anything besides light bodies that a placed tool takes room among.
  [[nodiscard]] virtual bool anything_yields() const { return false; }

  /// What a tool bears. The reaction, and the place that it belongs to, are means over about kMean_s: contacts that
  /// come and go are not felt one by one.
  struct Borne {
    Eigen::Vector3d mean_n = Eigen::Vector3d::Zero(), mean_m = Eigen::Vector3d::Zero();
    Eigen::Vector3d once_n = Eigen::Vector3d::Zero(), once_m = Eigen::Vector3d::Zero();  ///< On the way to the means.
    double steps = 0.0, time_s = 0.0;                                                    ///< Since the tool is there.
    /// Since it touched something; infinite: it has not yet.
    double left_s = std::numeric_limits<double>::infinity();
    Eigen::Vector3d left_n = Eigen::Vector3d::Zero();  ///< What it touched last gets that in the next step.
    /// Of light bodies: mean, place and time when it was told last, and the stiffness between.
    double told_s = 0.0;
    Eigen::Vector3d told_n = Eigen::Vector3d::Zero(), told_m = Eigen::Vector3d::Zero();
    double stiffness_n_per_m = 0.0;
  };
  static constexpr double kMean_s = 4e-3;
  /// A tool that chatters has not left.
  static constexpr double kLeft_s = 0.02;
  /// And what it touched longer ago is owed nothing.
  static constexpr double kPaid_s = 0.5;
  [[nodiscard]] const Borne& borne(std::size_t proxy) const { return borne_[proxy]; }
  /// How much hands and bodies that do not yield to tools are at rest, 0 to 1.
  [[nodiscard]] double rest() const noexcept { return rest_.share(); }

  /// Whether it is known which parts that yield a tool touched last, so that Borne::left_n reaches them.
  [[nodiscard]] virtual bool touched_last(std::size_t tool) const;

  /// Appends further contacts after those of the rigid bodies.
  virtual void add_more_contacts(std::size_t proxy, double radius_m, ContactSet& out) const;

  struct SceneBody {
    std::shared_ptr<MadeShape> made;  // shared along a grid
    std::unique_ptr<btRigidBody> rigid;
    double reach = 0.0;  ///< No point of it is farther from its centre of mass [units]; infinite of planes and meshes.
    bool light = false;  ///< It yields to tools.
  };
  [[nodiscard]] const std::vector<SceneBody>& scene_bodies() const noexcept { return bodies_; }
  [[nodiscard]] const std::vector<std::unique_ptr<BulletProxy>>& proxies() const noexcept { return proxies_; }
  /// By proxy; null where no tool is driven.
  [[nodiscard]] const std::vector<std::unique_ptr<BulletProxy>>& tools() const noexcept { return tools_; }
  [[nodiscard]] btDiscreteDynamicsWorld& dynamics() noexcept { return *world_; }
  [[nodiscard]] double scale() const noexcept { return scale_; }
  [[nodiscard]] const std::string& scene_file() const noexcept { return scene_file_; }

 private:
  /// One that moves by itself.
  struct MovingBody {
    btRigidBody* rigid;
    rtbus::config::Body body;
    rtbus::config::PlacedAt now{};  ///< At the start of the step, then at its end.
    BodyTarget target{};            ///< Of `motion: target`.
    [[nodiscard]] rtbus::config::PlacedAt after(double time_s, double step_s) const;
  };
  void add_body(const rtbus::config::Body& body, std::shared_ptr<MadeShape> made);
  /// As of the last step. @param body One of them. @param carried What is carried is left out; nullptr: nothing is.
  /// @param most_ratio The heaviest is at most so many times as heavy as the lightest.
  /// @returns with the body itself; empty: they are a pile.
  [[nodiscard]] std::vector<const btRigidBody*> together_with(const btRigidBody& body, const CarriedBodies* carried,
                                                              double most_ratio = kMostMassRatio) const;
  /// Whether it is one of many that touch, besides what it carries, however unequal they are.
  [[nodiscard]] bool is_of_pile(const btRigidBody& body) const;
  void place_moving(double h);
  void take_out(BulletProxy& proxy);
  void drop_tool(std::size_t proxy);
  void find_light_bodies(double below_kg);
  void watch_rest(double h);
  void bear_tools(double h);
  [[nodiscard]] btTransform pose_of(int index, const rtbus::config::PlacedAt& at) const;
  /// @param light Those of bodies that yield to tools, or those of the others.
  void find_contacts(const btRigidBody& body, double radius, double radius_m, bool light, FoundContacts& out) const;
  [[nodiscard]] static double pair_friction(const btRigidBody& a, const btRigidBody& b);
  void add_near(std::vector<const btRigidBody*>& group) const;
  /// How the bodies of an answer are told, by row.
  struct Companions {
    std::vector<std::size_t> groups;       ///< In which group it is told; 0: alone.
    std::vector<bool> carries;             ///< As one with what it carries: together they would be a pile.
    std::optional<CarriedBodies> carried;  ///< Where any does.
  };
  /// In worlds of more bodies nobody looks for what carries what.
  static constexpr std::size_t kMostWithCarried = 64;
  [[nodiscard]] bool looks_for_carried() const;
  [[nodiscard]] CarriedBodies find_carried() const;
  /// Adds the bodies that are told together with those of `out`.
  Companions add_companions(ContactSet& out) const;
  [[nodiscard]] Eigen::Matrix3d inverse_inertia_of(const btRigidBody& body) const;
  void add_carried(const CarriedBodies& carried, BodyBehind& behind) const;
  void add_near_supports(const std::vector<std::size_t>& groups, ContactSet& out) const;
  [[nodiscard]] std::span<btPersistentManifold* const> all_manifolds() const;
  void describe_bodies(const BulletProxy& proxy, ContactSet& out) const;
  void add_held_by(const BulletProxy& proxy, const btPersistentManifold& manifold, bool first, std::uint32_t row,
                   const Companions& companions, ContactSet& out) const;
  void set_thresholds(const rtbus::config::Body& body, btRigidBody& rigid) const;
  [[nodiscard]] std::uint32_t contacts_of(const btRigidBody& body);

  rtbus::config::Deactivation deactivation_;
  double gravity_m_s2_;
  double smallest_m_;
  double scale_;  ///< Bullet's lengths over metres [1].
  std::string scene_file_;

  // Bullet's parts, in the order in which they need each other.
  std::unique_ptr<btDefaultCollisionConfiguration> configuration_;
  FaceContacts::Factories face_contacts_;
  MeshContacts::Factories mesh_contacts_;
  btCollisionDispatcher dispatcher_;
  btDbvtBroadphase broadphase_;
  BulletSolver solver_;
  std::unique_ptr<btDiscreteDynamicsWorld> world_;
  std::vector<SceneBody> bodies_;
  std::vector<MovingBody> moving_;
  std::vector<std::unique_ptr<BulletProxy>> proxies_, tools_;
  std::vector<double> tick_s_;  // by proxy
  std::vector<Borne> borne_;    // likewise
  bool any_light_ = false;
  RestWatch rest_;
  /// Forces of placed proxies on bodies: for the next step, and of the last one, for contacts().
  struct Push {
    std::size_t proxy, body;
    Eigen::Vector3d force_n, torque_n_m;
  };
  std::vector<Push> pushes_, pushed_;
  double time_s_ = 0.0;  // simulated so far
  double step_s_ = 1.0;  // the last step
};

}  // namespace physics::bullet
