#include "rtbus/config/soft_body.hpp"

#include <cstdint>
#include <string_view>
#include <vector>

#include "rtbus/config/closed_surface.hpp"

namespace rtbus::config {
namespace {

constexpr std::size_t kMaxNodes = 20000;
constexpr std::size_t kMaxBendingNodes = 5000;  // Bullet finds the pairs in a table of nodes × nodes
constexpr Range kShare{0.0, 1.0};
constexpr Range kLength_m{1e-3, 100.0};

std::shared_ptr<const TriangleMesh> read_generated(Map& mesh, const char* kind) {
  Map keys = mesh.map(kind);
  const bool rabbit = std::string_view(kind) == "rabbit";
  const double length_m = keys.number(rabbit ? "height_m" : "radius_m", kLength_m);
  const auto nodes = static_cast<std::size_t>(keys.integer("nodes", 20, 5000, 453));
  keys.finish();
  return std::make_shared<const TriangleMesh>(rabbit ? make_rabbit(nodes, length_m) : make_ball(nodes, length_m));
}

std::shared_ptr<const TriangleMesh> read_skin(Map& mesh) {
  Map keys = mesh.map("obj");
  const auto out = read_mesh_file(keys);
  if (out->triangles.empty()) keys.fail("file", "has no face (no line that begins with f), so there is no surface");
  if (out->vertices_m.size() > kMaxNodes) {
    keys.fail("file", "has " + std::to_string(out->vertices_m.size()) + " vertices; a soft body may have " +
                          std::to_string(kMaxNodes));
  }
  if (const std::string fault = skin_fault(*out); !fault.empty()) keys.fail("file", "is no skin: " + fault);
  keys.finish();
  return out;
}

std::shared_ptr<const TriangleMesh> read_mesh(Map& body) {
  Map mesh = body.map("mesh");
  const std::vector<std::string> names = mesh.keys();
  constexpr const char* kKnown = "this build knows rabbit, ball, obj";
  if (names.size() != 1) body.fail("mesh", std::string("needs exactly one way to make it; ") + kKnown);
  std::shared_ptr<const TriangleMesh> out;
  if (names.front() == "rabbit" || names.front() == "ball") {
    out = read_generated(mesh, names.front().c_str());
  } else if (names.front() == "obj") {
    out = read_skin(mesh);
  } else {
    body.fail("mesh", "is made in a way that is not known: " + names.front() + "; " + kKnown);
  }
  mesh.finish();
  return out;
}

}  // namespace

SoftBody read_soft_body(Map& map) {
  SoftBody body;
  body.mesh = read_mesh(map);
  body.mass_kg = map.number("mass_kg", {1e-6, 1e4});
  body.linear_stiffness = map.number("linear_stiffness", {1e-3, 1.0}, body.linear_stiffness);
  body.bending_stiffness = map.number("bending_stiffness", kShare, body.bending_stiffness);
  body.pose_matching_hz = map.number("pose_matching_hz", {0.0, 1000.0}, body.pose_matching_hz);
  body.bulk_modulus_pa = map.number("bulk_modulus_pa", {0.0, 1e9}, body.bulk_modulus_pa);
  body.pressure_pa = map.number("pressure_pa", {0.0, 1e6}, body.pressure_pa);
  body.damping_per_s = map.number("damping_per_s", {0.0, 1000.0}, body.damping_per_s);
  body.friction = map.number("friction", {0.0, 2.0}, body.friction);
  body.contact_hardness = map.number("contact_hardness", kShare, body.contact_hardness);
  body.margin_m = map.number("margin_m", {1e-5, 1.0}, body.margin_m);
  body.position_iterations = static_cast<int>(map.integer("position_iterations", 1, 200, body.position_iterations));
  body.velocity_iterations = static_cast<int>(map.integer("velocity_iterations", 0, 200, body.velocity_iterations));
  body.clusters = static_cast<int>(map.integer("clusters", 0, 256, body.clusters));
  body.cluster_iterations = static_cast<int>(map.integer("cluster_iterations", 1, 200, body.cluster_iterations));
  if (body.velocity_iterations > 0 && body.pose_matching_hz > 0.0) {
    map.fail(
        "velocity_iterations",
        "sets positions anew from velocities, which undoes pose matching; write pose_matching_hz: 0, or leave it out");
  }
  if (body.bending_stiffness > 0.0 && body.mesh->vertices_m.size() > kMaxBendingNodes) {
    map.fail("bending_stiffness", "can be had for up to " + std::to_string(kMaxBendingNodes) +
                                      " nodes, and the mesh has " + std::to_string(body.mesh->vertices_m.size()));
  }
  const std::string fault = closed_fault(*body.mesh);
  body.closed = fault.empty();
  for (const char* key : {"bulk_modulus_pa", "pressure_pa"}) {
    if (!body.closed && map.has(key) && map.number(key, {}) > 0.0) {
      map.fail(key, "needs a closed surface, and " + (body.mesh->file.empty() ? "this mesh" : body.mesh->file) +
                        " is none: " + fault + "; close it, or write 0");
    }
  }
  return body;
}

}  // namespace rtbus::config
