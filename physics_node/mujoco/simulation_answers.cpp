// What Simulation tells after a step.
#include <algorithm>

#include "physics_node/mujoco/simulation.hpp"
#include "physics_node/mujoco/values.hpp"

// Indices into MuJoCo's arrays are int, as in MuJoCo itself.
// NOLINTBEGIN(bugprone-implicit-widening-of-multiplication-result)
namespace mujoco {

using Eigen::Vector3d;

rtbus_engine_tool Simulation::tool(std::size_t index) const {
  const Tool& from = tools_[index];
  rtbus_engine_tool out = sized<rtbus_engine_tool>();
  put(ConstVector(data_->qpos + from.position), out.position_m);
  put(ConstVector(data_->qvel + from.dof), out.velocity_m_s);
  put(from.contact_force_n, out.contact_force_n);
  put(from.spring_force_n, out.spring_force_n);
  out.tells_spring_force = 1;
  out.contacts = from.contacts;
  return out;
}

/// Orientation and principal moments: in the axes of the scene's body, which viewers draw, where they are principal
/// ones. A hull keeps MuJoCo's axes and centre.
void Simulation::take_axes(int id, rtbus_engine_body& out) const {
  const Eigen::Quaterniond q(model_->body_iquat[4 * id], model_->body_iquat[4 * id + 1], model_->body_iquat[4 * id + 2],
                             model_->body_iquat[4 * id + 3]);
  const Eigen::Matrix3d axes = q.toRotationMatrix();
  const Eigen::Matrix3d inertia = axes * ConstVector(model_->body_inertia + 3 * id).asDiagonal() * axes.transpose();
  const Eigen::Matrix3d diagonal = inertia.diagonal().asDiagonal();
  if ((inertia - diagonal).norm() < 1e-9 * inertia.trace()) {
    std::copy_n(data_->xquat + 4 * id, 4, out.orientation_wxyz);
    put(Vector3d(inertia.diagonal()), out.inertia_kg_m2);
  } else {
    mju_mat2Quat(out.orientation_wxyz, data_->ximat + 9 * id);
    std::copy_n(model_->body_inertia + 3 * id, 3, out.inertia_kg_m2);
  }
}

rtbus_engine_body Simulation::body(std::size_t index) const {
  const Body& from = bodies_[index];
  rtbus_engine_body out = sized<rtbus_engine_body>();
  out.kind = from.dynamic ? RTBUS_BODY_DYNAMIC : RTBUS_BODY_STATIC;
  if (!from.dynamic) {
    put(from.position_m, out.position_m);
    put(from.orientation, out.orientation_wxyz);
    return out;
  }
  put(ConstVector(data_->xipos + 3 * from.id), out.position_m);
  take_axes(from.id, out);
  const mjtNum* const velocity = data_->qvel + model_->body_dofadr[from.id];
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> turned(data_->xmat + 9 * from.id);
  const Vector3d angular = turned * ConstVector(velocity + 3);  // a free joint tells it in the body's frame
  const Vector3d arm_m = ConstVector(data_->xipos + 3 * from.id) - ConstVector(data_->xpos + 3 * from.id);
  put(Vector3d(ConstVector(velocity) + angular.cross(arm_m)), out.velocity_m_s);
  put(angular, out.angular_velocity_rad_s);
  out.mass_kg = model_->body_mass[from.id];
  put(from.external_force_n, out.external_force_n);
  put(from.external_torque_n_m, out.external_torque_n_m);
  put(from.friction_force_n, out.friction_force_n);
  put(from.friction_torque_n_m, out.friction_torque_n_m);
  out.friction_bound_n = from.friction_bound_n;
  return out;
}

std::vector<rtbus_engine_contact> Simulation::contacts(std::size_t index) const {
  std::vector<rtbus_engine_contact> out;
  for (int i = 0; i < data_->ncon; ++i) {
    const mjContact& contact = data_->contact[i];
    const bool second = contact.geom2 == tools_[index].geom;
    if (!second && contact.geom1 != tools_[index].geom) continue;
    const int body = body_of_geom_[static_cast<std::size_t>(second ? contact.geom1 : contact.geom2)];
    if (body < 0) continue;  // another tool
    rtbus_engine_contact each = sized<rtbus_engine_contact>();
    const Vector3d normal = (second ? 1.0 : -1.0) * Vector3d(ConstVector(contact.frame));
    // `pos` is in the middle between the surfaces.
    put(Vector3d(ConstVector(contact.pos) - 0.5 * contact.dist * normal), each.point_m);
    put(normal, each.normal);
    each.body = static_cast<std::uint32_t>(body);
    each.gap_m = contact.dist + std::max(0.0, kPoint_m - tools_[index].shape.radius_m);
    each.friction = tools_[index].hand.friction * bodies_[static_cast<std::size_t>(body)].friction;
    if (model_->geom_type[bodies_[static_cast<std::size_t>(body)].geom] == mjGEOM_SPHERE) {
      each.curvature_per_m = 1.0 / model_->geom_size[3 * bodies_[static_cast<std::size_t>(body)].geom];
    }
    out.push_back(each);
  }
  return out;
}

}  // namespace mujoco
// NOLINTEND(bugprone-implicit-widening-of-multiplication-result)
