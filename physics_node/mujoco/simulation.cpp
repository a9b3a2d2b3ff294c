#include "physics_node/mujoco/simulation.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "physics_node/mujoco/values.hpp"

// Indices into MuJoCo's arrays are int, as in MuJoCo itself.
// NOLINTBEGIN(bugprone-implicit-widening-of-multiplication-result)
namespace mujoco {
namespace {

using Eigen::Vector3d;

/// MuJoCo requires that it does not return.
void on_error(const char* text) {
  std::fprintf(stderr, "mujoco_engine: MuJoCo: %s\n", text);
  std::_Exit(EXIT_FAILURE);
}
void on_warning(const char* text) { std::fprintf(stderr, "mujoco_engine: MuJoCo: %s\n", text); }

constexpr int kExcluded = 1;  // mjContact::exclude: listed, and carries nothing

mjModel* load(const std::string& xml, const std::string& scene) {
  auto files = std::make_unique<mjVFS>();  // a megabyte
  mj_defaultVFS(files.get());
  const int bytes = static_cast<int>(xml.size()) + 1;
  if (mj_makeEmptyFileVFS(files.get(), "scene.xml", bytes) != 0) {
    throw rtbus::config::Error(scene + ": too large for MuJoCo");
  }
  std::memcpy(files->filedata[mj_findFileVFS(files.get(), "scene.xml")], xml.c_str(), static_cast<std::size_t>(bytes));
  char why[1000] = "";
  mjModel* const model = mj_loadXML("scene.xml", files.get(), why, sizeof why);
  mj_deleteVFS(files.get());
  if (model == nullptr) throw rtbus::config::Error(scene + ": MuJoCo refuses the scene: " + why);
  return model;
}

}  // namespace

void take_errors() {
  mju_user_error = on_error;
  mju_user_warning = on_warning;
}

Simulation::Simulation(const rtbus::config::Scene& scene, const std::vector<ToolShape>& tools, double step_s,
                       double reach_m)
    : model_(nullptr, mj_deleteModel),
      data_(nullptr, mj_deleteData),
      gravity_m_s2_(scene.gravity_m_s2),
      parts_(std::max(1, static_cast<int>(std::ceil(step_s / kLongestPart_s - 1e-9)))) {
  model_.reset(load(mjcf_of(scene, tools, step_s / parts_, reach_m), scene.file));
  data_.reset(mj_makeData(model_.get()));
  body_of_geom_.assign(static_cast<std::size_t>(model_->ngeom), -1);
  tool_of_geom_ = body_of_geom_;
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const std::string name = "b" + std::to_string(i);
    const rtbus::config::Body& from = scene.bodies[i];
    Body body;
    body.geom = mj_name2id(model_.get(), mjOBJ_GEOM, name.c_str());
    body.dynamic = from.type == rtbus::config::BodyType::kDynamic;
    body.id = model_->geom_bodyid[body.geom];
    body.position_m = from.p_WB;
    body.orientation = from.q_WB;
    body.friction = from.friction;
    body.linear_damping_per_s = from.linear_damping_per_s;
    body.angular_damping_per_s = from.angular_damping_per_s;
    body_of_geom_[static_cast<std::size_t>(body.geom)] = static_cast<int>(i);
    bodies_.push_back(body);
  }
  for (std::size_t i = 0; i < tools.size(); ++i) {
    const std::string name = "t" + std::to_string(i);
    const int id = mj_name2id(model_.get(), mjOBJ_BODY, name.c_str());
    Tool tool;
    tool.geom = mj_name2id(model_.get(), mjOBJ_GEOM, name.c_str());
    tool.dof = model_->body_dofadr[id];
    tool.position = model_->jnt_qposadr[model_->body_jntadr[id]];
    tool.shape = tools[i];
    tool_of_geom_[static_cast<std::size_t>(tool.geom)] = static_cast<int>(i);
    tools_.push_back(tool);
  }
  mj_forward(model_.get(), data_.get());
}

int Simulation::tool_of(int geom) const { return tool_of_geom_[static_cast<std::size_t>(geom)]; }

