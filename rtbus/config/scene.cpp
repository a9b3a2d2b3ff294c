#include "rtbus/config/scene.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <string_view>

namespace rtbus::config {
namespace {

// Farther than this a pose in double still resolves nanometres; a larger one is a slip of units.
constexpr Range kPosition_m{-1000.0, 1000.0};
constexpr Range kLength_m{1e-6, 1000.0};

Eigen::Vector3d to_vector(const std::vector<double>& v) { return {v[0], v[1], v[2]}; }

using ShapeReader = shapes::Shape (*)(Map& keys);

shapes::Shape read_plane(Map&) { return shapes::Plane{}; }
shapes::Shape read_sphere(Map& keys) { return shapes::Sphere{keys.number("radius_m", kLength_m)}; }
shapes::Shape read_box(Map& keys) { return shapes::Box{0.5 * to_vector(keys.numbers("size_m", 3, kLength_m))}; }

struct ShapeEntry {
  std::string_view name;
  ShapeReader read;
};
constexpr std::array<ShapeEntry, 3> kShapes{{{"box", read_box}, {"plane", read_plane}, {"sphere", read_sphere}}};
constexpr std::string_view kShapeNames = "box, plane, sphere";

/// `shape: {box: {size_m: […]}}`: one key that names the shape, its dimensions below.
shapes::Shape read_shape(Map& body) {
  Map shape = body.map("shape");
  const std::vector<std::string> names = shape.keys();
  if (names.size() != 1) {
    body.fail("shape", "needs exactly one shape; this build knows " + std::string(kShapeNames));
  }
  const auto* entry = std::find_if(kShapes.begin(), kShapes.end(),
                                   [&names](const ShapeEntry& known) { return known.name == names.front(); });
  if (entry == kShapes.end()) {
    body.fail("shape", "names a shape that this build does not know: " + names.front() + "; it knows " +
                           std::string(kShapeNames));
  }
  Map keys = shape.map(entry->name);
  const shapes::Shape out = entry->read(keys);
  keys.finish();
  shape.finish();
  return out;
}

BodyType read_type(Map& body) {
  const std::string type = body.choice("type", {"static", "dynamic", "kinematic"});
  if (type != "static") {
    body.fail("type", "needs an engine that moves bodies, which this build does not have; it knows static");
  }
  return BodyType::kStatic;
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

Body read_body(Map& map) {
  Body body;
  body.name = map.text("name");
  const bool valid =
      !body.name.empty() && body.name.size() <= 64 && std::all_of(body.name.begin(), body.name.end(), [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
      });
  if (!valid) {
    map.fail("name", "is not a name; use 1…64 letters, digits, '_' and '-'");
  }
  body.type = read_type(map);
  body.shape = read_shape(map);
  body.p_WB = to_vector(map.numbers("position_m", 3, kPosition_m, {0.0, 0.0, 0.0}));
  body.q_WB = read_orientation(map);
  body.friction = map.number("friction", {0.0, 2.0}, 0.0);
  map.finish();
  return body;
}

}  // namespace

std::vector<shapes::PlacedShape> Scene::static_shapes() const {
  std::vector<shapes::PlacedShape> out;
  for (const Body& body : bodies) {
    if (body.type == BodyType::kStatic) {
      out.push_back({body.shape, body.q_WB, body.p_WB, body.friction});
    }
  }
  return out;
}

Scene read_scene(Map& map) {
  (void)map.choice("schema", {"scene/1"});
  Scene scene;
  scene.file = map.file();
  scene.name = map.text("name", std::filesystem::path(scene.file).stem().string());
  scene.gravity_m_s2 = to_vector(map.numbers("gravity_m_s2", 3, {-100.0, 100.0}, {0.0, -9.81, 0.0}));
  for (Map& item : map.list_of_maps("bodies")) {
    Body body = read_body(item);
    const auto twin = std::find_if(scene.bodies.begin(), scene.bodies.end(),
                                   [&body](const Body& other) { return other.name == body.name; });
    if (twin != scene.bodies.end()) {
      item.fail("name", "is the name of bodies." + std::to_string(twin - scene.bodies.begin()) +
                            " already; names are unique in a scene");
    }
    scene.bodies.push_back(std::move(body));
  }
  map.finish();
  return scene;
}

}  // namespace rtbus::config
