#include "rtbus/config/scene.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <string_view>
#include <utility>

#include "rtbus/config/vector3.hpp"
#include "rtbus/sample.hpp"

namespace rtbus::config {
namespace {

// Farther than this a pose in double still resolves nanometres; a larger one is a slip of units.
constexpr Range kPosition_m{-1000.0, 1000.0};
/// Of one scene, grids unrolled: far above what any engine steps in a second.
constexpr std::size_t kMaxBodies = 20000;
constexpr std::size_t kMaxSoftBodies = 100;

BodyType read_type(Map& body) {
  const std::string type = body.choice("type", {"static", "dynamic", "kinematic"});
  return type == "static" ? BodyType::kStatic : type == "dynamic" ? BodyType::kDynamic : BodyType::kKinematic;
}

Eigen::Quaterniond read_orientation(Map& body) {
  const std::vector<double> q = body.numbers("orientation_wxyz", 4, {-1e3, 1e3}, {1.0, 0.0, 0.0, 0.0});
  const Eigen::Quaterniond orientation(q[0], q[1], q[2], q[3]);
  // A quaternion typed with three digits is meant; one of length zero has no direction to keep.
  if (orientation.norm() < 1e-3) {
    body.fail("orientation_wxyz", "has no direction: its length is zero; write [1, 0, 0, 0] for no rotation");
  }
  return orientation.normalized();
}

bool valid_name(const std::string& name) {
  return !name.empty() && name.size() <= 64 && std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
  });
}

void read_motion(Map& map, Body& body) {
  if (body.type != BodyType::kDynamic) {
    for (const char* key : {"mass_kg", "linear_damping_per_s", "angular_damping_per_s", "asleep"}) {
      if (map.has(key)) map.fail(key, "belongs to a body that forces move; leave it out, or write type: dynamic");
    }
  }
  if (body.type != BodyType::kKinematic && map.has("motion")) {
    map.fail("motion", "belongs to a body that moves by itself; leave it out, or write type: kinematic");
  }
  if (body.type == BodyType::kStatic) return;
  if (std::holds_alternative<shapes::Plane>(body.shape) || std::holds_alternative<Mesh>(body.shape)) {
    map.fail("shape", "is a " + std::string(name_of(body.shape)) +
                          ", which has no volume and cannot move; write type: static, or take a convex_hull or a box");
  }
  if (body.type == BodyType::kKinematic) {
    body.motion = read_body_motion(map, body.p_WB);
    return;
  }
  body.mass_kg = map.number("mass_kg", {1e-9, 1e6});
  body.linear_damping_per_s = map.number("linear_damping_per_s", {0.0, 30.0}, 0.0);
  body.angular_damping_per_s = map.number("angular_damping_per_s", {0.0, 30.0}, 0.0);
  body.asleep = map.boolean("asleep", false);
}

std::string read_name(Map& map) {
  std::string name = map.text("name");
  if (!valid_name(name)) map.fail("name", "is not a name; use 1…64 letters, digits, '_' and '-'");
  return name;
}

Body read_body(Map& map) {
  Body body;
  body.name = read_name(map);
  body.source = map.place();
  body.type = read_type(map);
  body.shape = read_body_shape(map);
  body.p_WB = read_vector3(map, "position_m", kPosition_m, {0.0, 0.0, 0.0});
  body.q_WB = read_orientation(map);
  body.friction = map.number("friction", {0.0, 2.0}, 0.0);
  body.restitution = map.number("restitution", {0.0, 1.0}, 0.0);
  read_motion(map, body);
  return body;
}

