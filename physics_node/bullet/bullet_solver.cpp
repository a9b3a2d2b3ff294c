#include "physics_node/bullet/bullet_solver.hpp"

#include <algorithm>
#include <numeric>

#include "physics_node/bullet/body_points.hpp"
#include "physics_node/engine/contact_set.hpp"

namespace physics::bullet {
namespace {

btVector3 velocity_at(const btCollisionObject& object, const btVector3& point) {
  const btRigidBody* const body = btRigidBody::upcast(&object);
  if (body == nullptr) return {0, 0, 0};
  return body->getVelocityInLocalPoint(point - body->getWorldTransform().getOrigin());
}

/// Bullet's rule for the bodies that share the solver's one static body.
bool stands(const btCollisionObject& object) {
  const btRigidBody* const body = btRigidBody::upcast(&object);
  return body == nullptr || (body->getInvMass() == 0 && !body->isKinematicObject());
}

/// Of the scene, and not a hand's proxy.
bool is_body(const btCollisionObject& object) { return object.getUserIndex() >= 0; }

/// What the impulses of this step have changed so far in the velocity along the row.
btScalar change_along(const btSolverConstraint& row, btSolverBody& a, btSolverBody& b) {
  return row.m_contactNormal1.dot(a.internalGetDeltaLinearVelocity()) +
         row.m_relpos1CrossNormal.dot(a.internalGetDeltaAngularVelocity()) +
         row.m_contactNormal2.dot(b.internalGetDeltaLinearVelocity()) +
         row.m_relpos2CrossNormal.dot(b.internalGetDeltaAngularVelocity());
}

}  // namespace

void BulletSolver::convertContacts(btPersistentManifold** manifolds, int count, const btContactSolverInfo& info) {
  for (int i = 0; i < count; ++i) {
    btPersistentManifold& manifold = *manifolds[i];
    const btCollisionObject& a = *manifold.getBody0();
    const btCollisionObject& b = *manifold.getBody1();
    if (a.getRestitution() * b.getRestitution() <= 0) continue;  // Bullet's combination of a pair
    for (int j = 0; j < manifold.getNumContacts(); ++j) {
      btManifoldPoint& point = manifold.getContactPoint(j);
      const btVector3 closing =
          velocity_at(b, point.getPositionWorldOnB()) - velocity_at(a, point.getPositionWorldOnA());
      if (point.m_normalWorldOnB.dot(closing) > info.m_restitutionVelocityThreshold) {
        point.m_contactPointFlags |= BT_CONTACT_FLAG_HAS_CONTACT_ERP;
        point.m_contactERP = 0;
      } else {
        point.m_contactPointFlags &= ~BT_CONTACT_FLAG_HAS_CONTACT_ERP;
      }
    }
  }
  btContactSolverInfo two_directions = info;
  two_directions.m_solverMode |=
      SOLVER_USE_2_FRICTION_DIRECTIONS | SOLVER_DISABLE_VELOCITY_DEPENDENT_FRICTION_DIRECTION;
  find_piles(manifolds, count);
  two_rows_.clear();
  for (int i = 0; i < count; ++i) {
    const btCollisionObject& a = *manifolds[i]->getBody0();
    const btCollisionObject& b = *manifolds[i]->getBody1();
    // A hand's proxy keeps Bullet's friction: wedged between static bodies it rattled with two rows.
    const auto holds = [this](const btCollisionObject& body) {
      return stands(body) || (is_body(body) && !in_pile(body));
    };
    const bool exact = holds(a) && holds(b);
    const int first = m_tmpSolverContactConstraintPool.size();
    convertContact(manifolds[i], exact ? two_directions : info);
    for (int j = first; j < m_tmpSolverContactConstraintPool.size(); ++j) {
      start_friction(m_tmpSolverContactConstraintPool[j], exact);
      two_rows_.push_back(exact);
    }
  }
  any_two_rows_ = std::find(two_rows_.begin(), two_rows_.end(), true) != two_rows_.end();
}

/// All manifolds of a body come in one call: it is in one island.
void BulletSolver::find_piles(btPersistentManifold** manifolds, int count) {
  const auto bodies = static_cast<std::size_t>(m_tmpSolverBodyPool.size());
  group_.resize(bodies);
  std::iota(group_.begin(), group_.end(), std::size_t{0});
  std::vector<std::size_t> size(bodies, 1);
  std::vector<btScalar> least(bodies), most(bodies);  // inverse mass
  for (std::size_t i = 0; i < bodies; ++i) {
    const btRigidBody* const body = m_tmpSolverBodyPool[static_cast<int>(i)].m_originalBody;
    least[i] = most[i] = body != nullptr ? body->getInvMass() : 0;
  }
  for (int i = 0; i < count; ++i) {
    if (!joins_pile(*manifolds[i])) continue;
    const int a = manifolds[i]->getBody0()->getCompanionId(), b = manifolds[i]->getBody1()->getCompanionId();
    if (a < 0 || b < 0) {  // one that moves by itself
      if (a >= 0 || b >= 0) size[group_of(std::max(a, b))] += kMostTogether;
      continue;
    }
    const std::size_t from = group_of(a), into = group_of(b);
    if (from == into) continue;
    group_[from] = into;
    size[into] += size[from];
    least[into] = std::min(least[into], least[from]);
    most[into] = std::max(most[into], most[from]);
  }
  find_far_from_ground(manifolds, count);
  std::vector<bool> far(bodies, false);
  for (std::size_t i = 0; i < bodies; ++i) {
    if (far_from_ground_[i]) far[group_of(static_cast<int>(i))] = true;
  }
  in_pile_.resize(bodies);
  for (std::size_t i = 0; i < bodies; ++i) {
    const std::size_t group = group_of(static_cast<int>(i));
    in_pile_[i] = size[group] > kMostTogether || (far[group] && size[group] > kMostOnEachOther) ||
                  most[group] > kMostUnequal * least[group];
    btRigidBody* const body = m_tmpSolverBodyPool[static_cast<int>(i)].m_originalBody;
    if (body != nullptr) set_in_pile(*body, in_pile_[i]);
  }
}

/// Those that what stands holds through kMostOnEachOther bodies or more, and those that nothing holds.
void BulletSolver::find_far_from_ground(btPersistentManifold** manifolds, int count) {
  far_from_ground_.assign(static_cast<std::size_t>(m_tmpSolverBodyPool.size()), true);
  std::vector<int> reached;
  for (std::size_t on_each_other = 0; on_each_other < kMostOnEachOther; ++on_each_other) {
    reached.clear();
    for (int i = 0; i < count; ++i) {
      if (manifolds[i]->getNumContacts() == 0) continue;
      const btCollisionObject &a = *manifolds[i]->getBody0(), &b = *manifolds[i]->getBody1();
      if (holds_up(a, on_each_other)) reached.push_back(b.getCompanionId());
      if (holds_up(b, on_each_other)) reached.push_back(a.getCompanionId());
    }
    for (const int body : reached) {
      if (body >= 0 && static_cast<std::size_t>(body) < far_from_ground_.size()) {
        far_from_ground_[static_cast<std::size_t>(body)] = false;
      }
    }
  }
}

/// The ground alone at first, then what it holds as well.
bool BulletSolver::holds_up(const btCollisionObject& body, std::size_t on_each_other) const {
  if (stands(body)) return true;
  const int id = body.getCompanionId();
  return on_each_other > 0 && is_body(body) && id >= 0 && static_cast<std::size_t>(id) < far_from_ground_.size() &&
         !far_from_ground_[static_cast<std::size_t>(id)];
}

std::size_t BulletSolver::group_of(int body) {
  auto group = static_cast<std::size_t>(body);
  while (group_[group] != group) group = group_[group] = group_[group_[group]];
  return group;
}

bool BulletSolver::in_pile(const btCollisionObject& body) const {
  const int id = body.getCompanionId();
  return id >= 0 && static_cast<std::size_t>(id) < in_pile_.size() && in_pile_[static_cast<std::size_t>(id)];
}

bool BulletSolver::joins_pile(const btPersistentManifold& manifold) {
  const btCollisionObject& a = *manifold.getBody0();
  const btCollisionObject& b = *manifold.getBody1();
  return manifold.getNumContacts() > 0 && !stands(a) && !stands(b) && is_body(a) && is_body(b);
}

/// Bullet sets the rows of friction to zero, and writes the impulse of a first row only.
void BulletSolver::start_friction(const btSolverConstraint& contact, bool two_rows) {
  auto& point = *static_cast<btManifoldPoint*>(contact.m_originalContactPoint);
  if (!two_rows) {
    point.m_appliedImpulseLateral2 = 0;
    return;
  }
  // Between two that both move it begins at zero: with that of the last step stacks of a gram rattle.
  const auto moves = [this](int id) { return m_tmpSolverBodyPool[id].m_originalBody != nullptr; };
  if (moves(contact.m_solverBodyIdA) && moves(contact.m_solverBodyIdB)) {
    point.m_appliedImpulseLateral1 = point.m_appliedImpulseLateral2 = 0;
    return;
  }
  const btScalar last[2] = {point.m_appliedImpulseLateral1, point.m_appliedImpulseLateral2};
  for (int side = 0; side < 2; ++side) {
    btSolverConstraint& row = m_tmpSolverContactFrictionConstraintPool[contact.m_frictionIndex + side];
    push(row, last[side] - static_cast<btScalar>(row.m_appliedImpulse));
  }
}

btScalar BulletSolver::solveGroupCacheFriendlyFinish(btCollisionObject** bodies, int body_count,
                                                     const btContactSolverInfo& info) {
  for (int i = 0; any_two_rows_ && i < m_tmpSolverContactConstraintPool.size(); ++i) {
    if (!two_rows_[static_cast<std::size_t>(i)]) continue;
    const btSolverConstraint& contact = m_tmpSolverContactConstraintPool[i];
    static_cast<btManifoldPoint*>(contact.m_originalContactPoint)->m_appliedImpulseLateral2 =
        m_tmpSolverContactFrictionConstraintPool[contact.m_frictionIndex + 1].m_appliedImpulse;
  }
  return btSequentialImpulseConstraintSolver::solveGroupCacheFriendlyFinish(bodies, body_count, info);
}

void BulletSolver::push(btSolverConstraint& row, btScalar impulse) {
  if (impulse == 0) return;
  btSolverBody& a = m_tmpSolverBodyPool[row.m_solverBodyIdA];
  btSolverBody& b = m_tmpSolverBodyPool[row.m_solverBodyIdB];
  row.m_appliedImpulse = static_cast<btScalar>(row.m_appliedImpulse) + impulse;
  a.internalApplyImpulse(row.m_contactNormal1 * a.internalGetInvMass(), row.m_angularComponentA, impulse);
  b.internalApplyImpulse(row.m_contactNormal2 * b.internalGetInvMass(), row.m_angularComponentB, impulse);
}

/// @returns the square of the largest residual, at which Bullet ends the iterations when it is zero.
btScalar BulletSolver::solveSingleIteration(int iteration, btCollisionObject** bodies, int body_count,
                                            btPersistentManifold** manifolds, int manifold_count,
                                            btTypedConstraint** constraints, int constraint_count,
                                            const btContactSolverInfo& info, btIDebugDraw* drawer) {
  if (!any_two_rows_) {
    return btSequentialImpulseConstraintSolver::solveSingleIteration(
        iteration, bodies, body_count, manifolds, manifold_count, constraints, constraint_count, info, drawer);
  }
  const int contacts = m_tmpSolverContactConstraintPool.size();
  const int rows = m_tmpSolverContactFrictionConstraintPool.size();
  if ((info.m_solverMode & SOLVER_RANDMIZE_ORDER) != 0) {
    shuffle(m_orderTmpConstraintPool, contacts);
    shuffle(m_orderFrictionConstraintPool, rows);
  }
  btScalar residual = 0;
  for (int i = 0; i < contacts; ++i) {
    residual = std::max(residual, solve_normal(m_tmpSolverContactConstraintPool[m_orderTmpConstraintPool[i]]));
  }
  for (int i = 0; i < rows; ++i) {
    const int row = m_orderFrictionConstraintPool[i];
    const int of_contact = m_tmpSolverContactFrictionConstraintPool[row].m_frictionIndex;
    const btSolverConstraint& contact = m_tmpSolverContactConstraintPool[of_contact];
    if (!two_rows_[static_cast<std::size_t>(of_contact)]) {
      residual = std::max(residual, solve_slip(contact));
    } else if (row == contact.m_frictionIndex) {  // the second row goes with the first
      residual = std::max(residual, solve_cone(contact));
    }
  }
  return residual;
}

void BulletSolver::shuffle(btAlignedObjectArray<int>& order, int count) {
  for (int i = 0; i < count; ++i) std::swap(order[i], order[btRandInt2(i + 1)]);
}

btScalar BulletSolver::solve_normal(const btSolverConstraint& contact) {
  const btScalar left = resolveSingleConstraintRowLowerLimitSIMD(m_tmpSolverBodyPool[contact.m_solverBodyIdA],
                                                                 m_tmpSolverBodyPool[contact.m_solverBodyIdB], contact);
  return left * left;
}

/// As Bullet: one row, along the slip of the step before.
btScalar BulletSolver::solve_slip(const btSolverConstraint& contact) {
  if (static_cast<btScalar>(contact.m_appliedImpulse) <= 0) return 0;
  btSolverConstraint& row = m_tmpSolverContactFrictionConstraintPool[contact.m_frictionIndex];
  row.m_upperLimit = row.m_friction * static_cast<btScalar>(contact.m_appliedImpulse);
  row.m_lowerLimit = -row.m_upperLimit;
  const btScalar left = resolveSingleConstraintRowGenericSIMD(m_tmpSolverBodyPool[contact.m_solverBodyIdA],
                                                              m_tmpSolverBodyPool[contact.m_solverBodyIdB], row);
  return left * left;
}

/// Two rows whose impulses stay within the cone together.
btScalar BulletSolver::solve_cone(const btSolverConstraint& contact) {
  btSolverConstraint& first = m_tmpSolverContactFrictionConstraintPool[contact.m_frictionIndex];
  btSolverConstraint& second = m_tmpSolverContactFrictionConstraintPool[contact.m_frictionIndex + 1];
  const btScalar before[2] = {first.m_appliedImpulse, second.m_appliedImpulse};
  const btScalar bound = first.m_friction * static_cast<btScalar>(contact.m_appliedImpulse);
  btScalar after[2] = {0, 0};
  if (bound > 0) {
    btSolverBody& a = m_tmpSolverBodyPool[contact.m_solverBodyIdA];
    btSolverBody& b = m_tmpSolverBodyPool[contact.m_solverBodyIdB];
    const btScalar step = std::min(first.m_jacDiagABInv, second.m_jacDiagABInv);
    after[0] = before[0] + step * (first.m_rhs / first.m_jacDiagABInv - change_along(first, a, b));
    after[1] = before[1] + step * (second.m_rhs / second.m_jacDiagABInv - change_along(second, a, b));
    const btScalar square = after[0] * after[0] + after[1] * after[1];
    if (square > bound * bound) {
      const btScalar part = bound / btSqrt(square);
      after[0] *= part;
      after[1] *= part;
    }
  }
  push(first, after[0] - before[0]);
  push(second, after[1] - before[1]);
  const btScalar change = std::max(btFabs(after[0] - before[0]), btFabs(after[1] - before[1]));
  return change * change;
}

}  // namespace physics::bullet
