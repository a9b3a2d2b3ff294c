/// @file rtbus_engine.h
/// Physics of your own in the place of physics_node: `physics: {engine: external, command: [my_engine]}`.
///
/// Library librtbus_engine.so.1. It does everything but the world: it reads the hands, keeps the rate of the session,
/// publishes answers, contacts, poses and statistics, and beats from a thread of its own, so that an engine that is
/// slow is not taken for one that is dead. The engine's loop:
///
///     rtbus_engine_open(NULL, &engine);
///     while (rtbus_engine_begin(engine, &step) >= 0) {         // sleeps until a step is due
///       if (step.due == 0) continue;                           // nothing yet: look after your own affairs
///       for each hand: rtbus_engine_get_hand(), then advance its tool and your world by step.step_s
///       for each hand: rtbus_engine_set_tool()
///       rtbus_engine_finish(engine);                           // publishes
///     }
///     rtbus_engine_close(engine);
///
/// An engine that gives the tool only serves the methods remote_virtual_coupling, interpolation and
/// interpolation_predicted. One that also gives bodies and contacts (`gives`) serves local_contact.
///
/// Frame W: right-handed, y up. SI units. Quaternions are (w, x, y, z). One engine per process.
///
/// Threads: the library has threads of its own, which keep time, read the hands and beat. They never call the program.
/// The engine belongs to one thread of the program at a time; each function says after @thread from where it may be
/// called. A world with threads of its own collects their results before finish(). After fork() only the parent goes
/// on. Statuses, sentences and `struct_bytes` as in rtbus.h; rtbus_engine_last_error() has the sentence.
#ifndef RTBUS_ENGINE_H
#define RTBUS_ENGINE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined(__GNUC__)
#define RTBUS_ENGINE_API __attribute__((visibility("default")))
#else
#define RTBUS_ENGINE_API
#endif

#define RTBUS_ENGINE_ABI_VERSION 1

/// What an engine gives besides the tool.
enum { RTBUS_GIVES_BODIES = 1 };

/// Statuses: the numbers of rtbus.h.
enum {
  RTBUS_ENGINE_OK = 0,
  RTBUS_ENGINE_E_OWNED = -2,     ///< Another engine serves this session.
  RTBUS_ENGINE_E_SYSTEM = -7,    ///< A system call failed.
  RTBUS_ENGINE_E_ARGUMENT = -8,  ///< A null pointer, an index or a size that makes no sense.
  RTBUS_ENGINE_E_VALUE = -9,     ///< A number that is not finite, or impossible. Nothing was published.
  RTBUS_ENGINE_E_MEMORY = -12,
  RTBUS_ENGINE_E_ENDED = -13,   ///< The session ends (SIGTERM). Close the engine and leave.
  RTBUS_ENGINE_E_CONFIG = -14,  ///< The session file; or it asks for what this engine does not give.
  RTBUS_ENGINE_E_ORDER = -15    ///< Calls in the wrong order: finish() without a step that is due, say.
};

typedef struct rtbus_engine rtbus_engine;

typedef struct rtbus_engine_options {
  size_t struct_bytes;
  const char* config;  ///< Session file; null: the one that `rtbus run` names ($RTBUS_ENGINE_CONFIG).
  const char* set;     ///< Lines "key=value" that change it; null: those of `rtbus run` ($RTBUS_ENGINE_SET).
  uint32_t gives;      ///< RTBUS_GIVES_BODIES or 0.
  uint32_t bodies;     ///< Bodies that rtbus_engine_set_body() knows. 0: those of the session's scene.
} rtbus_engine_options;

/// Opens the engine's end of a session. @param options Null: as if all zero.
/// @thread Any; all other calls come from one thread at a time from then on: the engine's.
RTBUS_ENGINE_API int rtbus_engine_open(const rtbus_engine_options* options, rtbus_engine** out);

/// Ends: the last heartbeat says so, the topics go. Null is allowed.
/// @thread The engine's.
RTBUS_ENGINE_API void rtbus_engine_close(rtbus_engine* engine);

/// The sentence of this thread's last failed call. Never null.
/// @thread Any; each thread has its own sentence.
RTBUS_ENGINE_API const char* rtbus_engine_last_error(void);

/// @thread Any.
RTBUS_ENGINE_API uint32_t rtbus_engine_abi_version(void);