/// `grid: {count: [5, 5, 5], spacing_m: [0.02, 0.02, 0.02]}`: copies called name_i_j_k, the first where the body says.
std::vector<Body> read_grid(Map& map, const Body& first) {
  auto grid = map.optional_map("grid");
  if (!grid) return {first};
  const std::vector<double> count = grid->numbers("count", 3, {1.0, 10000.0});
  const Eigen::Vector3d spacing_m = read_vector3(*grid, "spacing_m", kPosition_m);
  for (const double each : count) {
    if (each != std::floor(each)) grid->fail("count", "needs whole numbers: bodies along x, y and z");
  }
  if (count[0] * count[1] * count[2] > static_cast<double>(kMaxBodies)) {
    grid->fail("count", "makes more than " + std::to_string(kMaxBodies) + " bodies");
  }
  grid->finish();
  std::vector<Body> out;
  for (int i = 0; i < static_cast<int>(count[0]); ++i) {
    for (int j = 0; j < static_cast<int>(count[1]); ++j) {
      for (int k = 0; k < static_cast<int>(count[2]); ++k) {
        Body body = first;
        body.name += '_' + std::to_string(i) + '_' + std::to_string(j) + '_' + std::to_string(k);
        const Eigen::Vector3d shift_m = Eigen::Vector3d(i, j, k).cwiseProduct(spacing_m);
        body.p_WB += shift_m;
        if (body.motion) {
          if (auto* const path = std::get_if<WaypointMotion>(&*body.motion)) {
            for (Eigen::Vector3d& point : path->positions_m) point += shift_m;
          }
        }
        out.push_back(std::move(body));
      }
    }
  }
  return out;
}

Deactivation read_deactivation(Map& scene) {
  Deactivation out;
  auto map = scene.optional_map("deactivation");
  if (!map) return out;
  out.enabled = map->boolean("enabled", out.enabled);
  out.after_s = map->number("after_s", {0.01, 60.0}, out.after_s);
  if (map->has("linear_m_s")) out.linear_m_s = map->number("linear_m_s", {0.0, 10.0});
  if (map->has("angular_rad_s")) out.angular_rad_s = map->number("angular_rad_s", {0.0, 100.0});
  map->finish();
  return out;
}

}  // namespace

std::vector<shapes::PlacedShape> Scene::static_shapes() const {
  std::vector<shapes::PlacedShape> out;
  for (const Body& body : bodies) {
    if (body.type != BodyType::kStatic) continue;
    std::optional<shapes::Shape> shape;
    if (const auto* plane = std::get_if<shapes::Plane>(&body.shape)) shape = *plane;
    if (const auto* sphere = std::get_if<shapes::Sphere>(&body.shape)) shape = *sphere;
    if (const auto* box = std::get_if<shapes::Box>(&body.shape)) shape = *box;
    if (shape) out.push_back({*shape, body.q_WB, body.p_WB, body.friction});
  }
  return out;
}

std::vector<shapes::KnownShape> Scene::known_shapes() const {
  std::vector<shapes::KnownShape> out;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const Body& body = bodies[i];
    shapes::KnownShape known;
    if (const auto* const mesh = std::get_if<Mesh>(&body.shape)) {
      auto surface = std::make_shared<const shapes::Surface>(mesh->surface->vertices_m, mesh->surface->triangles);
      if (surface->triangle_count() == 0) continue;
      known.shape = std::move(surface);
    } else if (const auto* const hull = std::get_if<ConvexHull>(&body.shape)) {
      if (hull->points->vertices_m.size() > shapes::Hull::kMost) continue;
      known.shape = shapes::Hull{hull->points->vertices_m};
    } else if (const auto* const box = std::get_if<shapes::Box>(&body.shape)) {
      known.shape = *box;
    } else if (const auto* const capsule = std::get_if<Capsule>(&body.shape)) {
      known.shape = *capsule;
    } else if (const auto* const cylinder = std::get_if<Cylinder>(&body.shape)) {
      known.shape = *cylinder;
    } else if (!std::holds_alternative<shapes::Plane>(body.shape)) {
      continue;  // a ball is told as one
    }
    known.body = static_cast<std::uint32_t>(i);
    known.stands = body.type == BodyType::kStatic;
    if (known.stands) {
      known.q_WB = body.q_WB;
      known.p_WB = body.p_WB;
    }
    out.push_back(std::move(known));
  }
  return out;
}

