#pragma once
/// @file registry.hpp
/// Methods by their name in YAML. One row per method in registry.cpp.
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "haptic_node/rendering/echo.hpp"
#include "haptic_node/rendering/mapping.hpp"
#include "haptic_node/rendering/method.hpp"
#include "rtbus/shapes/known_shape.hpp"
#include "rtbus/shapes/shapes.hpp"

namespace haptic {

/// Arguments from which a method is made.
struct MethodContext {
  double stiffness_n_per_m = 0.0;  ///< At the device, after its limit.
  double damping_n_s_per_m = 0.0;
  const Mapping& mapping;                          ///< Outlives the method.
  std::vector<rtbus::shapes::PlacedShape> shapes;  ///< Static analytic bodies of the scene, in W.
  bool paper = false;                              ///< `form: paper`.
  double proxy_mass_kg = 0.1;                      ///< In the world, for a method that simulates the proxy itself.
  std::vector<rtbus::shapes::KnownShape> known{};  ///< Shapes of the scene, for a method that finds contacts itself.
  std::size_t other_hands = 0;                     ///< Haptic nodes of the session besides this one.
  Echo echo{};                                     ///< Of a network between the loop and physics.
};

/// The force that physics computes for a method, if any.
enum class ServerForce : std::uint8_t {
  kNone,
  kPlain,      ///< Eq. (3).
  kPredicted,  ///< Eq. (4).
};

struct MethodEntry {
  std::string_view name;
  bool needs_physics;
  /// The method simulates the proxy itself. Physics then publishes ProxyContacts (rtbus/contact_messages.hpp), and its
  /// own proxy follows without pushing.
  bool needs_contacts;
  std::unique_ptr<Method> (*make)(const MethodContext& context);
  ServerForce server_force = ServerForce::kNone;
  bool counts_world_work =
      false;  ///< Its spring ends at the proxy of physics: the work of the world there is counted too.
};

[[nodiscard]] std::span<const MethodEntry> registered_methods() noexcept;

/// Null when no method has that name.
[[nodiscard]] const MethodEntry* find_method(std::string_view name) noexcept;

}  // namespace haptic
