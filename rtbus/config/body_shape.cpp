#include "rtbus/config/body_shape.hpp"

#include <algorithm>

namespace rtbus::config {
namespace {

constexpr Range kLength_m{1e-6, 1000.0};

Eigen::Vector3d to_vector(const std::vector<double>& v) { return {v[0], v[1], v[2]}; }

BodyShape read_plane(Map&) { return shapes::Plane{}; }
BodyShape read_sphere(Map& keys) { return shapes::Sphere{keys.number("radius_m", kLength_m)}; }
BodyShape read_box(Map& keys) { return shapes::Box{0.5 * to_vector(keys.numbers("size_m", 3, kLength_m))}; }

BodyShape read_capsule(Map& keys) {
  const Capsule capsule{keys.number("radius_m", kLength_m), keys.number("length_m", kLength_m)};
  if (capsule.length_m <= 2.0 * capsule.radius_m) {
    keys.fail("length_m", "is the whole length, caps included, and must be above twice the radius; else take a sphere");
  }
  return capsule;
}

BodyShape read_cylinder(Map& keys) {
  return Cylinder{keys.number("radius_m", kLength_m), keys.number("length_m", kLength_m)};
}

std::shared_ptr<const TriangleMesh> read_file(Map& keys) {
  const std::string file = keys.existing_file("file");
  return std::make_shared<const TriangleMesh>(read_obj(file, keys.number("metres_per_unit", {1e-6, 1e3}, 1.0)));
}

Eigen::Vector3d extents_m(const TriangleMesh& mesh) {
  Eigen::Vector3d low = mesh.vertices_m.front();
  Eigen::Vector3d high = low;
  for (const Eigen::Vector3d& vertex : mesh.vertices_m) {
    low = low.cwiseMin(vertex);
    high = high.cwiseMax(vertex);
  }
  return high - low;
}

BodyShape read_hull(Map& keys) {
  const auto points = read_file(keys);
  if (extents_m(*points).minCoeff() < kLength_m.low) {
    keys.fail("file", "holds points in one plane, whose hull has no inside; give the body a thickness");
  }
  return ConvexHull{points};
}

BodyShape read_mesh(Map& keys) {
  const auto surface = read_file(keys);
  if (surface->triangles.empty()) keys.fail("file", "has no face (no line that begins with f), so there is no surface");
  return Mesh{surface};
}

struct ShapeEntry {
  std::string_view name;
  BodyShape (*read)(Map& keys);
};
// In the order of BodyShape's alternatives: name_of() counts on it.
constexpr std::array<ShapeEntry, 7> kShapes{{{"plane", read_plane},
                                             {"sphere", read_sphere},
                                             {"box", read_box},
                                             {"capsule", read_capsule},
                                             {"cylinder", read_cylinder},
                                             {"convex_hull", read_hull},
                                             {"mesh", read_mesh}}};
static_assert(kShapes.size() == std::variant_size_v<BodyShape>);

std::string shape_names() {
  std::string names;
  for (const ShapeEntry& entry : kShapes) names += (names.empty() ? "" : ", ") + std::string(entry.name);
  return names;
}

}  // namespace

std::string_view name_of(const BodyShape& shape) noexcept { return kShapes[shape.index()].name; }

BodyShape read_body_shape(Map& body) {
  Map shape = body.map("shape");
  const std::vector<std::string> names = shape.keys();
  if (names.size() != 1) {
    body.fail("shape", "needs exactly one shape; this build knows " + shape_names());
  }
  const auto* entry = std::find_if(kShapes.begin(), kShapes.end(),
                                   [&names](const ShapeEntry& known) { return known.name == names.front(); });
  if (entry == kShapes.end()) {
    body.fail("shape", "names a shape that this build does not know: " + names.front() + "; it knows " + shape_names());
  }
  Map keys = shape.map(entry->name);
  BodyShape out = entry->read(keys);
  keys.finish();
  shape.finish();
  return out;
}

}  // namespace rtbus::config
