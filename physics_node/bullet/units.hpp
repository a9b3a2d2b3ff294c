#pragma once
/// @file units.hpp
/// Between SI and Bullet's units. Bullet has absolute tolerances (0.02 units around every bounding box, a margin of
/// 0.04 units), made for bodies of a few units. A world of millimetres is therefore enlarged: lengths × S, and with
/// them velocities and gravity; masses, times and angles stay.
#include <Eigen/Core>
#include <Eigen/Geometry>

#include <btBulletDynamicsCommon.h>

namespace physics::bullet {

/// Of a body that forces move.
inline double mass_kg(const btRigidBody& body) { return 1.0 / static_cast<double>(body.getInvMass()); }

inline btVector3 to_bullet(const Eigen::Vector3d& v, double scale = 1.0) {
  return {static_cast<btScalar>(v.x() * scale), static_cast<btScalar>(v.y() * scale),
          static_cast<btScalar>(v.z() * scale)};
}

/// Bullet's constructor takes (x, y, z, w).
inline btQuaternion to_bullet(const Eigen::Quaterniond& q) {
  return {static_cast<btScalar>(q.x()), static_cast<btScalar>(q.y()), static_cast<btScalar>(q.z()),
          static_cast<btScalar>(q.w())};
}

inline Eigen::Vector3d from_bullet(const btVector3& v, double scale = 1.0) {
  return {static_cast<double>(v.x()) / scale, static_cast<double>(v.y()) / scale, static_cast<double>(v.z()) / scale};
}

inline Eigen::Quaterniond from_bullet(const btQuaternion& q) {
  return Eigen::Quaterniond(static_cast<double>(q.w()), static_cast<double>(q.x()), static_cast<double>(q.y()),
                            static_cast<double>(q.z()))
      .normalized();
}

}  // namespace physics::bullet