/// The session as the engine has it.
typedef struct rtbus_engine_info {
  size_t struct_bytes;
  char session[40];
  double step_s;           ///< Of a step; with `pace: free` the longest [s].
  double gravity_m_s2[3];  ///< Of the scene.
  uint32_t hands;
  uint32_t bodies;
} rtbus_engine_info;
/// @thread The engine's.
RTBUS_ENGINE_API int rtbus_engine_get_info(const rtbus_engine* engine, rtbus_engine_info* out);

typedef struct rtbus_engine_step {
  size_t struct_bytes;
  double step_s;        ///< Advance the world by this [s].
  uint64_t step_index;  ///< From 1.
  uint32_t due;         ///< 1: take this step, then finish(). 0: none was due within 0.1 s.
  uint32_t reserved;
} rtbus_engine_step;

/// Sleeps until a step is due, at most 0.1 s, and takes what the hands have done. RTBUS_ENGINE_E_ENDED: time to close.
/// A step that was begun and not finished is given again.
/// @thread The engine's, which sleeps.
RTBUS_ENGINE_API int rtbus_engine_begin(rtbus_engine* engine, rtbus_engine_step* out);

/// What a hand's tool does in this step.
enum {
  RTBUS_TOOL_AWAY = 0,    ///< It pulls nothing and touches nothing: nobody holds the device. Leave it where it is.
  RTBUS_TOOL_SPRING = 1,  ///< A body of mass_kg on a spring-damper to the target. Solve it implicitly.
  RTBUS_TOOL_PLACED = 2   ///< The haptic loop simulates it. It is at the target and touches nothing; bodies get `push`.
};

/// Impulse of the hand on one body, as a constant force over the step.
typedef struct rtbus_engine_push {
  uint32_t body;
  uint32_t reserved;
  double force_n[3];     ///< At the centre of mass.
  double torque_n_m[3];  ///< Besides.
} rtbus_engine_push;

#define RTBUS_ENGINE_PUSHES 4

typedef struct rtbus_engine_hand {
  size_t struct_bytes;
  char name[16];             ///< "haptic0".
  uint32_t tool;             ///< RTBUS_TOOL_….
  uint32_t reset;            ///< 1: put the tool at the target, at rest, before this step.
  double mass_kg, radius_m;  ///< Of the tool, a sphere; radius 0: a point.
  double friction;           ///< Of the tool, to be multiplied with the body's.
  double target_position_m[3];
  double target_velocity_m_s[3];  ///< The damper acts on the velocity relative to it.
  double stiffness_n_per_m;
  double damping_n_s_per_m;
  double force_n[3];        ///< On the tool besides, constant over the step.
  uint32_t wants_contacts;  ///< 1: contacts and the bodies behind them are used.
  uint32_t pushes;          ///< Rows of `push` that count.
  double contact_reach_m;   ///< Give contacts within this distance of the tool's surface [m].
  rtbus_engine_push push[RTBUS_ENGINE_PUSHES];
} rtbus_engine_hand;
/// Before the first step: name, mass_kg, radius_m, friction and contact_reach_m; the tool is away.
/// @thread The engine's.
RTBUS_ENGINE_API int rtbus_engine_get_hand(rtbus_engine* engine, uint32_t hand, rtbus_engine_hand* out);

/// The tool after the step.
typedef struct rtbus_engine_tool {
  size_t struct_bytes;
  double position_m[3];
  double velocity_m_s[3];
  double orientation_wxyz[4];  ///< All zero: not turned.
  double angular_velocity_rad_s[3];
  double contact_force_n[3];    ///< On the tool by the bodies, mean over the step.
  uint32_t contacts;            ///< Places where it touches.
  uint32_t tells_spring_force;  ///< 1: spring_force_n counts. 0: the library takes the spring's force at the end.
  double spring_force_n[3];  ///< On the tool by its spring and `force_n`, mean over the step, where the step has parts.
} rtbus_engine_tool;

/// Each hand with RTBUS_TOOL_SPRING needs this in each step; others keep what they had.
/// @thread The engine's.
RTBUS_ENGINE_API int rtbus_engine_set_tool(rtbus_engine* engine, uint32_t hand, const rtbus_engine_tool* tool);

enum { RTBUS_BODY_STATIC = 0, RTBUS_BODY_KINEMATIC = 1, RTBUS_BODY_DYNAMIC = 2 };

