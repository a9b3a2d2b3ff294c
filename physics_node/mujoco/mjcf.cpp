#include "physics_node/mujoco/mjcf.hpp"

#include <cmath>
#include <numbers>
#include <sstream>
#include <type_traits>
#include <variant>

namespace mujoco {
namespace {

using rtbus::config::Body;
using rtbus::config::BodyType;
using rtbus::config::Error;
using rtbus::config::Scene;

/// Contacts that a body of a heap has with others, and MuJoCo's rows for each (a pyramid of four edges).
constexpr std::size_t kContactsPerBody = 16, kRowsPerContact = 4;

[[noreturn]] void refuse(const Body& body, const std::string& why) {
  throw Error(body.source + " (" + body.name + ") " + why +
              ", which the engine mujoco cannot do; write engine: bullet");
}

void check(const Scene& scene) {
  if (!scene.soft_bodies.empty()) {
    throw Error(scene.file + ": body " + scene.soft_bodies.front().name +
                " is soft, which the engine mujoco cannot do; write engine: bullet");
  }
  for (const Body& body : scene.bodies) {
    if (body.type == BodyType::kKinematic) refuse(body, "moves by itself");
    if (body.restitution != 0.0) refuse(body, "has a restitution");
    if (std::holds_alternative<rtbus::config::Mesh>(body.shape)) refuse(body, "is a mesh that may be concave");
    if (body.type == BodyType::kDynamic && std::holds_alternative<rtbus::shapes::Plane>(body.shape)) {
      refuse(body, "is a plane that moves");
    }
  }
}

template <class Vector>
std::string numbers(const Vector& values) {
  std::ostringstream out;
  out.precision(17);
  for (int i = 0; i < static_cast<int>(values.size()); ++i) out << (i == 0 ? "" : " ") << values[i];
  return out.str();
}

struct Geom {
  std::string shape;          ///< Type and size.
  Eigen::Quaterniond turned;  ///< In the body: MuJoCo's planes, capsules and cylinders stand along z, ours along y.
};
Geom geom_of(const rtbus::config::BodyShape& shape, const std::string& mesh) {
  return std::visit(
      [&]<class Shape>(const Shape& each) -> Geom {
        const Eigen::Quaterniond along_y(std::numbers::sqrt2 / 2, -std::numbers::sqrt2 / 2, 0, 0);
        Eigen::Quaterniond turned = Eigen::Quaterniond::Identity();
        std::ostringstream out;
        out.precision(17);
        if constexpr (std::is_same_v<Shape, rtbus::shapes::Plane>) {
          out << "type=\"plane\" size=\"0 0 1\"";
          turned = along_y;
        } else if constexpr (std::is_same_v<Shape, rtbus::shapes::Sphere>) {
          out << "type=\"sphere\" size=\"" << each.radius_m << '"';
        } else if constexpr (std::is_same_v<Shape, rtbus::shapes::Box>) {
          out << "type=\"box\" size=\"" << numbers(each.half_size_m) << '"';
        } else if constexpr (std::is_same_v<Shape, rtbus::config::Capsule>) {
          out << "type=\"capsule\" size=\"" << each.radius_m << ' ' << 0.5 * each.length_m - each.radius_m << '"';
          turned = along_y;
        } else if constexpr (std::is_same_v<Shape, rtbus::config::Cylinder>) {
          out << "type=\"cylinder\" size=\"" << each.radius_m << ' ' << 0.5 * each.length_m << '"';
          turned = along_y;
        } else {
          out << "type=\"mesh\" mesh=\"" << mesh << '"';
        }
        return {out.str(), turned};
      },
      shape);
}

void write_assets(const Scene& scene, std::ostringstream& out) {
  out << "<asset>";
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const auto* const hull = std::get_if<rtbus::config::ConvexHull>(&scene.bodies[i].shape);
    if (hull == nullptr) continue;
    out << "<mesh name=\"m" << i << "\" vertex=\"";
    for (const Eigen::Vector3d& vertex : hull->points->vertices_m) out << numbers(vertex) << ' ';
    out << "\"/>";
  }
  out << "</asset>\n";
}

/// Where a body stands, turned as geom_of() says.
std::string placed(const Body& body, const Eigen::Quaterniond& turned) {
  const Eigen::Quaterniond q = body.q_WB * turned;
  return "pos=\"" + numbers(body.p_WB) + "\" quat=\"" + numbers(Eigen::Vector4d(q.w(), q.x(), q.y(), q.z())) + "\"";
}

/// Static bodies are geoms of the world itself: MuJoCo 2.2 lists contacts of other bodies that never move twice.
void write_bodies(const Scene& scene, std::ostringstream& out) {
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const Body& body = scene.bodies[i];
    const auto [shape, turned] = geom_of(body.shape, "m" + std::to_string(i));
    const std::string geom = "<geom name=\"b" + std::to_string(i) + "\" " + shape;
    if (body.type == BodyType::kStatic) {
      out << geom << ' ' << placed(body, turned) << "/>\n";
      continue;
    }
    out << "<body name=\"b" << i << "\" " << placed(body, Eigen::Quaterniond::Identity()) << "><freejoint/>" << geom
        << " quat=\"" << numbers(Eigen::Vector4d(turned.w(), turned.x(), turned.y(), turned.z())) << "\" mass=\""
        << body.mass_kg << "\"/></body>\n";
  }
}

void write_tools(const std::vector<ToolShape>& tools, double reach_m, std::ostringstream& out) {
  for (std::size_t i = 0; i < tools.size(); ++i) {
    out << "<body name=\"t" << i << "\">";
    for (const char* axis : {"1 0 0", "0 1 0", "0 0 1"}) out << "<joint type=\"slide\" axis=\"" << axis << "\"/>";
    // Contacts within the margin are listed; as far as the gap reaches they carry nothing.
    out << "<geom name=\"t" << i << "\" type=\"sphere\" size=\"" << std::max(tools[i].radius_m, kPoint_m)
        << "\" mass=\"" << tools[i].mass_kg << "\" margin=\"" << reach_m << "\" gap=\"" << reach_m << "\"/></body>\n";
  }
}

}  // namespace

std::string mjcf_of(const Scene& scene, const std::vector<ToolShape>& tools, double timestep_s, double reach_m) {
  check(scene);
  std::ostringstream out;
  out.precision(17);
  const std::size_t contacts = kContactsPerBody * (scene.bodies.size() + tools.size()) + 64;
  // Newton, pyramidal cones and the default softness keep a heap at rest; stiffer contacts do not.
  out << "<mujoco model=\""
      << "scene"
      << "\"><compiler angle=\"radian\" boundinertia=\"0\" boundmass=\"0\"/>\n"
      << "<option timestep=\"" << timestep_s << "\" gravity=\"" << numbers(scene.gravity_m_s2)
      << "\" solver=\"Newton\" cone=\"pyramidal\" jacobian=\"auto\" iterations=\"100\" tolerance=\"1e-10\" "
         "impratio=\"1\"/>\n"
      << "<size nconmax=\"" << contacts << "\" njmax=\"" << contacts * kRowsPerContact << "\"/>\n"
      << "<default><geom condim=\"3\" friction=\"1 0 0\" solref=\"0.02 1\" solimp=\"0.9 0.95 0.001\"/></default>\n";
  write_assets(scene, out);
  out << "<worldbody>\n";
  write_bodies(scene, out);
  write_tools(tools, reach_m, out);
  out << "</worldbody></mujoco>\n";
  return out.str();
}

}  // namespace mujoco
