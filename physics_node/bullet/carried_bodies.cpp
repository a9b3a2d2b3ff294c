#include "physics_node/bullet/carried_bodies.hpp"

#include <algorithm>

#include "physics_node/bullet/units.hpp"
#include "physics_node/engine/contact_set.hpp"

namespace physics::bullet {
namespace {

/// It lies on what is below it, and does not lean on it: a cosine.
constexpr double kBelow = 0.7;

const btRigidBody* moved(const btCollisionObject& object) {
  const btRigidBody* const body = btRigidBody::upcast(&object);
  return body != nullptr && !body->isStaticOrKinematicObject() ? body : nullptr;
}

}  // namespace

CarriedBodies::CarriedBodies(std::span<btPersistentManifold* const> manifolds, const btVector3& up,
                             const std::function<bool(const btRigidBody&)>& touched) {
  for (const btPersistentManifold* const manifold : manifolds) {
    const btCollisionObject &a = *manifold->getBody0(), &b = *manifold->getBody1();
    if (manifold->getNumContacts() == 0 || a.getUserIndex() < 0 || b.getUserIndex() < 0) continue;
    const auto above_b = static_cast<double>(manifold->getContactPoint(0).m_normalWorldOnB.dot(up));
    touch(a, b, above_b);
    touch(b, a, -above_b);
  }
  // Whoever touches one other body alone lies on it, or does not. Then it is out of the way, and so on.
  for (std::size_t taken = 1; taken > 0;) {
    taken = 0;
    for (Node& node : nodes_) {
      const btRigidBody* const body = node.body;
      if (node.carrier != nullptr || node.touches.size() != 1) continue;
      const Touch& on = node.touches.front();
      const btRigidBody* const carrier = moved(*on.other);
      if (carrier == nullptr || on.up < kBelow) continue;
      if (touched(*body) && kMostMassRatio * together_kg(*body) > together_kg(*carrier)) continue;
      node.carrier = carrier;
      std::erase_if(node_of(*carrier).touches, [body](const Touch& each) { return each.other == body; });
      ++taken;
    }
  }
}

void CarriedBodies::touch(const btCollisionObject& object, const btCollisionObject& other, double up) {
  const btRigidBody* const body = moved(object);
  if (body == nullptr) return;
  std::vector<Touch>& touches = node_of(*body).touches;
  const auto same =
      std::find_if(touches.begin(), touches.end(), [&other](const Touch& each) { return each.other == &other; });
  if (same == touches.end()) {
    touches.push_back({&other, up});
  } else {
    same->up = std::min(same->up, up);
  }
}

CarriedBodies::Node& CarriedBodies::node_of(const btRigidBody& body) {
  const auto index = static_cast<std::size_t>(body.getUserIndex());
  if (index >= number_.size()) number_.resize(index + 1, 0);
  if (number_[index] == 0) {
    nodes_.push_back({&body, {}});
    number_[index] = nodes_.size();
  }
  return nodes_[number_[index] - 1];
}

const CarriedBodies::Node* CarriedBodies::find(const btRigidBody& body) const {
  const auto index = static_cast<std::size_t>(body.getUserIndex());
  return index < number_.size() && number_[index] > 0 ? &nodes_[number_[index] - 1] : nullptr;
}

const btRigidBody* CarriedBodies::carrier_of(const btRigidBody& body) const {
  const btRigidBody* out = &body;
  for (const Node* node = find(body); node != nullptr && node->carrier != nullptr; node = find(*out)) {
    out = node->carrier;
  }
  return out;
}

std::vector<const btRigidBody*> CarriedBodies::carried_by(const btRigidBody& carrier) const {
  std::vector<const btRigidBody*> out;
  for (const Node& node : nodes_) {
    if (node.carrier != nullptr && carrier_of(*node.body) == &carrier) out.push_back(node.body);
  }
  return out;
}

double CarriedBodies::together_kg(const btRigidBody& carrier) const {
  double out = mass_kg(carrier);
  for (const btRigidBody* const each : carried_by(carrier)) out += mass_kg(*each);
  return out;
}

}  // namespace physics::bullet
