// The functions of rtbus_engine.h that say what became of the world: checked before anything of it is taken.
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "physics_node/external/engine_state.hpp"
#include "rtbus/eigen.hpp"

using Eigen::Vector3d;

namespace {

using namespace physics::external;

/// Beyond these no world of ours has anything (rtbus/sane_sample.cpp); readers would refuse the sample.
constexpr double kFarthest_m = 1e4, kFastest_m_s = 1e4, kMostForce_n = 1e6;
/// A value that readers would refuse, with its name: "hand haptic0: tool.position_m[1] = nan is not finite".
struct Refused {
  std::string text;
};
void check(const std::string& whose, const char* field, double value, double most, int index = -1) {
  if (std::isfinite(value) && std::abs(value) <= most) return;
  const std::string name = whose + field + (index < 0 ? "" : "[" + std::to_string(index) + "]");
  throw Refused{name + " = " + std::to_string(value) + (std::isfinite(value) ? " is impossible" : " is not finite")};
}
/// What is never below zero: a mass, a coefficient of friction.
void check_not_negative(const std::string& whose, const char* field, double value, double most) {
  check(whose, field, value, most);
  if (value < 0.0) throw Refused{whose + field + " = " + std::to_string(value) + " is negative"};
}
template <std::size_t N>
void check(const std::string& whose, const char* field, const double (&values)[N], double most) {
  for (std::size_t i = 0; i < N; ++i) check(whose, field, values[i], most, static_cast<int>(i));
}

/// A rotation of the caller's: zero is none; its length must be near 1.
Eigen::Quaterniond rotation_of(const std::string& whose, const double (&wxyz)[4]) {
  check(whose, "orientation_wxyz", wxyz, kMostForce_n);
  Eigen::Quaterniond out(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
  if (out.squaredNorm() == 0.0) return Eigen::Quaterniond::Identity();
  if (std::abs(out.norm() - 1.0) > 1e-3) {
    throw Refused{whose + "orientation_wxyz has the length " + std::to_string(out.norm()) + "; make it 1"};
  }
  return out.normalized();
}

Vector3d unit_of(const std::string& whose, const double (&normal)[3]) {
  check(whose, "normal", normal, kMostForce_n);
  const Vector3d out = vector_of(normal);
  if (std::abs(out.norm() - 1.0) > 1e-3) {
    throw Refused{whose + "normal has the length " + std::to_string(out.norm()) + "; make it 1"};
  }
  return out.normalized();
}

/// A body that the engine names: an index below their number.
void check_body(const rtbus_engine& engine, const std::string& whose, std::uint32_t body) {
  const std::size_t bodies = std::as_const(*engine.world).state_of_bodies().size();
  if (body < bodies) return;
  throw Refused{whose + "body = " + std::to_string(body) + " does not exist; this session has " +
                std::to_string(bodies) + " (0…" + std::to_string(bodies == 0 ? 0 : bodies - 1) + ")"};
}

template <class Body>
int checked(const Body& body) noexcept {
  return guarded([&]() -> int {
    try {
      body();
      return RTBUS_ENGINE_OK;
    } catch (const Refused& refused) {
      return fail(RTBUS_ENGINE_E_VALUE, refused.text);
    }
  });
}

}  // namespace

int rtbus_engine_set_tool(rtbus_engine* engine, uint32_t hand, const rtbus_engine_tool* tool) {
  if (engine == nullptr || hand >= engine->answer.tools.size()) {
    return fail(RTBUS_ENGINE_E_ARGUMENT, "there is no hand " + std::to_string(hand));
  }
  rtbus_engine_tool given;
  if (!take_struct(tool, given)) return fail(RTBUS_ENGINE_E_ARGUMENT, "tool is null, or its struct_bytes is not set");
  return checked([&] {
    const std::string whose = "hand " + engine->world->hands()[hand].parameters.device + ": tool.";
    check(whose, "position_m", given.position_m, kFarthest_m);
    check(whose, "velocity_m_s", given.velocity_m_s, kFastest_m_s);
    check(whose, "angular_velocity_rad_s", given.angular_velocity_rad_s, kMostForce_n);
    check(whose, "contact_force_n", given.contact_force_n, kMostForce_n);
    check(whose, "spring_force_n", given.spring_force_n, kMostForce_n);
    physics::ProxyReadout readout;
    readout.position_m = vector_of(given.position_m);
    readout.velocity_m_s = vector_of(given.velocity_m_s);
    readout.orientation = rotation_of(whose, given.orientation_wxyz);
    readout.angular_velocity_rad_s = vector_of(given.angular_velocity_rad_s);
    readout.contact_force_n = vector_of(given.contact_force_n);
    readout.contacts = given.contacts;
    engine->answer.tools[hand].readout = readout;
    engine->answer.tools[hand].set = true;
    engine->answer.tools[hand].spring_force_n.reset();
    if (given.tells_spring_force != 0) engine->answer.tools[hand].spring_force_n = vector_of(given.spring_force_n);
  });
}

int rtbus_engine_set_body(rtbus_engine* engine, uint32_t body, const rtbus_engine_body* state) {
  if (engine == nullptr) return fail(RTBUS_ENGINE_E_ARGUMENT, "engine must not be null");
  rtbus_engine_body given;
  if (!take_struct(state, given)) return fail(RTBUS_ENGINE_E_ARGUMENT, "state is null, or its struct_bytes is not set");
  if (!engine->in_step) return fail(RTBUS_ENGINE_E_ORDER, "no step is due: call rtbus_engine_begin() first");
  return checked([&] {
    check_body(*engine, "", body);
    const std::string whose = "body " + std::to_string(body) + ": ";
    if (given.kind > RTBUS_BODY_DYNAMIC) throw Refused{whose + "kind = " + std::to_string(given.kind) + " is unknown"};
    check(whose, "position_m", given.position_m, kFarthest_m);
    check(whose, "velocity_m_s", given.velocity_m_s, kFastest_m_s);
    check(whose, "angular_velocity_rad_s", given.angular_velocity_rad_s, kMostForce_n);
    check(whose, "external_force_n", given.external_force_n, kMostForce_n);
    check(whose, "external_torque_n_m", given.external_torque_n_m, kMostForce_n);
    check(whose, "friction_force_n", given.friction_force_n, kMostForce_n);
    check(whose, "friction_torque_n_m", given.friction_torque_n_m, kMostForce_n);
    check_not_negative(whose, "friction_bound_n", given.friction_bound_n, kMostForce_n);
    for (int i = 0; i < 3; ++i) {
      const std::string field = "inertia_kg_m2[" + std::to_string(i) + "]";
      check_not_negative(whose, field.c_str(), given.inertia_kg_m2[i], kMostForce_n);
    }
    check_not_negative(whose, "mass_kg", given.mass_kg, kMostForce_n);
    physics::ExternalBody made;
    made.pose = {vector_of(given.position_m), rotation_of(whose, given.orientation_wxyz)};
    made.mass_kg = given.mass_kg;
    physics::BodyBehind& behind = made.behind;
    behind.body = body;
    behind.kind = static_cast<physics::BodyKind>(given.kind);
    behind.centre_m = made.pose.position_m;
    behind.velocity_m_s = vector_of(given.velocity_m_s);
    behind.angular_velocity_rad_s = vector_of(given.angular_velocity_rad_s);
    behind.external_force_n = vector_of(given.external_force_n);
    behind.external_torque_n_m = vector_of(given.external_torque_n_m);
    behind.friction_force_n = vector_of(given.friction_force_n);
    behind.friction_torque_n_m = vector_of(given.friction_torque_n_m);
    behind.friction_bound_n = given.friction_bound_n;
    if (behind.kind == physics::BodyKind::kDynamic) {
      const Vector3d inertia = vector_of(given.inertia_kg_m2);
      if (given.mass_kg <= 0.0 || inertia.minCoeff() <= 0.0) {
        throw Refused{whose + "a dynamic body needs a mass_kg and three inertia_kg_m2 above 0"};
      }
      const Eigen::Matrix3d turned = made.pose.orientation.toRotationMatrix();
      behind.inverse_mass_per_kg = 1.0 / given.mass_kg;
      behind.inverse_inertia_per_kg_m2 = turned * inertia.cwiseInverse().asDiagonal() * turned.transpose();
    }
    engine->world->state_of_bodies()[body] = made;
  });
}

int rtbus_engine_add_shape(rtbus_engine* engine, uint32_t body, const rtbus_engine_shape* shape) {
  if (engine == nullptr) return fail(RTBUS_ENGINE_E_ARGUMENT, "engine must not be null");
  rtbus_engine_shape given;
  if (!take_struct(shape, given)) return fail(RTBUS_ENGINE_E_ARGUMENT, "shape is null, or has no struct_bytes");
  return checked([&] {
    const std::string whose = "shape: ";
    check_body(*engine, whose, body);
    if (given.kind < RTBUS_SHAPE_PLANE || given.kind > RTBUS_SHAPE_CYLINDER) {
      throw Refused{whose + "kind = " + std::to_string(given.kind) + " is unknown"};
    }
    check(whose, "size_m", given.size_m, kFarthest_m);
    check(whose, "position_m", given.position_m, kFarthest_m);
    constexpr int kSizes[] = {0, 0, 1, 3, 2, 2};  // of each kind
    for (int i = 0; i < kSizes[given.kind]; ++i) {
      if (given.size_m[i] <= 0.0) throw Refused{whose + "size_m[" + std::to_string(i) + "] must be above 0"};
    }
    const Eigen::Quaterniond turned = rotation_of(whose, given.orientation_wxyz);
    const physics::ToldShape told{body, static_cast<rtbus::ShapeKind>(given.kind),
                                  rtbus::array_of(vector_of(given.size_m)),
                                  rtbus::array_of(vector_of(given.position_m)), rtbus::array_of(turned)};
    if (!engine->shapes.add(told)) throw Refused{"more than " + std::to_string(physics::ShapeTable::kMost) + " shapes"};
  });
}

int rtbus_engine_clear_shapes(rtbus_engine* engine) {
  if (engine == nullptr) return fail(RTBUS_ENGINE_E_ARGUMENT, "engine must not be null");
  engine->shapes.clear();
  return RTBUS_ENGINE_OK;
}

int rtbus_engine_add_contact(rtbus_engine* engine, uint32_t hand, const rtbus_engine_contact* contact) {
  if (engine == nullptr || hand >= engine->answer.tools.size()) {
    return fail(RTBUS_ENGINE_E_ARGUMENT, "there is no hand " + std::to_string(hand));
  }
  rtbus_engine_contact given;
  if (!take_struct(contact, given)) return fail(RTBUS_ENGINE_E_ARGUMENT, "contact is null, or has no struct_bytes");
  if (!engine->gives_bodies) {
    return fail(RTBUS_ENGINE_E_ARGUMENT,
                "this engine was opened without RTBUS_GIVES_BODIES: its contacts are not used");
  }
  return checked([&] {
    const std::string whose = "contact: ";
    check_body(*engine, whose, given.body);
    check(whose, "point_m", given.point_m, kFarthest_m);
    check(whose, "gap_m", given.gap_m, kFarthest_m);
    check_not_negative(whose, "friction", given.friction, kMostForce_n);
    check(whose, "curvature_per_m", given.curvature_per_m, kMostForce_n);
    physics::Contact made;
    made.row = given.body;
    made.point_m = vector_of(given.point_m);
    made.normal = unit_of(whose, given.normal);
    made.gap_m = given.gap_m;
    made.friction = given.friction;
    made.curvature_per_m = given.curvature_per_m;
    engine->answer.tools[hand].contacts.push_back(made);
  });
}

int rtbus_engine_add_support(rtbus_engine* engine, const rtbus_engine_support* support) {
  if (engine == nullptr) return fail(RTBUS_ENGINE_E_ARGUMENT, "engine must not be null");
  rtbus_engine_support given;
  if (!take_struct(support, given)) return fail(RTBUS_ENGINE_E_ARGUMENT, "support is null, or has no struct_bytes");
  return checked([&] {
    const std::string whose = "support: ";
    check_body(*engine, whose, given.body);
    check(whose, "point_m", given.point_m, kFarthest_m);
    check(whose, "force_n", given.force_n, kMostForce_n);
    check_not_negative(whose, "friction", given.friction, kMostForce_n);
    check(whose, "surface_velocity_m_s", given.surface_velocity_m_s, kFastest_m_s);
    check_not_negative(whose, "inverse_mass_per_kg", given.inverse_mass_per_kg, kMostForce_n);
    if (given.force_n <= 0.0) throw Refused{whose + "force_n must be above 0"};
    physics::Support made;
    made.point_m = vector_of(given.point_m);
    made.normal = unit_of(whose, given.normal);
    made.normal_force_n = given.force_n;
    made.friction = given.friction;
    made.surface_velocity_m_s = vector_of(given.surface_velocity_m_s);
    made.inverse_mass_per_kg = given.inverse_mass_per_kg;
    made.points = given.points == 0 ? 4 : given.points;
    engine->answer.supports.push_back({given.body, made});
  });
}
