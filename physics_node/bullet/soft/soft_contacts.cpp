/// What SoftWorld does for a proxy that somebody else moves: where it is near to a soft body, how that gives way, and
/// what the hand has felt there, onto the nodes.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "physics_node/bullet/soft/soft_world.hpp"

namespace physics::bullet {
namespace {

using Eigen::Vector3d;

/// Nodes count as far around the foot as the tool is wide, and over two edges at least: less would feel each node.
constexpr double kWidthEdges = 2.0;
/// A patch is followed while the tool is nearer than this many times its width.
constexpr double kFollowWidths = 3.0;
/// Until a compliance has been measured: of the patch's mass on a spring of this frequency.
constexpr double kGuessHz = 10.0;

}  // namespace

PatchBall SoftWorld::ball_of(const BulletProxy& proxy, const MadeSoftBody& made) const {
  PatchBall ball;
  ball.centre = from_bullet(proxy.body().getWorldTransform().getOrigin());
  ball.radius = proxy.radius() + static_cast<double>(made.soft().getCollisionShape()->getMargin());
  ball.width = std::max(ball.radius, kWidthEdges * made.mean_edge_m() * scale());
  return ball;
}

void SoftWorld::apply_hand_force(std::size_t proxy, std::size_t body, const Vector3d& force_n,
                                 const Vector3d& torque_n_m) {
  if (body < scene_bodies().size()) return BulletWorld::apply_hand_force(proxy, body, force_n, torque_n_m);
  const std::size_t soft = body - scene_bodies().size();
  if (soft >= bodies_.size() || proxy >= proxies().size() || !force_n.allFinite()) return;
  follow(proxy, soft).asked_n += force_n;
}

SoftWorld::Followed& SoftWorld::follow(std::size_t proxy, std::size_t soft) {
  if (followed_.size() < proxies().size() * bodies_.size()) followed_.resize(proxies().size() * bodies_.size());
  return followed_[proxy * bodies_.size() + soft];
}

/// Pushes of this step. A patch that has been lost meanwhile leaves the whole body to take them.
void SoftWorld::push_patches() {
  for (std::size_t i = 0; i < followed_.size(); ++i) {
    Followed& each = followed_[i];
    each.pushed_n = each.asked_n;
    each.asked_n.setZero();
    if (each.pushed_n.isZero(0.0)) continue;
    bodies_[i % bodies_.size()]->push(each.patch, each.pushed_n);
  }
}

/// After a step: where the patches are now, and one step of the probes.
void SoftWorld::follow_patches(double h) {
  for (std::size_t p = 0; p < proxies().size(); ++p) {
    if (!proxies()[p]->placed() || proxies()[p]->released()) {
      if (!followed_.empty()) {
        for (std::size_t s = 0; s < bodies_.size(); ++s) {
          if (follow(p, s).probed) probes_[s]->stop();
          follow(p, s) = Followed{};
        }
      }
      continue;
    }
    for (std::size_t s = 0; s < bodies_.size(); ++s) {
      MadeSoftBody& made = *bodies_[s];
      Followed& each = follow(p, s);
      const PatchBall ball = ball_of(*proxies()[p], made);
      find_patch(made.soft(), made.rest(), ball, kFollowWidths * ball.width, each.patch);
      if (!each.patch.found) {
        if (each.probed) probes_[s]->stop();
        each.probed = false;
        continue;
      }
      if (probes_.size() < bodies_.size()) probes_.resize(bodies_.size());
      if (!probes_[s]) {
        probes_[s] = std::make_unique<SoftProbe>(made.body(), soft_dynamics_.getWorldInfo(), scale());
      }
      Probe& probe = probes_[s];
      if (!probe->running()) {
        probe->start(made, each.patch, each.pushed_n);
        each.probed = true;
      } else if (each.probed && probe->advance(h, [&](btSoftBody& copy) { collide_with_fixed(copy, made); })) {
        each.compliance_m_per_n = probe->compliance_m_per_n();
      }
      if (!probe->running()) each.probed = false;
    }
  }
}

/// As collide(), for a copy: against what no force moves.
void SoftWorld::collide_with_fixed(btSoftBody& copy, const MadeSoftBody& made) {
  for (const SceneBody& body : scene_bodies()) {
    if (body.rigid->isStaticOrKinematicObject()) collide_with_body(copy, body, made.body().contact_hardness);
  }
}

void SoftWorld::add_more_contacts(std::size_t index, double radius_m, ContactSet& out) const {
  const BulletProxy& proxy = *proxies()[index];
  if (proxy.released()) return;
  for (std::size_t s = 0; s < bodies_.size(); ++s) {
    const MadeSoftBody& made = *bodies_[s];
    SoftPatch patch;
    double compliance_m_per_n = 0.0;
    const PatchBall ball = ball_of(proxy, made);
    if (followed_.size() > index * bodies_.size() + s) {
      const Followed& each = followed_[index * bodies_.size() + s];
      patch = each.patch;
      compliance_m_per_n = each.compliance_m_per_n;
    }
    // Of a proxy that has been placed since the last step, too.
    find_patch(made.soft(), made.rest(), ball, radius_m * scale(), patch);
    if (!patch.found) continue;
    if (out.contacts.size() == kMaxContacts) {
      ++out.contacts_overflow;
      continue;
    }
    BodyBehind behind;
    behind.body = static_cast<std::uint32_t>(scene_bodies().size() + s);
    behind.kind = BodyKind::kSoft;
    behind.centre_m = patch.point / scale();
    behind.inverse_mass_per_kg = patch.inverse_mass_per_kg;
    Contact contact;
    contact.row = static_cast<std::uint32_t>(out.bodies.size());
    contact.point_m = behind.centre_m;
    contact.normal = patch.normal;
    contact.gap_m = patch.gap / scale();
    contact.friction = made.body().friction * static_cast<double>(proxy.body().getFriction());
    const double turn = 2.0 * std::numbers::pi * kGuessHz;
    contact.compliance_m_per_n =
        compliance_m_per_n > 0.0 ? compliance_m_per_n : patch.inverse_mass_per_kg / (turn * turn);
    contact.inverse_mass_per_kg = patch.inverse_mass_per_kg * Eigen::Matrix3d::Identity();
    out.bodies.push_back(behind);
    out.contacts.push_back(contact);
  }
}

}  // namespace physics::bullet