double Simulation::friction_of(int geom) const {
  if (const int tool = tool_of(geom); tool >= 0) return tools_[static_cast<std::size_t>(tool)].hand.friction;
  const int body = body_of_geom_[static_cast<std::size_t>(geom)];
  return body < 0 ? 0.0 : bodies_[static_cast<std::size_t>(body)].friction;
}

void Simulation::set_hand(std::size_t index, const rtbus_engine_hand& hand) {
  Tool& tool = tools_[index];
  tool.hand = hand;
  const Vector3d target_m = ConstVector(hand.target_position_m);
  if (hand.reset != 0) {
    place(tool, target_m, Vector3d::Zero());
    tool.previous_target_m = target_m;
  }
  if (hand.tool == RTBUS_TOOL_PLACED) place(tool, target_m, ConstVector(hand.target_velocity_m_s));
}

void Simulation::place(Tool& tool, const Vector3d& position_m, const Vector3d& velocity_m_s) {
  MutableVector(data_->qpos + tool.position) = position_m;
  MutableVector(data_->qvel + tool.dof) = velocity_m_s;
}

/// The spring, solved implicitly: its dofs get the inertia a = m + h·b + h²·k, and the force that makes the velocity
/// after the part (m·v + h·(k·(x_t − x) + b·v_t + F))/a where nothing touches. `done`: 0…1 of the step after it.
void Simulation::pull(Tool& tool, double done) {
  MutableVector applied(data_->qfrc_applied + tool.dof);
  MutableVector armature(model_->dof_armature + tool.dof);
  applied = -tool.shape.mass_kg * gravity_m_s2_;  // the spring carries it
  armature.setZero();
  // MuJoCo takes the mass matrix of a body on sliders from here, not from the armature.
  MutableVector mass(model_->dof_M0 + tool.dof);
  mass.setConstant(tool.shape.mass_kg);
  if (tool.hand.tool != RTBUS_TOOL_SPRING) {
    const bool placed = tool.hand.tool == RTBUS_TOOL_PLACED;
    place(tool,
          placed ? Vector3d(ConstVector(tool.hand.target_position_m))
                 : Vector3d(ConstVector(data_->qpos + tool.position)),
          placed ? Vector3d(ConstVector(tool.hand.target_velocity_m_s)) : Vector3d::Zero());
    return;
  }
  const double h = model_->opt.timestep, k = tool.hand.stiffness_n_per_m, b = tool.hand.damping_n_s_per_m;
  const Vector3d end_m = ConstVector(tool.hand.target_position_m);
  tool.target_m = tool.previous_target_m + done * (end_m - tool.previous_target_m);
  const Vector3d x = ConstVector(data_->qpos + tool.position), v = ConstVector(data_->qvel + tool.dof);
  applied += k * (tool.target_m - x) + b * ConstVector(tool.hand.target_velocity_m_s) + ConstVector(tool.hand.force_n) -
             (b + h * k) * v;
  armature.setConstant(h * b + h * h * k);
  mass += armature;
}

void Simulation::push_bodies() {
  std::fill_n(data_->xfrc_applied, 6 * model_->nbody, 0.0);
  for (const Tool& tool : tools_) {
    for (std::uint32_t i = 0; i < tool.hand.pushes; ++i) {
      const rtbus_engine_push& push = tool.hand.push[i];
      if (push.body >= bodies_.size()) continue;
      mjtNum* const applied = data_->xfrc_applied + 6 * bodies_[push.body].id;
      MutableVector(applied + 0) += ConstVector(push.force_n);
      MutableVector(applied + 3) += ConstVector(push.torque_n_m);
    }
  }
  for (const Body& body : bodies_) {
    if (body.linear_damping_per_s == 0.0 && body.angular_damping_per_s == 0.0) continue;
    mjtNum* const applied = data_->xfrc_applied + 6 * body.id;
    const mjtNum* const velocity = data_->qvel + model_->body_dofadr[body.id];
    const double mass_kg = model_->body_mass[body.id];
    const double inertia = ConstVector(model_->body_inertia + 3 * body.id).mean();
    MutableVector(applied + 0) -= mass_kg * body.linear_damping_per_s * ConstVector(velocity);
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> turned(data_->xmat + 9 * body.id);
    MutableVector(applied + 3) -= inertia * body.angular_damping_per_s * (turned * ConstVector(velocity + 3));
  }
}

