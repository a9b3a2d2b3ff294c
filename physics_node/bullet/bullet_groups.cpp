/// Which bodies BulletWorld tells together: those that push each other, and boxes that are about to.
#include <algorithm>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "physics_node/bullet/bullet_world.hpp"
#include "physics_node/bullet/units.hpp"

namespace physics::bullet {
namespace {

using Eigen::Vector3d;

bool is_in(const std::vector<const btRigidBody*>& group, const btRigidBody* body) {
  return std::find(group.begin(), group.end(), body) != group.end();
}

/// One is more than so many times as heavy as another, each with what it carries.
bool is_pile(const std::vector<const btRigidBody*>& group, const CarriedBodies* carried, double most_ratio) {
  const auto together_kg = [carried](const btRigidBody* each) {
    return carried != nullptr ? carried->together_kg(*each) : mass_kg(*each);
  };
  const auto [lightest, heaviest] = std::minmax_element(
      group.begin(), group.end(), [&](const auto* a, const auto* b) { return together_kg(a) < together_kg(b); });
  return together_kg(*heaviest) > most_ratio * together_kg(*lightest);
}

/// Between the boxes that bound them, along the axes of the world: they are no nearer than that. Bullet's units.
double gap_of_bounds(const btRigidBody& a, const btRigidBody& b) {
  btVector3 a_min, a_max, b_min, b_max;
  a.getAabb(a_min, a_max);
  b.getAabb(b_min, b_max);
  btVector3 apart = b_min - a_max;
  apart.setMax(a_min - b_max);
  apart.setMax(btVector3(0, 0, 0));
  return static_cast<double>(apart.length());
}

}  // namespace

std::span<btPersistentManifold* const> BulletWorld::all_manifolds() const {
  btDispatcher& dispatcher =
      const_cast<btCollisionDispatcher&>(dispatcher_);  // lists its manifolds; Bullet forgot the const
  return {dispatcher.getInternalManifoldPointer(), static_cast<std::size_t>(dispatcher.getNumManifolds())};
}

/// The body, and those that it pushes or that push it, and so on; empty: they are a pile.
std::vector<const btRigidBody*> BulletWorld::together_with(const btRigidBody& body, const CarriedBodies* carried,
                                                           double most_ratio) const {
  std::vector<const btRigidBody*> out{&body};
  for (std::size_t next = 0; next < out.size(); ++next) {
    for (const btPersistentManifold* const manifold : all_manifolds()) {
      const btCollisionObject *const a = manifold->getBody0(), *const b = manifold->getBody1();
      if ((a != out[next] && b != out[next]) || !BulletSolver::joins_pile(*manifold)) continue;
      const auto* const other = static_cast<const btRigidBody*>(a == out[next] ? b : a);
      if (is_in(out, other) || (carried != nullptr && carried->is_carried(*other))) continue;
      if (other->isKinematicObject() || out.size() == kMostTogether) return {};
      out.push_back(other);
    }
  }
  return is_pile(out, carried, most_ratio) ? std::vector<const btRigidBody*>{} : out;
}

bool BulletWorld::is_of_pile(const btRigidBody& body) const {
  constexpr double kHoweverUnequal = std::numeric_limits<double>::infinity();
  if (!together_with(body, nullptr, kHoweverUnequal).empty()) return false;
  if (!looks_for_carried()) return true;
  const CarriedBodies carried = find_carried();
  return together_with(body, &carried, kHoweverUnequal).empty();
}

/// Boxes that touch none of `group`, and are near one of them, with what they touch, as long as there is room for them.
void BulletWorld::add_near(std::vector<const btRigidBody*>& group) const {
  const auto is_box = [](const btRigidBody& body) {
    return !body.isStaticOrKinematicObject() && body.getCollisionShape()->getShapeType() == BOX_SHAPE_PROXYTYPE;
  };
  for (std::size_t i = 0; i < group.size() && group.size() < kMostTogether; ++i) {
    if (!is_box(*group[i])) continue;
    for (const SceneBody& other : bodies_) {
      if (other.light || !is_box(*other.rigid) || is_in(group, other.rigid.get())) continue;
      if (gap_of_bounds(*group[i], *other.rigid) > kNearTogether_m * scale_) continue;
      std::vector<const btRigidBody*> both = group;
      for (const btRigidBody* const each : together_with(*other.rigid, nullptr)) both.push_back(each);
      if (both.size() > group.size() && both.size() <= kMostTogether && !is_pile(both, nullptr, kMostMassRatio))
        group = both;
    }
  }
}

CarriedBodies BulletWorld::find_carried() const {
  const auto touched = [this](const btRigidBody& body) {
    return std::any_of(pushed_.begin(), pushed_.end(), [&body](const Push& push) {
      return static_cast<int>(push.body) == body.getUserIndex() && !push.force_n.isZero(0.0);
    });
  };
  return {all_manifolds(), -world_->getGravity().normalized(), touched};
}

bool BulletWorld::looks_for_carried() const { return bodies_.size() <= kMostWithCarried && gravity_m_s2_ > 0.0; }

BulletWorld::Companions BulletWorld::add_companions(ContactSet& out) const {
  const auto number = [](const btRigidBody* each) { return static_cast<std::uint32_t>(each->getUserIndex()); };
  const auto row_of = [&](const btRigidBody* each) {
    const auto is_it = [&](const BodyBehind& behind) { return behind.body == number(each); };
    return static_cast<std::size_t>(std::find_if(out.bodies.begin(), out.bodies.end(), is_it) - out.bodies.begin());
  };
  const std::size_t near = out.bodies.size();
  Companions companions{std::vector<std::size_t>(near, 0), std::vector<bool>(near, false), std::nullopt};
  std::vector<std::size_t>& groups = companions.groups;
  std::size_t count = 0;
  for (std::size_t row = 0; row < near; ++row) {
    const btRigidBody& rigid = *bodies_[out.bodies[row].body].rigid;
    if (groups[row] > 0 || rigid.isStaticOrKinematicObject()) continue;
    std::vector<const btRigidBody*> touching = together_with(rigid, nullptr);
    std::vector<const btRigidBody*> group = touching;
    add_near(group);
    if (touching.empty() && looks_for_carried()) {
      if (!companions.carried) companions.carried = find_carried();
      if (companions.carried->is_carried(rigid)) continue;
      group = touching = together_with(rigid, &*companions.carried);
      companions.carries[row] = !group.empty();
    }
    const auto told = [&](const auto* each) { return row_of(each) < groups.size() && groups[row_of(each)] > 0; };
    if (std::any_of(group.begin(), group.end(), told)) group = touching;  // what is near is in another group
    const auto missing =
        std::count_if(group.begin(), group.end(), [&](const auto* each) { return row_of(each) == out.bodies.size(); });
    const bool light =
        std::any_of(group.begin(), group.end(), [&](const auto* each) { return bodies_[number(each)].light; });
    if (group.size() < 2 || light || out.bodies.size() + static_cast<std::size_t>(missing) > kMaxContacts) continue;
    ++count;
    for (const btRigidBody* const each : group) {
      if (row_of(each) == out.bodies.size()) {
        out.bodies.emplace_back().body = number(each);
        groups.push_back(0);
        companions.carries.push_back(false);
      }
      groups[row_of(each)] = count;
      companions.carries[row_of(each)] = companions.carries[row];
    }
  }
  return companions;
}

void BulletWorld::add_near_supports(const std::vector<std::size_t>& groups, ContactSet& out) const {
  const auto touch = [&out](std::uint32_t a, std::uint32_t b) {
    return std::any_of(out.supports.begin(), out.supports.end(), [a, b](const Support& each) {
      return (each.row == a && each.holder == b + 1) || (each.row == b && each.holder == a + 1);
    });
  };
  const auto rows = static_cast<std::uint32_t>(groups.size());
  for (std::uint32_t a = 0; a < rows; ++a) {
    for (std::uint32_t b = a + 1; b < rows; ++b) {
      if (groups[a] == 0 || groups[a] != groups[b] || touch(a, b)) continue;
      const btRigidBody& held = *bodies_[out.bodies[a].body].rigid;
      const btRigidBody& holder = *bodies_[out.bodies[b].body].rigid;
      const Vector3d apart_m = out.bodies[a].centre_m - out.bodies[b].centre_m;
      if (gap_of_bounds(held, holder) > kNearTogether_m * scale_ || apart_m.isZero(0.0)) continue;
      Support near;
      near.row = a;
      near.holder = b + 1;
      near.point_m = 0.5 * (out.bodies[a].centre_m + out.bodies[b].centre_m);
      near.normal = apart_m.normalized();
      near.friction = pair_friction(held, holder);
      near.inverse_mass_per_kg = static_cast<double>(holder.getInvMass());
      out.supports.push_back(near);
    }
  }
}

}  // namespace physics::bullet
