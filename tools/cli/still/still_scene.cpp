// A frame in POV-Ray's language. Lengths are scaled so that the picture's radius is kUnits: POV-Ray's own tolerances
// are absolute and meant for scenes of that size. All frames are right-handed, which the camera's mirrored `right`
// says.
#include "tools/cli/still/still_scene.hpp"
#include "tools/cli/common/formatted.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <numbers>
#include <span>
#include <variant>
#include <vector>

namespace tools {

namespace {

using rtbus::config::Body;

constexpr double kUnits = 10.0;

std::string pov(double value) { return formatted("%.6g", value); }
std::string pov(const Eigen::Vector3d& v) { return "<" + pov(v.x()) + "," + pov(v.y()) + "," + pov(v.z()) + ">"; }
std::string pov(const Rgb& c) { return "srgb <" + pov(c.r) + "," + pov(c.g) + "," + pov(c.b) + ">"; }

/// Light from the upper left and a bright sky that reaches into every gap (radiosity), as on an overcast day.
constexpr const char* kLight = R"(
global_settings {
  assumed_gamma 1.0
  max_trace_level 6
  radiosity {
    pretrace_start 0.08 pretrace_end 0.02
    count 40 nearest_count 5 error_bound 0.8 recursion_limit 1
    low_error_factor 0.5 gray_threshold 0.3 minimum_reuse 0.012 brightness 1
  }
}
sky_sphere { pigment { gradient y color_map { [0.0 srgb <0.80,0.82,0.84>] [1.0 srgb <0.90,0.93,0.97>] } } }
)";

std::string matrix(const physics::BodyPose& pose, double scale) {
  const Eigen::Matrix3d r = pose.orientation.normalized().toRotationMatrix();
  const Eigen::Vector3d t = scale * pose.position_m;
  std::string text = "matrix <";
  for (int column = 0; column < 3; ++column) {
    for (int row = 0; row < 3; ++row) text += formatted("%.7g,", r(row, column));
  }
  return text + pov(t.x()) + "," + pov(t.y()) + "," + pov(t.z()) + ">";
}

std::string triangle(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                     const char* more = "") {
  return "  triangle { " + pov(a) + "," + pov(b) + "," + pov(c) + more + " }\n";
}

/// A box whose edges are cut off: the cut catches shadow and light, so that every body of a stack can be told apart.
std::string box_mesh(const Eigen::Vector3d& half) {
  const double cut = 0.045 * half.minCoeff();
  std::string text = "mesh {\n";
  // Corner `s` of the face across `axis`: that coordinate stays, the two others draw back by the cut.
  const auto corner = [&](const Eigen::Vector3d& s, int axis) {
    Eigen::Vector3d p = s.cwiseProduct(half);
    for (int k = 0; k < 3; ++k) {
      if (k != axis) p[k] -= s[k] * cut;
    }
    return p;
  };
  for (int axis = 0; axis < 3; ++axis) {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    for (const double side : {-1.0, 1.0}) {
      Eigen::Vector3d s[4];
      for (int i = 0; i < 4; ++i) {
        s[i][axis] = side;
        s[i][u] = (i == 1 || i == 2) ? 1.0 : -1.0;
        s[i][v] = i >= 2 ? 1.0 : -1.0;
      }
      text += triangle(corner(s[0], axis), corner(s[1], axis), corner(s[2], axis));
      text += triangle(corner(s[0], axis), corner(s[2], axis), corner(s[3], axis));
    }
    // The four edges along this axis, each between the faces across u and v.
    for (const double su : {-1.0, 1.0}) {
      for (const double sv : {-1.0, 1.0}) {
        Eigen::Vector3d s0, s1;
        s0[axis] = -1.0, s1[axis] = 1.0;
        s0[u] = s1[u] = su;
        s0[v] = s1[v] = sv;
        text += triangle(corner(s0, u), corner(s1, u), corner(s1, v), " texture { Edge }");
        text += triangle(corner(s0, u), corner(s1, v), corner(s0, v), " texture { Edge }");
      }
    }
  }
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d s((i & 1) ? 1.0 : -1.0, (i & 2) ? 1.0 : -1.0, (i & 4) ? 1.0 : -1.0);
    text += triangle(corner(s, 0), corner(s, 1), corner(s, 2), " texture { Edge }");
  }
  return text + "}";
}

std::string surface_mesh(const rtbus::config::TriangleMesh& mesh, double scale) {
  std::string text = "mesh {\n";
  for (const auto& t : mesh.triangles) {
    text += triangle(scale * mesh.vertices_m[t[0]], scale * mesh.vertices_m[t[1]], scale * mesh.vertices_m[t[2]]);
  }
  return text + "}";
}