/// What mj_fwdPosition does, with our law of friction between finding contacts and solving them: the product of both
/// coefficients, where MuJoCo takes the larger one. Contacts of a tool that the haptic loop simulates carry nothing.
void Simulation::find_contacts() {
  mjModel* const m = model_.get();
  mjData* const d = data_.get();
  mj_kinematics(m, d);
  mj_comPos(m, d);
  mj_camlight(m, d);
  mj_tendon(m, d);
  mj_crb(m, d);
  mj_factorM(m, d);
  mj_collision(m, d);
  for (int i = 0; i < d->ncon; ++i) {
    mjContact& contact = d->contact[i];
    contact.friction[0] = contact.friction[1] =
        std::max(mjMINMU, friction_of(contact.geom1) * friction_of(contact.geom2));
    for (const int geom : {contact.geom1, contact.geom2}) {
      const int tool = tool_of(geom);
      if (tool >= 0 && tools_[static_cast<std::size_t>(tool)].hand.tool != RTBUS_TOOL_SPRING)
        contact.exclude = kExcluded;
    }
  }
  mj_makeConstraint(m, d);
  mj_transmission(m, d);
  mj_projectConstraint(m, d);
}

void Simulation::advance() {
  mjModel* const m = model_.get();
  mjData* const d = data_.get();
  mj_checkPos(m, d);
  mj_checkVel(m, d);
  find_contacts();
  mj_fwdVelocity(m, d);
  mj_fwdActuation(m, d);
  mj_fwdAcceleration(m, d);
  mj_fwdConstraint(m, d);
}

void Simulation::step() {
  for (Tool& tool : tools_) {
    tool.contact_force_n.setZero();
    tool.spring_force_n.setZero();
    tool.contacts = 0;
  }
  for (int part = 1; part <= parts_; ++part) {
    for (Tool& tool : tools_) pull(tool, static_cast<double>(part) / parts_);
    push_bodies();
    advance();
    take_tool_forces(1.0 / parts_);
    if (part == parts_) take_loads();
    mj_Euler(model_.get(), data_.get());
    take_spring_forces(1.0 / parts_);
  }
  for (Tool& tool : tools_) {
    tool.previous_target_m = ConstVector(tool.hand.target_position_m);
    if (tool.hand.tool == RTBUS_TOOL_PLACED) {
      place(tool, tool.previous_target_m, ConstVector(tool.hand.target_velocity_m_s));
    }
  }
  // Where everything is now: what is told belongs to the end of the step.
  mj_kinematics(model_.get(), data_.get());
  mj_comPos(model_.get(), data_.get());
  mj_collision(model_.get(), data_.get());
  overflows_ = data_->warning[mjWARN_CONTACTFULL].number + data_->warning[mjWARN_CNSTRFULL].number;
}

/// By the implicit spring: where the tool is after the part.
void Simulation::take_spring_forces(double share) {
  for (Tool& tool : tools_) {
    const rtbus_engine_hand& hand = tool.hand;
    if (hand.tool != RTBUS_TOOL_SPRING) continue;
    const Vector3d x = ConstVector(data_->qpos + tool.position), v = ConstVector(data_->qvel + tool.dof);
    tool.spring_force_n +=
        share * (hand.stiffness_n_per_m * (tool.target_m - x) +
                 hand.damping_n_s_per_m * (ConstVector(hand.target_velocity_m_s) - v) + ConstVector(hand.force_n));
  }
}

void Simulation::take_tool_forces(double share) {
  for (int i = 0; i < data_->ncon; ++i) {
    const mjContact& contact = data_->contact[i];
    if (contact.efc_address < 0) continue;
    for (const int geom : {contact.geom1, contact.geom2}) {
      const int index = tool_of(geom);
      if (index < 0) continue;
      mjtNum force[6];
      mj_contactForce(model_.get(), data_.get(), i, force);
      // Rows of `frame` are the axes; the force acts on geom2.
      const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> axes(contact.frame);
      const double sign = geom == contact.geom2 ? 1.0 : -1.0;
      Tool& tool = tools_[static_cast<std::size_t>(index)];
      tool.contact_force_n += share * sign * (axes.transpose() * ConstVector(force));
      if (force[0] > 0.0) tool.contacts = std::max(tool.contacts, 1U);
    }
  }
}

