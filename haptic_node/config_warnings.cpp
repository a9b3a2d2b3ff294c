#include "haptic_node/config_warnings.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "rtbus/config/closed_surface.hpp"
#include "rtbus/config/overlap.hpp"
#include "rtbus/eigen.hpp"
#include "rtbus/three_digits.hpp"

namespace haptic {
namespace {

using Eigen::Vector3d;
using rtbus::three_digits;

/// Times the longest edge of the workspace: larger is a slip of units.
constexpr double kDwarfs = 10.0;
/// To cross the workspace under the device's continuous force: what takes longer is a wall to the hand.
constexpr double kMoves_s = 1.0;

std::string point(const Vector3d& p) {
  return "[" + three_digits(p.x()) + ", " + three_digits(p.y()) + ", " + three_digits(p.z()) + "] m";
}

/// The hand's side of a session, in the world.
struct Reach {
  explicit Reach(const HapticConfig& config) {
    const drivers::DeviceInfo& device = config.device->info();
    const Vector3d edges_m = config.mapping.position_scale *
                             (rtbus::vector_of(device.workspace_max_m) - rtbus::vector_of(device.workspace_min_m));
    longest_m = edges_m.maxCoeff();
    shortest_m = edges_m.minCoeff();
    force_n = config.mapping.force_scale * device.continuous_force_n;
  }
  /// Time to move a mass across the workspace from rest [s]: d = F·t²/(2·m).
  [[nodiscard]] double crossing_s(double mass_kg) const { return std::sqrt(2.0 * mass_kg * longest_m / force_n); }

