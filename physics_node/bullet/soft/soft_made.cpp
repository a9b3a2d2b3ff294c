#include "physics_node/bullet/soft/soft_made.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "rtbus/config/closed_surface.hpp"
#include "rtbus/three_digits.hpp"

namespace physics::bullet {
namespace {

using Eigen::Vector3d;
using rtbus::three_digits;
namespace config = rtbus::config;

constexpr int kBendingDistance = 2;  // edges

double area_of(const config::TriangleMesh& mesh) {
  double area_m2 = 0.0;
  for (const auto& t : mesh.triangles) {
    const Vector3d& a = mesh.vertices_m[t[0]];
    area_m2 += 0.5 * (mesh.vertices_m[t[1]] - a).cross(mesh.vertices_m[t[2]] - a).norm();
  }
  return area_m2;
}

double matching_share(double frequency_hz, double h) {
  const double turn = 2.0 * std::numbers::pi * frequency_hz * h;
  return std::min(turn * turn, 1.0);
}

}  // namespace

MadeSoftBody::MadeSoftBody(const config::SoftBody& body, btSoftBodyWorldInfo& info, double scale)
    : body_(body), scale_(scale) {
  const config::TriangleMesh& mesh = *body.mesh;
  for (const Vector3d& vertex : mesh.vertices_m) placed_.push_back(to_bullet(body.p_WB + body.q_WB * vertex, scale));
  soft_ = std::make_unique<btSoftBody>(&info, static_cast<int>(placed_.size()), placed_.data(), nullptr);
  soft_->getCollisionShape()->setMargin(static_cast<btScalar>(body.margin_m * scale));

  btSoftBody::Material& skin = *soft_->m_materials[0];
  skin.m_kLST = static_cast<btScalar>(body.linear_stiffness);
  for (const auto& [a, b] : config::edges_of(mesh)) soft_->appendLink(static_cast<int>(a), static_cast<int>(b));
  for (const auto& t : mesh.triangles) {
    faces_.push_back({static_cast<int>(t[0]), static_cast<int>(t[1]), static_cast<int>(t[2])});
    soft_->appendFace(faces_.back()[0], faces_.back()[1], faces_.back()[2]);
  }
  for (int i = 0; i < soft_->m_links.size(); ++i) mean_edge_m_ += static_cast<double>(soft_->m_links[i].m_rl) / scale;
  mean_edge_m_ /= std::max(soft_->m_links.size(), 1);
  if (body.bending_stiffness > 0.0) {
    btSoftBody::Material* const bending = soft_->appendMaterial();
    bending->m_kLST = static_cast<btScalar>(body.bending_stiffness);
    soft_->generateBendingConstraints(kBendingDistance, bending);
  }
  soft_->setTotalMass(static_cast<btScalar>(body.mass_kg), true);

  btSoftBody::Config& settings = soft_->m_cfg;
  settings.piterations = body.position_iterations;
  settings.viterations = body.velocity_iterations;
  settings.citerations = body.cluster_iterations;
  // Contacts last: what rests on the floor then stays to the last bit where it is. In Bullet's order links move its
  // nodes after friction has held them, and it creeps.
  settings.m_psequence.resize(0);
  for (const auto part :
       {btSoftBody::ePSolver::SContacts, btSoftBody::ePSolver::Linear, btSoftBody::ePSolver::RContacts}) {
    settings.m_psequence.push_back(part);
  }
  settings.collisions = body.clusters > 0 ? btSoftBody::fCollision::CL_SS : btSoftBody::fCollision::VF_SS;
  settings.kDF = static_cast<btScalar>(body.friction);
  soft_->setPose(body.closed, true);  // where it has turned to is asked for without matching, too
  soft_->updateNormals();
  if (body.clusters > 0) soft_->generateClusters(body.clusters);
  soft_->randomizeConstraints();  // a fixed order bends the body to one side

  area_m2_ = area_of(mesh);
  volume_m3_ = body.closed ? config::enclosed_volume_m3(mesh) : 0.0;
}

double MadeSoftBody::stiffest_pa(double h) const {
  if (area_m2_ <= 0.0) return 0.0;
  return kMaxBreathing * kMaxBreathing * volume_m3_ * body_.mass_kg / (h * h * area_m2_ * area_m2_);
}

void MadeSoftBody::set_coefficients(double h) {
  step_s_ = h;
  soft_->m_cfg.kMT = static_cast<btScalar>(matching_share(body_.pose_matching_hz, h));
  soft_->m_cfg.kDP = static_cast<btScalar>(-std::expm1(-body_.damping_per_s * h));
  const double wanted_pa = body_.bulk_modulus_pa + body_.pressure_pa;
  carried_ = wanted_pa > 0.0 ? std::min(1.0, stiffest_pa(h) / wanted_pa) : 0.0;
}

void MadeSoftBody::before_step(double h) {
  if (h != step_s_) set_coefficients(h);
  if (body_.closed && carried_ > 0.0) press();
}

void MadeSoftBody::press() {
  const double volume_m3 = volume();
  if (!(volume_m3 > kSmallestVolume * volume_m3_)) return;  // sound() will say what is to be done
  const double lost = 1.0 - volume_m3 / volume_m3_;
  const double pressure_pa = carried_ * (body_.pressure_pa * volume_m3_ / volume_m3 + body_.bulk_modulus_pa * lost);
  // Twice the area vector, a third of it, and force = S · force in newtons from an area in units² = S² m².
  const auto factor = static_cast<btScalar>(pressure_pa / (6.0 * scale_));
  for (const auto& [a, b, c] : faces_) {
    const btVector3& corner = soft_->m_nodes[a].m_x;
    const btVector3 force = (soft_->m_nodes[b].m_x - corner).cross(soft_->m_nodes[c].m_x - corner) * factor;
    for (const int node : {a, b, c}) soft_->m_nodes[node].m_f += force;
  }
}

double MadeSoftBody::volume() const {
  const btVector3& origin = soft_->m_nodes[0].m_x;
  btScalar six = 0;
  for (const auto& [a, b, c] : faces_) {
    six += (soft_->m_nodes[a].m_x - origin).dot((soft_->m_nodes[b].m_x - origin).cross(soft_->m_nodes[c].m_x - origin));
  }
  return static_cast<double>(six) / (6.0 * scale_ * scale_ * scale_);
}

bool MadeSoftBody::sound() const {
  for (int i = 0; i < soft_->m_nodes.size(); ++i) {
    const btSoftBody::Node& node = soft_->m_nodes[i];
    const Vector3d x = from_bullet(node.m_x);
    if (!x.allFinite() || x.cwiseAbs().maxCoeff() > kMaxUnits || !from_bullet(node.m_v).allFinite()) return false;
  }
  if (!body_.closed) return true;
  const double volume_m3 = volume();
  return std::isfinite(volume_m3) && volume_m3 > kSmallestVolume * volume_m3_;
}

void MadeSoftBody::put_back() {
  for (int i = 0; i < soft_->m_nodes.size(); ++i) {
    btSoftBody::Node& node = soft_->m_nodes[i];
    node.m_x = node.m_q = placed_[static_cast<std::size_t>(i)];
    node.m_v = node.m_vn = node.m_f = btVector3(0, 0, 0);
  }
  soft_->m_rcontacts.resizeNoInitialize(0);
  soft_->m_scontacts.resizeNoInitialize(0);
  soft_->updateNormals();
  // The trees of nodes and faces grow from what they were: not from what is not finite.
  soft_->rebuildNodeTree();
  if (!soft_->m_fdbvt.empty()) soft_->initializeFaceTree();
  soft_->updateBounds();
}

std::string MadeSoftBody::complaint(double h) const {
  const double wanted_pa = body_.bulk_modulus_pa + body_.pressure_pa;
  if (body_.closed && wanted_pa > stiffest_pa(h)) {
    return "bulk_modulus_pa and pressure_pa together are " + three_digits(wanted_pa) + " Pa; a step of " +
           three_digits(h * 1e3) + " ms carries " + three_digits(stiffest_pa(h)) +
           " Pa, to which they are lowered; raise physics.rate_hz or substeps";
  }
  if (2.0 * std::numbers::pi * body_.pose_matching_hz * h > 1.0) {
    return "pose_matching_hz = " + three_digits(body_.pose_matching_hz) + " is above " +
           three_digits(0.5 / (std::numbers::pi * h)) + " Hz, which is rigid at a step of " + three_digits(h * 1e3) +
           " ms";
  }
  return {};
}

}  // namespace physics::bullet