void Simulation::add_load(std::size_t index, int number, double sign, const mjtNum* force) {
  Body& body = bodies_[index];
  const mjContact& contact = data_->contact[number];
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> axes(contact.frame);
  const Vector3d arm_m = ConstVector(contact.pos) - ConstVector(data_->xipos + 3 * body.id);
  const Vector3d normal_n = sign * force[0] * axes.row(0).transpose();
  const Vector3d friction_n = sign * (force[1] * axes.row(1) + force[2] * axes.row(2)).transpose();
  body.external_force_n += normal_n;
  body.external_torque_n_m += arm_m.cross(normal_n);
  body.friction_force_n += friction_n;
  body.friction_torque_n_m += arm_m.cross(friction_n);
  body.friction_bound_n += contact.friction[0] * force[0];
}

void Simulation::add_support(std::size_t index, std::size_t other, int number, double sign, double force_n) {
  const mjContact& contact = data_->contact[number];
  std::size_t row = 0;
  while (row < supports_.size() && (supports_[row].body != index || support_other_[row] != other)) ++row;
  if (row == supports_.size()) {
    supports_.push_back(sized<rtbus_engine_support>());
    support_other_.push_back(other);
    supports_.back().body = static_cast<std::uint32_t>(index);
    const Body& holds = bodies_[other];
    supports_.back().inverse_mass_per_kg = holds.dynamic ? 1.0 / model_->body_mass[holds.id] : 0.0;
    supports_.back().friction = contact.friction[0];
  }
  rtbus_engine_support& support = supports_[row];
  const double before_n = support.force_n;
  support.force_n += force_n;
  MutableVector point(support.point_m), normal(support.normal);
  point = (before_n * Vector3d(point) + force_n * ConstVector(contact.pos)) / support.force_n;
  normal = (before_n * Vector3d(normal) + force_n * sign * ConstVector(contact.frame)).normalized();
  ++support.points;
}

/// Forces of the bodies on each other, in the last part of the step.
void Simulation::take_loads() {
  supports_.clear();
  support_other_.clear();
  for (Body& body : bodies_) {
    body.external_force_n = body.dynamic ? Vector3d(model_->body_mass[body.id] * gravity_m_s2_) : Vector3d::Zero();
    body.external_torque_n_m.setZero();
    body.friction_force_n.setZero();
    body.friction_torque_n_m.setZero();
    body.friction_bound_n = 0.0;
  }
  for (int i = 0; i < data_->ncon; ++i) {
    const mjContact& contact = data_->contact[i];
    const int first = body_of_geom_[static_cast<std::size_t>(contact.geom1)];
    const int second = body_of_geom_[static_cast<std::size_t>(contact.geom2)];
    if (contact.efc_address < 0 || first < 0 || second < 0) continue;
    mjtNum force[6];
    mj_contactForce(model_.get(), data_.get(), i, force);
    if (force[0] <= 0.0) continue;
    const auto a = static_cast<std::size_t>(first), b = static_cast<std::size_t>(second);
    if (bodies_[b].dynamic) add_load(b, i, 1.0, force), add_support(b, a, i, 1.0, force[0]);
    if (bodies_[a].dynamic) add_load(a, i, -1.0, force), add_support(a, b, i, -1.0, force[0]);
  }
  for (std::size_t i = 0; i < supports_.size(); ++i) {
    const Body& holds = bodies_[support_other_[i]];
    if (!holds.dynamic) continue;
    mjtNum velocity[6];  // angular, then linear, at the centre of mass, in W
    mj_objectVelocity(model_.get(), data_.get(), mjOBJ_BODY, holds.id, velocity, 0);
    const Vector3d arm_m = ConstVector(supports_[i].point_m) - ConstVector(data_->xipos + 3 * holds.id);
    put(Vector3d(ConstVector(velocity + 3) + Vector3d(ConstVector(velocity)).cross(arm_m)),
        supports_[i].surface_velocity_m_s);
  }
}

}  // namespace mujoco
// NOLINTEND(bugprone-implicit-widening-of-multiplication-result)
