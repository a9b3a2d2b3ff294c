/* The interface of external engines in C, and the layouts that engines compiled yesterday rely on. A line here changes
 * only together with the soname; members are added at the end. */
#include <stddef.h>

#include "physics_node/external/rtbus_engine.h"

#define PINNED(type, member, at) _Static_assert(offsetof(type, member) == (at), #type "." #member)
#define BYTES(type, size) _Static_assert(sizeof(type) == (size), #type)

BYTES(rtbus_engine_options, 32);
PINNED(rtbus_engine_options, struct_bytes, 0);
PINNED(rtbus_engine_options, config, 8);
PINNED(rtbus_engine_options, set, 16);
PINNED(rtbus_engine_options, gives, 24);
PINNED(rtbus_engine_options, bodies, 28);

BYTES(rtbus_engine_info, 88);
PINNED(rtbus_engine_info, struct_bytes, 0);
PINNED(rtbus_engine_info, session, 8);
PINNED(rtbus_engine_info, step_s, 48);
PINNED(rtbus_engine_info, gravity_m_s2, 56);
PINNED(rtbus_engine_info, hands, 80);
PINNED(rtbus_engine_info, bodies, 84);

BYTES(rtbus_engine_step, 32);
PINNED(rtbus_engine_step, struct_bytes, 0);
PINNED(rtbus_engine_step, step_s, 8);
PINNED(rtbus_engine_step, step_index, 16);
PINNED(rtbus_engine_step, due, 24);
PINNED(rtbus_engine_step, reserved, 28);

BYTES(rtbus_engine_push, 56);
PINNED(rtbus_engine_push, body, 0);
PINNED(rtbus_engine_push, reserved, 4);
PINNED(rtbus_engine_push, force_n, 8);
PINNED(rtbus_engine_push, torque_n_m, 32);

BYTES(rtbus_engine_hand, 384);
PINNED(rtbus_engine_hand, struct_bytes, 0);
PINNED(rtbus_engine_hand, name, 8);
PINNED(rtbus_engine_hand, tool, 24);
PINNED(rtbus_engine_hand, reset, 28);
PINNED(rtbus_engine_hand, mass_kg, 32);
PINNED(rtbus_engine_hand, radius_m, 40);
PINNED(rtbus_engine_hand, friction, 48);
PINNED(rtbus_engine_hand, target_position_m, 56);
PINNED(rtbus_engine_hand, target_velocity_m_s, 80);
PINNED(rtbus_engine_hand, stiffness_n_per_m, 104);
PINNED(rtbus_engine_hand, damping_n_s_per_m, 112);
PINNED(rtbus_engine_hand, force_n, 120);
PINNED(rtbus_engine_hand, wants_contacts, 144);
PINNED(rtbus_engine_hand, pushes, 148);
PINNED(rtbus_engine_hand, contact_reach_m, 152);
PINNED(rtbus_engine_hand, push, 160);

BYTES(rtbus_engine_tool, 168);
PINNED(rtbus_engine_tool, struct_bytes, 0);
PINNED(rtbus_engine_tool, position_m, 8);
PINNED(rtbus_engine_tool, velocity_m_s, 32);
PINNED(rtbus_engine_tool, orientation_wxyz, 56);
PINNED(rtbus_engine_tool, angular_velocity_rad_s, 88);
PINNED(rtbus_engine_tool, contact_force_n, 112);
PINNED(rtbus_engine_tool, contacts, 136);
PINNED(rtbus_engine_tool, tells_spring_force, 140);
PINNED(rtbus_engine_tool, spring_force_n, 144);

BYTES(rtbus_engine_body, 256);
PINNED(rtbus_engine_body, struct_bytes, 0);
PINNED(rtbus_engine_body, kind, 8);
PINNED(rtbus_engine_body, reserved, 12);
PINNED(rtbus_engine_body, position_m, 16);
PINNED(rtbus_engine_body, orientation_wxyz, 40);
PINNED(rtbus_engine_body, velocity_m_s, 72);
PINNED(rtbus_engine_body, angular_velocity_rad_s, 96);
PINNED(rtbus_engine_body, mass_kg, 120);
PINNED(rtbus_engine_body, inertia_kg_m2, 128);
PINNED(rtbus_engine_body, external_force_n, 152);
PINNED(rtbus_engine_body, external_torque_n_m, 176);
PINNED(rtbus_engine_body, friction_force_n, 200);
PINNED(rtbus_engine_body, friction_torque_n_m, 224);
PINNED(rtbus_engine_body, friction_bound_n, 248);

BYTES(rtbus_engine_shape, 96);
PINNED(rtbus_engine_shape, struct_bytes, 0);
PINNED(rtbus_engine_shape, kind, 8);
PINNED(rtbus_engine_shape, reserved, 12);
PINNED(rtbus_engine_shape, size_m, 16);
PINNED(rtbus_engine_shape, position_m, 40);
PINNED(rtbus_engine_shape, orientation_wxyz, 64);

BYTES(rtbus_engine_contact, 88);
PINNED(rtbus_engine_contact, struct_bytes, 0);
PINNED(rtbus_engine_contact, body, 8);
PINNED(rtbus_engine_contact, reserved, 12);
PINNED(rtbus_engine_contact, point_m, 16);
PINNED(rtbus_engine_contact, normal, 40);
PINNED(rtbus_engine_contact, gap_m, 64);
PINNED(rtbus_engine_contact, friction, 72);
PINNED(rtbus_engine_contact, curvature_per_m, 80);

BYTES(rtbus_engine_support, 112);
PINNED(rtbus_engine_support, struct_bytes, 0);
PINNED(rtbus_engine_support, body, 8);
PINNED(rtbus_engine_support, points, 12);
PINNED(rtbus_engine_support, point_m, 16);
PINNED(rtbus_engine_support, normal, 40);
PINNED(rtbus_engine_support, force_n, 64);
PINNED(rtbus_engine_support, friction, 72);
PINNED(rtbus_engine_support, surface_velocity_m_s, 80);
PINNED(rtbus_engine_support, inverse_mass_per_kg, 104);

_Static_assert(RTBUS_ENGINE_OK == 0 && RTBUS_ENGINE_E_OWNED == -2 && RTBUS_ENGINE_E_SYSTEM == -7, "");
_Static_assert(RTBUS_ENGINE_E_ARGUMENT == -8 && RTBUS_ENGINE_E_VALUE == -9 && RTBUS_ENGINE_E_MEMORY == -12, "");
_Static_assert(RTBUS_ENGINE_E_ENDED == -13 && RTBUS_ENGINE_E_CONFIG == -14 && RTBUS_ENGINE_E_ORDER == -15, "");
_Static_assert(RTBUS_GIVES_BODIES == 1 && RTBUS_ENGINE_PUSHES == 4, "");
_Static_assert(RTBUS_TOOL_AWAY == 0 && RTBUS_TOOL_SPRING == 1 && RTBUS_TOOL_PLACED == 2, "");
_Static_assert(RTBUS_BODY_STATIC == 0 && RTBUS_BODY_KINEMATIC == 1 && RTBUS_BODY_DYNAMIC == 2, "");
_Static_assert(RTBUS_SHAPE_PLANE == 1 && RTBUS_SHAPE_SPHERE == 2 && RTBUS_SHAPE_BOX == 3, "");
_Static_assert(RTBUS_SHAPE_CAPSULE == 4 && RTBUS_SHAPE_CYLINDER == 5, "");

size_t rtbus_engine_abi_checked(void) { return sizeof(rtbus_engine_hand); }