  double longest_m = 0.0, shortest_m = 0.0;  ///< Edges of the workspace.
  double force_n = 0.0;                      ///< Continuous force of the device.
};

std::string too_heavy(const Reach& reach, double mass_kg) {
  return "is more than the hand moves: the device's continuous force, " + three_digits(reach.force_n) +
         " N in the world, needs " + three_digits(reach.crossing_s(mass_kg)) +
         " s to move it across the workspace of " + three_digits(reach.longest_m) + " m; ";
}

std::string too_large(const Reach& reach) {
  return ", and the workspace in the world only " + three_digits(reach.longest_m) + " m; ";
}

void check_tool(const HapticConfig& config, const rtbus::config::Map& proxy, const Reach& reach,
                std::vector<std::string>& out) {
  if (reach.crossing_s(config.proxy.mass_kg) > kMoves_s) {
    out.push_back(proxy.sentence("mass_kg", too_heavy(reach, config.proxy.mass_kg) + "lower it"));
  }
  if (2.0 * config.proxy.radius_m > reach.shortest_m) {
    out.push_back(proxy.sentence("radius_m", "makes a tool wider than the workspace, which is " +
                                                 three_digits(reach.shortest_m) + " m wide in the world; lower it"));
  }
}

/// The first body that the tip starts in.
void check_start(const HapticConfig& config, const rtbus::config::Scene& scene, std::vector<std::string>& out) {
  const std::optional<drivers::Vec3> start = config.device->start_position_m();
  if (!start) return;
  const Vector3d tip_W = Mapping(config.mapping).position_to_world(rtbus::vector_of(*start));
  const auto warn = [&](const auto& body, const char* what = "the contact pushes it out") {
    out.push_back(body.source + " (" + body.name + ") holds the tip of " + config.name + " at the start, " +
                  point(tip_W) + ": " + what + "; move the body, mapping.offset_m or the device's start");
  };
  constexpr double kDepth_m = 1e-6;
  const auto rigid = std::find_if(scene.bodies.begin(), scene.bodies.end(),
                                  [&](const auto& body) { return is_inside(body, tip_W, kDepth_m); });
  if (rigid != scene.bodies.end()) {
    const bool mesh = std::holds_alternative<rtbus::config::Mesh>(rigid->shape);
    return mesh ? warn(*rigid, "a mesh has no inside, and keeps it there") : warn(*rigid);
  }
  const auto soft = std::find_if(scene.soft_bodies.begin(), scene.soft_bodies.end(),
                                 [&](const auto& body) { return is_inside(body, tip_W); });
  if (soft != scene.soft_bodies.end()) warn(*soft);
}

const rtbus::config::TriangleMesh* mesh_of(const rtbus::config::Body& body) {
  if (const auto* hull = std::get_if<rtbus::config::ConvexHull>(&body.shape)) return hull->points.get();
  if (const auto* mesh = std::get_if<rtbus::config::Mesh>(&body.shape)) return mesh->surface.get();
  return nullptr;
}

/// A mesh in millimetres that was taken for metres. @returns whether it is one.
bool check_unit(const rtbus::config::TriangleMesh& mesh, const std::string& source, const std::string& name,
                const Reach& reach, std::vector<std::string>& out) {
  const double length_m = mesh.extents_m().maxCoeff();
  if (!mesh.unit_assumed || length_m <= kDwarfs * reach.longest_m) return false;
  out.push_back(source + " (" + name + "): without metres_per_unit " + mesh.file + " is " + three_digits(length_m) +
                " m long" + too_large(reach) + "write metres_per_unit: 0.001 if its numbers are millimetres");
  return true;
}

/// Once per item of the file: the copies of a grid are alike.
void check_bodies(const rtbus::config::Scene& scene, const Reach& reach, std::vector<std::string>& out) {
  const std::string* source = nullptr;
  for (const rtbus::config::Body& body : scene.bodies) {
    if (source != nullptr && *source == body.source) continue;
    source = &body.source;
    const auto* mesh = mesh_of(body);
    if (mesh != nullptr && check_unit(*mesh, body.source, body.name, reach, out)) continue;
    if (const auto* surface = std::get_if<rtbus::config::Mesh>(&body.shape)) {
      for (std::string& fault : surface_faults(*surface->surface)) {
        out.push_back(body.source + " (" + body.name + "): " + std::move(fault));
      }
    }
    if (body.type != rtbus::config::BodyType::kDynamic) continue;
    if (reach.crossing_s(body.mass_kg) > kMoves_s) {
      out.push_back(body.source + " (" + body.name + "): mass_kg = " + three_digits(body.mass_kg) + " " +
                    too_heavy(reach, body.mass_kg) + "lower it, or write type: static");
    }
    const double length_m = extents_m(body.shape).maxCoeff();
    if (length_m > kDwarfs * reach.longest_m) {
      out.push_back(body.source + " (" + body.name + ") is " + three_digits(length_m) + " m long" + too_large(reach) +
                    "make it smaller, raise mapping.position_scale, or write type: static");
    }
  }
  for (const rtbus::config::SoftBody& body : scene.soft_bodies) {
    (void)check_unit(*body.mesh, body.source, body.name, reach, out);
  }
}

}  // namespace

std::vector<std::string> config_warnings(const HapticConfig& config, rtbus::config::SessionConfig& session,
                                         std::size_t index) {
  std::vector<std::string> out = config.device->warnings();
  const Reach reach(config);
  if (const auto proxy = session.haptic[index].map.optional_map("proxy")) check_tool(config, *proxy, reach, out);
  check_start(config, session.scene, out);
  if (index == 0) check_bodies(session.scene, reach, out);
  return out;
}

std::string damping_raised(const HapticConfig& config) {
  if (config.damping_n_s_per_m <= config.damping_requested_n_s_per_m) return "";
  // A fifth of critical, unless mass, rate and velocity filter carry less.
  const double critical_n_s_per_m = 2.0 * std::sqrt(config.stiffness_n_per_m * config.device->info().apparent_mass_kg);
  return "requested damping " + three_digits(config.damping_requested_n_s_per_m) + " N s/m raised to " +
         three_digits(config.damping_n_s_per_m) + " N s/m, " +
         three_digits(100.0 * config.damping_n_s_per_m / critical_n_s_per_m) + " % of critical: with less, " +
         config.method + " rings the tip where physics is slow";
}

std::string beyond_passive(const HapticConfig& config) {
  const double passive_n_per_m = config.passive_stiffness_n_per_m();
  const auto stiffness = [](double n_per_m) {  // not -1.02e+03
    return std::abs(n_per_m) < 100.0 ? three_digits(n_per_m) : std::to_string(std::lround(n_per_m));
  };
  if (config.stiffness_n_per_m <= std::max(0.0, passive_n_per_m)) return "";
  const std::string formula = "2(b - |B|)/T = 2(" + three_digits(config.device->info().viscous_damping_n_s_per_m) +
                              " - " + three_digits(std::abs(config.damping_n_s_per_m)) + " N s/m)/" +
                              three_digits(1e3 / config.rate_hz) + " ms = " + stiffness(passive_n_per_m) + " N/m";
  const std::string up_to = passive_n_per_m > 0.0 ? " a sampled wall passive only up to " + formula
                                                  : " no sampled wall passive (" + formula + ")";
  return "the device's own damping alone makes" + up_to + "; " +
         (config.safety.passivity.control
              ? "the passivity controller covers the " + stiffness(config.stiffness_n_per_m) + " N/m of this session"
              : "nothing else does here: the passivity controller only observes");
}

}  // namespace haptic
