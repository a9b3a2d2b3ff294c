#pragma once
/// @file carried_bodies.hpp
/// Bodies that lie on another one of the scene, and touch nothing else: they go where it goes.
#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include <btBulletDynamicsCommon.h>

namespace physics::bullet {

/// A tray with many cups is too many bodies to be told together, and a box with a coin on it two of too unequal masses.
/// But the tray moves with its cups as one body, as long as friction holds them. What lies on a cup lies on the tray.
class CarriedBodies {
 public:
  /// As of the last step. @param manifolds Of the world. @param up Against gravity, of unit length.
  /// @param touched Whether a hand pushes that body: it may push it off, unless it is light beside what carries it.
  CarriedBodies(std::span<btPersistentManifold* const> manifolds, const btVector3& up,
                const std::function<bool(const btRigidBody&)>& touched);

  /// @returns whether something carries it.
  [[nodiscard]] bool is_carried(const btRigidBody& body) const { return carrier_of(body) != &body; }
  /// All that go with that one.
  [[nodiscard]] std::vector<const btRigidBody*> carried_by(const btRigidBody& carrier) const;
  /// Its mass, and that of all that it carries.
  [[nodiscard]] double together_kg(const btRigidBody& carrier) const;

 private:
  struct Touch {
    const btCollisionObject* other;
    double up;  ///< Cosine between up and the normal from that one.
  };
  struct Node {
    const btRigidBody* body;
    std::vector<Touch> touches;
    const btRigidBody* carrier = nullptr;
  };
  Node& node_of(const btRigidBody& body);
  /// What carries it and is not carried itself; the body, where nothing does.
  [[nodiscard]] const btRigidBody* carrier_of(const btRigidBody& body) const;
  [[nodiscard]] const Node* find(const btRigidBody& body) const;
  void touch(const btCollisionObject& object, const btCollisionObject& other, double up);

  std::vector<Node> nodes_;
  std::vector<std::size_t> number_;  ///< By the scene's order: which node, plus 1.
};

}  // namespace physics::bullet
