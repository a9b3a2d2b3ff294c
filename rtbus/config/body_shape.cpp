#include "rtbus/config/body_shape.hpp"

#include <algorithm>
#include <utility>

#include "rtbus/config/vector3.hpp"

namespace rtbus::config {
namespace {

constexpr Range kLength_m{1e-6, 1000.0};

BodyShape read_plane(Map&) { return shapes::Plane{}; }
BodyShape read_sphere(Map& keys) { return shapes::Sphere{keys.number("radius_m", kLength_m)}; }
BodyShape read_box(Map& keys) { return shapes::Box{0.5 * read_vector3(keys, "size_m", kLength_m)}; }

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

BodyShape read_hull(Map& keys) {
  const auto points = read_mesh_file(keys);
  if (points->extents_m().minCoeff() < kLength_m.low) {
    keys.fail("file", "holds points in one plane, whose hull has no inside; give the body a thickness");
  }
  return ConvexHull{points};
}

BodyShape read_mesh(Map& keys) {
  const auto surface = read_mesh_file(keys);
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

std::shared_ptr<const TriangleMesh> read_mesh_file(Map& keys) {
  const std::string file = keys.existing_file("file");
  TriangleMesh mesh = read_obj(file, keys.number("metres_per_unit", {1e-6, 1e3}, 1.0));
  mesh.unit_assumed = !keys.has("metres_per_unit");
  return std::make_shared<const TriangleMesh>(std::move(mesh));
}

Eigen::Vector3d extents_m(const BodyShape& shape) {
  struct Extents {
    Eigen::Vector3d operator()(const shapes::Plane&) const { return Eigen::Vector3d::Zero(); }
    Eigen::Vector3d operator()(const shapes::Sphere& sphere) const {
      return Eigen::Vector3d::Constant(2.0 * sphere.radius_m);
    }
    Eigen::Vector3d operator()(const shapes::Box& box) const { return 2.0 * box.half_size_m; }
    Eigen::Vector3d operator()(const Capsule& c) const { return {2.0 * c.radius_m, c.length_m, 2.0 * c.radius_m}; }
    Eigen::Vector3d operator()(const Cylinder& c) const { return {2.0 * c.radius_m, c.length_m, 2.0 * c.radius_m}; }
    Eigen::Vector3d operator()(const ConvexHull& hull) const { return hull.points->extents_m(); }
    Eigen::Vector3d operator()(const Mesh& mesh) const { return mesh.surface->extents_m(); }
  };
  return std::visit(Extents{}, shape);
}

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
