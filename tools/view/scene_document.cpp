#include "tools/view/scene_document.hpp"

#include <algorithm>
#include <map>
#include <numeric>
#include <utility>
#include <variant>

#include "tools/view/protocol.hpp"

namespace view {

namespace {

using Json = nlohmann::ordered_json;
using rtbus::config::TriangleMesh;

Json json_of(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }
Json json_of(const Eigen::Quaterniond& q) { return {q.w(), q.x(), q.y(), q.z()}; }

/// Gives each mesh that is drawn a number, and says which are too large.
class Meshes {
 public:
  Meshes(ViewScene& scene, Json& notes) : scene_(scene), notes_(notes) {}

  /// The shape of a mesh, or of the box around it. @param kind "mesh" or "hull".
  Json shape(const char* kind, const std::shared_ptr<const TriangleMesh>& mesh) {
    if (mesh->triangles.empty() || mesh->triangles.size() > kMostTriangles) return box_around(*mesh);
    return {{"kind", kind}, {"mesh", number(mesh)}};
  }
  std::size_t number(const std::shared_ptr<const TriangleMesh>& mesh) {
    const auto [entry, first] = numbers_.try_emplace(mesh.get(), scene_.meshes.size());
    if (first) scene_.meshes.push_back(mesh);
    return entry->second;
  }

 private:
  Json box_around(const TriangleMesh& mesh) {
    if (noted_.emplace(&mesh, true).second) {
      notes_.push_back(mesh.triangles.empty()
                           ? mesh.file + " has no faces: its body is shown as the box around it"
                           : mesh.file + " has " + std::to_string(mesh.triangles.size()) +
                                 " triangles, more than the viewer's limit of " + std::to_string(kMostTriangles) +
                                 ": its body is shown as the box around it");
    }
    Eigen::Vector3d low = mesh.vertices_m.front(), high = low;
    for (const Eigen::Vector3d& v : mesh.vertices_m) low = low.cwiseMin(v), high = high.cwiseMax(v);
    return {{"kind", "bounds"}, {"half", json_of(0.5 * (high - low))}, {"middle", json_of(0.5 * (high + low))}};
  }

  ViewScene& scene_;
  Json& notes_;
  std::map<const TriangleMesh*, std::size_t> numbers_;
  std::map<const TriangleMesh*, bool> noted_;
};

Json shape_json(const rtbus::config::BodyShape& shape, Meshes& meshes) {
  struct Visitor {
    Meshes& meshes;
    Json operator()(const rtbus::shapes::Plane&) const { return {{"kind", "plane"}}; }
    Json operator()(const rtbus::shapes::Sphere& s) const { return {{"kind", "sphere"}, {"radius", s.radius_m}}; }
    Json operator()(const rtbus::shapes::Box& b) const { return {{"kind", "box"}, {"half", json_of(b.half_size_m)}}; }
    Json operator()(const rtbus::config::Capsule& c) const {
      return {{"kind", "capsule"}, {"radius", c.radius_m}, {"length", c.length_m}};
    }
    Json operator()(const rtbus::config::Cylinder& c) const {
      return {{"kind", "cylinder"}, {"radius", c.radius_m}, {"length", c.length_m}};
    }
    Json operator()(const rtbus::config::ConvexHull& hull) const { return meshes.shape("hull", hull.points); }
    Json operator()(const rtbus::config::Mesh& mesh) const { return meshes.shape("mesh", mesh.surface); }
  };
  return std::visit(Visitor{meshes}, shape);
}

const char* type_text(rtbus::config::BodyType type) {
  switch (type) {
    case rtbus::config::BodyType::kStatic:
      return "static";
    case rtbus::config::BodyType::kKinematic:
      return "kinematic";
    case rtbus::config::BodyType::kDynamic:
      break;
  }
  return "dynamic";
}

Json hand_json(const SceneHand& hand) {
  return {{"name", hand.name},
          {"device", hand.device},
          {"method", hand.method},
          {"rate_hz", hand.rate_hz},
          {"radius_m", hand.radius_m},
          {"force_limit_n", hand.force_limit_n},
          {"q_WD", json_of(hand.q_WD)},
          {"position_scale", hand.position_scale},
          {"workspace_min_m", json_of(hand.workspace_min_m)},
          {"workspace_max_m", json_of(hand.workspace_max_m)}};
}

}  // namespace

ViewScene make_view_scene(const rtbus::config::Scene& scene, const std::string& session,
                          std::span<const SceneHand> hands) {
  ViewScene out;
  Json notes = Json::array(), shapes = Json::array(), bodies = Json::array(), soft = Json::array();
  Meshes meshes(out, notes);

  // Equal shapes once; then rows by kind and mesh, so that the page draws each run of rows with one call.
  std::map<std::string, std::size_t> known;
  std::vector<std::pair<std::string, std::size_t>> sort_keys;
  std::vector<std::size_t> shape_of;
  for (const rtbus::config::Body& body : scene.bodies) {
    Json shape = shape_json(body.shape, meshes);
    const auto [entry, first] = known.try_emplace(shape.dump(), shapes.size());
    std::string key = shape["kind"].get<std::string>();
    sort_keys.emplace_back(std::move(key), shape.contains("mesh") ? shape["mesh"].get<std::size_t>() : 0);
    if (first) shapes.push_back(std::move(shape));
    shape_of.push_back(entry->second);
  }
  out.order.resize(scene.bodies.size());
  std::iota(out.order.begin(), out.order.end(), 0U);
  std::stable_sort(out.order.begin(), out.order.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return sort_keys[a] < sort_keys[b]; });
  for (const std::uint32_t i : out.order) {
    const rtbus::config::Body& body = scene.bodies[i];
    bodies.push_back({{"name", body.name},
                      {"type", type_text(body.type)},
                      {"shape", shape_of[i]},
                      {"p", json_of(body.p_WB)},
                      {"q", json_of(body.q_WB)}});
  }
  for (const rtbus::config::SoftBody& body : scene.soft_bodies) {
    const std::size_t nodes = body.mesh->vertices_m.size();
    soft.push_back({{"name", body.name},
                    {"mesh", meshes.number(body.mesh)},
                    {"first", out.soft_nodes},
                    {"nodes", nodes},
                    {"p", json_of(body.p_WB)},
                    {"q", json_of(body.q_WB)}});
    out.soft_nodes += nodes;
  }
  Json hand_list = Json::array();
  for (const SceneHand& hand : hands) hand_list.push_back(hand_json(hand));
  out.document = {{"type", "scene"},          {"session", session},          {"name", scene.name},
                  {"file", scene.file},       {"shapes", std::move(shapes)}, {"bodies", std::move(bodies)},
                  {"soft", std::move(soft)},  {"meshes", out.meshes.size()}, {"hands", std::move(hand_list)},
                  {"notes", std::move(notes)}};
  return out;
}

}  // namespace view