/// A body after the step. Kept until it is set again: a static one once, others in each step.
typedef struct rtbus_engine_body {
  size_t struct_bytes;
  uint32_t kind;  ///< RTBUS_BODY_….
  uint32_t reserved;
  double position_m[3];        ///< Centre of mass.
  double orientation_wxyz[4];  ///< Of the axes that inertia_kg_m2 belongs to. All zero: not turned.
  double velocity_m_s[3];
  double angular_velocity_rad_s[3];
  double mass_kg;                 ///< Dynamic only.
  double inertia_kg_m2[3];        ///< Principal moments, about the centre of mass.
  double external_force_n[3];     ///< Gravity, and normal forces of all its contacts but those with tools.
  double external_torque_n_m[3];  ///< Of the same, about the centre of mass.
  double friction_force_n[3];     ///< Friction of the same contacts.
  double friction_torque_n_m[3];
  double friction_bound_n;  ///< Upper bound of this friction: the sum of μ·N.
} rtbus_engine_body;
/// @thread The engine's.
RTBUS_ENGINE_API int rtbus_engine_set_body(rtbus_engine* engine, uint32_t body, const rtbus_engine_body* state);

/// What a body looks like, for viewers. Planes (y = 0), capsules and cylinders stand along y of the shape's frame.
enum {
  RTBUS_SHAPE_PLANE = 1,
  RTBUS_SHAPE_SPHERE = 2,
  RTBUS_SHAPE_BOX = 3,
  RTBUS_SHAPE_CAPSULE = 4,
  RTBUS_SHAPE_CYLINDER = 5
};

typedef struct rtbus_engine_shape {
  size_t struct_bytes;
  uint32_t kind;  ///< RTBUS_SHAPE_….
  uint32_t reserved;
  double size_m[3];      ///< Sphere: radius. Box: half edges. Capsule, with both caps, and cylinder: radius, length.
  double position_m[3];  ///< In the frame of the body: its centre of mass and the axes of its orientation.
  double orientation_wxyz[4];  ///< Likewise. All zero: not turned.
} rtbus_engine_shape;

/// Adds a shape to a body; it may have several, or none. Once is enough: in the first step, or when the world changes.
/// finish() publishes the table, with an epoch and a hash, when it has changed: topic `physics.body_shapes`. Viewers
/// then show these bodies and not the scene file's. At most 1024 shapes.
/// @thread The engine's.
RTBUS_ENGINE_API int rtbus_engine_add_shape(rtbus_engine* engine, uint32_t body, const rtbus_engine_shape* shape);

/// Forgets all shapes. With no others added, viewers show nothing.
/// @thread The engine's.
RTBUS_ENGINE_API int rtbus_engine_clear_shapes(rtbus_engine* engine);

/// A place where a tool touches a body, or may soon: after the step.
typedef struct rtbus_engine_contact {
  size_t struct_bytes;
  uint32_t body;
  uint32_t reserved;
  double point_m[3];       ///< On the body's surface.
  double normal[3];        ///< Unit, from the body to the tool.
  double gap_m;            ///< From surface to surface; negative: penetrates.
  double friction;         ///< Coulomb coefficient of the pair.
  double curvature_per_m;  ///< Of the surface of a ball; 0: a plane.
} rtbus_engine_contact;

/// Adds a contact of this step; there may be none. Of more than 16 the nearest are used.
/// @thread The engine's.
RTBUS_ENGINE_API int rtbus_engine_add_contact(rtbus_engine* engine, uint32_t hand, const rtbus_engine_contact* contact);

/// Another body that holds one up: after the step, with a force > 0.
typedef struct rtbus_engine_support {
  size_t struct_bytes;
  uint32_t body;      ///< The one that is held.
  uint32_t points;    ///< Contact points that carry: 1 a point, 2 an edge, 3 or more a face. 0: 4.
  double point_m[3];  ///< Mean of the points, weighted by their forces.
  double normal[3];   ///< Unit, towards the body that is held.
  double force_n;
  double friction;
  double surface_velocity_m_s[3];  ///< Of what holds, at the point.
  double inverse_mass_per_kg;      ///< Of what holds; 0: no force moves it.
} rtbus_engine_support;
/// @thread The engine's.
RTBUS_ENGINE_API int rtbus_engine_add_support(rtbus_engine* engine, const rtbus_engine_support* support);

/// Publishes the step. RTBUS_ENGINE_E_VALUE: a number is not finite, impossible, or a spring's tool was not set; the
/// sentence names it, and nothing was published. Set it right and call again, or leave: the force fades by itself.
/// @thread The engine's. Does not wait for readers.
RTBUS_ENGINE_API int rtbus_engine_finish(rtbus_engine* engine);

#ifdef __cplusplus
}
#endif

#endif