/// A skin as POV-Ray's mesh2: smooth, by the normals of the nodes, and coloured at each node by how far it has moved.
std::string skin_text(const rtbus::config::TriangleMesh& mesh, std::span<const Eigen::Vector3d> now_m,
                      std::span<const Eigen::Vector3d> start_m, const StillLayout& layout, double scale) {
  std::vector<Eigen::Vector3d> normals(now_m.size(), Eigen::Vector3d::Zero());
  for (const auto& t : mesh.triangles) {
    const Eigen::Vector3d face = (now_m[t[1]] - now_m[t[0]]).cross(now_m[t[2]] - now_m[t[0]]);
    for (const std::uint32_t corner : t) normals[corner] += face;
  }
  const std::string count = std::to_string(now_m.size());
  std::string vertices, directions, colours, faces;
  // Colours are few, so that the list of textures stays short.
  constexpr int kColours = 24;
  for (int i = 0; i < kColours; ++i) {
    colours += "\n  texture { pigment { " + pov(moved_colour(i / (kColours - 1.0))) + " } finish { Body } }";
  }
  std::vector<int> colour(now_m.size(), 0);
  for (std::size_t i = 0; i < now_m.size(); ++i) {
    vertices += "," + pov(Eigen::Vector3d(scale * now_m[i]));
    directions += "," + pov(Eigen::Vector3d(normals[i].stableNormalized()));
    const double share = layout.moved_max_m > 0.0 ? (now_m[i] - start_m[i]).norm() / layout.moved_max_m : 0.0;
    colour[i] = static_cast<int>(std::lround((kColours - 1) * std::clamp(share, 0.0, 1.0)));
  }
  for (const auto& t : mesh.triangles) {
    faces += ",\n  <" + std::to_string(t[0]) + "," + std::to_string(t[1]) + "," + std::to_string(t[2]) + ">";
    for (const std::uint32_t corner : t) faces += "," + std::to_string(colour[corner]);
  }
  return "mesh2 {\n vertex_vectors { " + count + vertices + " }\n normal_vectors { " + count + directions +
         " }\n texture_list { " + std::to_string(kColours) + colours + " }\n face_indices { " +
         std::to_string(mesh.triangles.size()) + faces + " }\n}\n";
}

std::string round_text(double radius, double straight, bool caps) {
  const std::string r = pov(radius), h = pov(0.5 * straight);
  std::string text = "cylinder { <0,-" + h + ",0>,<0," + h + ",0>," + r + " }";
  if (!caps) return text;
  return "merge { " + text + " sphere { <0,-" + h + ",0>," + r + " } sphere { <0," + h + ",0>," + r + " } }";
}

/// The shape in its body's frame, without texture.
std::string shape_text(const rtbus::config::BodyShape& shape, double scale) {
  struct Visitor {
    double scale;
    std::string operator()(const rtbus::shapes::Plane&) const { return "plane { y, 0 }"; }
    std::string operator()(const rtbus::shapes::Sphere& s) const {
      return "sphere { 0, " + pov(scale * s.radius_m) + " }";
    }
    std::string operator()(const rtbus::shapes::Box& box) const { return box_mesh(scale * box.half_size_m); }
    std::string operator()(const rtbus::config::Capsule& c) const {
      return round_text(scale * c.radius_m, scale * (c.length_m - 2.0 * c.radius_m), true);
    }
    std::string operator()(const rtbus::config::Cylinder& c) const {
      return round_text(scale * c.radius_m, scale * c.length_m, false);
    }
    std::string operator()(const rtbus::config::ConvexHull& hull) const { return surface_mesh(*hull.points, scale); }
    std::string operator()(const rtbus::config::Mesh& mesh) const { return surface_mesh(*mesh.surface, scale); }
  };
  return std::visit(Visitor{scale}, shape);
}

std::string grid_texture(double grid) {
  const auto lines = [&](const char* axis) {
    return std::string("  texture { pigment { gradient ") + axis +
           " color_map { [0 srgb <0.62,0.66,0.70>] [0.03 srgb <0.62,0.66,0.70>] [0.03 rgbt 1] [1 rgbt 1] } translate " +
           "-0.015*" + axis + " scale " + pov(grid) + " } finish { diffuse 0.75 ambient 0 emission 0 } }\n";
  };
  return "  texture { pigment { srgb <0.93,0.94,0.95> } finish { diffuse 0.85 ambient 0 } }\n" + lines("x") +
         lines("z");
}

std::string hand_text(const StillHand& hand, const StillLayout& layout, double scale) {
  const Eigen::Vector3d proxy = scale * hand.proxy_m, tip = scale * arrow_tip(hand, layout);
  std::string text = "sphere { " + pov(proxy) + ", " + pov(scale * drawn_radius_m(hand, layout)) + " pigment { " +
                     pov(kProxyColour) + " } finish { Ball } }\n";
  const double length = (tip - proxy).norm();
  if (length < 0.05) return text;
  const double shaft = 0.011 * kUnits, head_radius = 0.030 * kUnits;
  const double head = std::min(0.085 * kUnits, 0.6 * length);
  const Eigen::Vector3d neck = tip - head / length * (tip - proxy);
  const std::string paint = " pigment { " + pov(kForceColour) + " } finish { Ball }";
  text += "cylinder { " + pov(proxy) + "," + pov(neck) + "," + pov(std::min(shaft, 0.4 * head)) + paint + " }\n";
  text += "cone { " + pov(neck) + "," + pov(std::min(head_radius, 0.6 * head)) + "," + pov(tip) + ",0" + paint + " }\n";
  return text;
}

}  // namespace

