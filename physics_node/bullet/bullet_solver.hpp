#pragma once
/// @file bullet_solver.hpp
/// Bullet's contact solver with bounces as high as their restitution says, and friction that holds.
#include <cstddef>
#include <vector>

#include <btBulletDynamicsCommon.h>

namespace physics::bullet {

/// Bounces. Bullet finds a contact when the bodies already overlap, by up to the way of one step, and adds the speed
/// that pushes a fifth of that depth out in one step to the speed after the bounce: on average a tenth of the impact
/// speed too much. Here a contact that bounces in this step is not pushed out in it: the bounce itself separates the
/// bodies.
///
/// Friction. Bullet gives a contact point one row of friction, along the slip of the step before, and starts it from
/// zero. A block that a hand pushed below the bound crept, because the slip of a block at rest is noise: the row stood
/// across the push. Here a point between bodies of a small group (kMostTogether) has two fixed directions,
/// its impulse begins with that of the last step, and both parts together stay within the friction cone.
/// One step length for both directions keeps the impulse of a point that slides opposite to its slip (projected
/// Gauss-Seidel on a disc; M. Jean, "The non-smooth contact dynamics method", CMAME 177, 1999). All normal impulses of
/// an iteration come before all friction: interleaved, a block at 80 % of the bound crept five to forty times as far.
/// In a pile friction stays Bullet's (docs/decisions/0020).
///
/// The world has no joints and no rolling friction; this solver has rows for contacts only.
class BulletSolver final : public btSequentialImpulseConstraintSolver {
 public:
  /// So many bodies on each other get friction that holds. Taller stacks of light ones, of different masses, rattled by
  /// it: 18 of 500 felt by 20 mN and more, and not 4 (docs/decisions/0020).
  static constexpr std::size_t kMostOnEachOther = 3;
  /// Nor do groups of which one is so many times as heavy as another. Without this limit 4 of 3000 stacks of two or
  /// three diverged, and none with it.
  static constexpr double kMostUnequal = 30.0;

  /// Whether two bodies of the scene that can both be moved, or move by themselves, touch in it. A hand's body, which
  /// has no number, makes no pile.
  [[nodiscard]] static bool joins_pile(const btPersistentManifold& manifold);

 private:
  void convertContacts(btPersistentManifold** manifolds, int count, const btContactSolverInfo& info) override;
  btScalar solveSingleIteration(int iteration, btCollisionObject** bodies, int body_count,
                                btPersistentManifold** manifolds, int manifold_count, btTypedConstraint** constraints,
                                int constraint_count, const btContactSolverInfo& info, btIDebugDraw* drawer) override;
  btScalar solveGroupCacheFriendlyFinish(btCollisionObject** bodies, int body_count,
                                         const btContactSolverInfo& info) override;

  void find_piles(btPersistentManifold** manifolds, int count);
  void find_far_from_ground(btPersistentManifold** manifolds, int count);
  [[nodiscard]] bool holds_up(const btCollisionObject& body, std::size_t on_each_other) const;
  [[nodiscard]] std::size_t group_of(int body);
  [[nodiscard]] bool in_pile(const btCollisionObject& body) const;
  void start_friction(const btSolverConstraint& contact, bool two_rows);
  void shuffle(btAlignedObjectArray<int>& order, int count);
  btScalar solve_normal(const btSolverConstraint& contact);
  btScalar solve_slip(const btSolverConstraint& contact);
  btScalar solve_cone(const btSolverConstraint& contact);
  void push(btSolverConstraint& row, btScalar impulse);

  bool any_two_rows_ = false;
  std::vector<bool> two_rows_;      ///< Of each contact.
  std::vector<std::size_t> group_;  ///< By the solver's number of a body: one that is nearer to the head of its group.
  std::vector<bool> far_from_ground_;  ///< Likewise: see find_far_from_ground().
  std::vector<bool> in_pile_;          ///< By the solver's number of a body, for the step that is being solved.
};

}  // namespace physics::bullet