std::uint64_t Scene::shape_hash() const {
  using rtbus::detail::fnv1a;
  std::uint64_t hash = 0xcbf29ce484222325ULL;
  const auto add = [&hash](const Eigen::Ref<const Eigen::VectorXd>& values) {
    for (const double value : values) hash = fnv1a(std::bit_cast<std::uint64_t>(value + 0.0), hash);  // −0 is 0
  };
  const auto add_mesh = [&](const TriangleMesh& mesh) {
    hash = fnv1a(mesh.vertices_m.size(), hash);
    for (const Eigen::Vector3d& vertex : mesh.vertices_m) add(vertex);
    for (const auto& corners : mesh.triangles) {
      for (const std::uint32_t corner : corners) hash = fnv1a(corner, hash);
    }
  };
  for (const Body& body : bodies) {
    hash = fnv1a(static_cast<std::uint64_t>(body.type), fnv1a(body.shape.index(), hash));
    if (body.type == BodyType::kStatic) {
      add(body.q_WB.coeffs());
      add(body.p_WB);
    }
    if (const auto* const mesh = std::get_if<Mesh>(&body.shape)) {
      add_mesh(*mesh->surface);
    } else if (const auto* const hull = std::get_if<ConvexHull>(&body.shape)) {
      add_mesh(*hull->points);
    } else {
      add(extents_m(body.shape));
    }
  }
  return std::max<std::uint64_t>(hash, 1);
}

Scene read_scene(Map& map) {
  (void)map.choice("schema", {"scene/1"});
  Scene scene;
  scene.file = map.file();
  scene.name = map.text("name", std::filesystem::path(scene.file).stem().string());
  scene.gravity_m_s2 = read_vector3(map, "gravity_m_s2", {-100.0, 100.0}, {0.0, -9.81, 0.0});
  scene.deactivation = read_deactivation(map);
  std::map<std::string, std::size_t> item_of;  // which item of the list a name came from
  std::size_t item_index = 0;
  for (Map& item : map.list_of_maps("bodies")) {
    const Body first = read_body(item);
    for (Body& body : read_grid(item, first)) {
      const auto [twin, is_new] = item_of.try_emplace(body.name, item_index);
      if (!is_new) {
        item.fail("name",
                  "is the name of bodies." + std::to_string(twin->second) + " already; names are unique in a scene");
      }
      scene.bodies.push_back(std::move(body));
    }
    if (scene.bodies.size() > kMaxBodies) {
      item.fail("name", "makes more than " + std::to_string(kMaxBodies) + " bodies in this scene");
    }
    item.finish();
    ++item_index;
  }
  for (Map& item : map.list_of_maps("soft_bodies")) {
    const std::string name = read_name(item);
    const auto is_twin = [&name](const SoftBody& other) { return other.name == name; };
    if (item_of.contains(name) || std::any_of(scene.soft_bodies.begin(), scene.soft_bodies.end(), is_twin)) {
      item.fail("name", "is the name of another body already; names are unique in a scene");
    }
    if (scene.soft_bodies.size() == kMaxSoftBodies) {
      item.fail("name", "is one soft body too many; a scene may have " + std::to_string(kMaxSoftBodies));
    }
    SoftBody body = read_soft_body(item);
    body.name = name;
    body.source = item.place();
    body.p_WB = read_vector3(item, "position_m", kPosition_m, {0.0, 0.0, 0.0});
    body.q_WB = read_orientation(item);
    item.finish();
    scene.soft_bodies.push_back(std::move(body));
  }
  map.finish();
  return scene;
}

std::vector<std::size_t> bodies_that_orders_move(const Scene& scene) {
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const auto& motion = scene.bodies[i].motion;
    if (motion && std::holds_alternative<TargetMotion>(*motion)) out.push_back(i);
  }
  return out;
}

}  // namespace rtbus::config