Rgb moved_colour(double share) {
  constexpr Rgb kStops[] = {{0.90, 0.84, 0.70}, {0.47, 0.70, 0.50}, {0.04, 0.36, 0.42}};
  const double place = 2.0 * std::clamp(share, 0.0, 1.0);
  const int i = place < 1.0 ? 0 : 1;
  const double f = place - i;
  const Rgb &a = kStops[i], &b = kStops[i + 1];
  return {a.r + f * (b.r - a.r), a.g + f * (b.g - a.g), a.b + f * (b.b - a.b)};
}

std::string pov_text(const rtbus::config::Scene& scene, const StillFrame& frame, const StillLayout& layout) {
  const double scale = kUnits / layout.radius_m;
  const Camera& camera = layout.camera;
  const Eigen::Vector3d at = scale * camera.look_at_m, eye = scale * camera.eye_m;
  const Eigen::Vector3d into = (at - eye).normalized(), right = into.cross(Eigen::Vector3d::UnitY()).normalized();
  const Eigen::Vector3d up = right.cross(into);
  std::string text = "// povray +I" + frame.stem + ".pov +W" + std::to_string(camera.width_px) + " +H" +
                     std::to_string(camera.height_px) + " +A\n#version 3.7;\n";
  text += kLight;
  // The key light is a soft one: a square of 3 × 3 lamps over the viewer's left shoulder.
  const Eigen::Vector3d lamp =
      at + 6.0 * kUnits * (0.55 * -into - 0.65 * right + 0.9 * Eigen::Vector3d::UnitY()).normalized();
  text += "light_source { " + pov(lamp) + " color rgb 0.72 area_light " + pov(1.2 * kUnits * right) + "," +
          pov(1.2 * kUnits * up) + ",3,3 adaptive 1 }\n";
  text += "camera { perspective location " + pov(eye) + " right -x*" +
          pov(static_cast<double>(camera.width_px) / camera.height_px) + " up y sky y angle " +
          pov(Camera::kAngle_deg) + " look_at " + pov(at) + " }\n";
  text +=
      "#declare Body = finish { diffuse 0.80 ambient 0 specular 0.12 roughness 0.06 }\n"
      "#declare Ball = finish { diffuse 0.75 ambient 0 emission 0.06 specular 0.35 roughness 0.02 }\n"
      "#declare Edge = texture { pigment { srgb <0.30,0.31,0.33> } finish { diffuse 0.7 ambient 0 } }\n";
  std::map<std::string, std::string> shapes;  // text of a shape, and the name under which all bodies share it
  std::string bodies;
  for (std::size_t i = 0; i < scene.bodies.size() && i < frame.poses.size(); ++i) {
    const Body& body = scene.bodies[i];
    const auto [known, fresh] = shapes.try_emplace(shape_text(body.shape, scale), "S" + std::to_string(shapes.size()));
    if (fresh) text += "#declare " + known->second + " = " + known->first + "\n";
    bodies += "object { " + known->second + "\n";
    if (std::holds_alternative<rtbus::shapes::Plane>(body.shape)) {
      // A hair lower, so that what ends in the plane does not flicker with it.
      bodies += "  translate -0.004*y\n" + grid_texture(scale * layout.grid_m);
    } else if (body.type == rtbus::config::BodyType::kStatic) {
      bodies += "  texture { pigment { srgb <0.66,0.69,0.73> } finish { Body } }\n";
    } else {
      const double moved_m = (frame.poses[i].position_m - body.p_WB).norm();
      const Rgb colour = moved_colour(layout.moved_max_m > 0.0 ? moved_m / layout.moved_max_m : 0.0);
      bodies += "  texture { pigment { " + pov(colour) + " } finish { Body } }\n";
    }
    bodies += "  " + matrix(frame.poses[i], scale) + " }\n";
  }
  text += bodies;
  const StillFrame start = frame_of(scene);
  std::size_t first = 0;
  for (const rtbus::config::SoftBody& body : scene.soft_bodies) {
    const std::size_t nodes = body.mesh->vertices_m.size();
    if (first + nodes > frame.soft_nodes_m.size()) break;
    text += skin_text(*body.mesh, std::span(frame.soft_nodes_m).subspan(first, nodes),
                      std::span(start.soft_nodes_m).subspan(first, nodes), layout, scale);
    first += nodes;
  }
  for (const StillHand& hand : frame.hands) text += hand_text(hand, layout, scale);
  return text;
}

}  // namespace tools
