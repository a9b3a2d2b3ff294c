#pragma once
/// @file registry.hpp
/// Force laws by their name in YAML. One row per law in registry.cpp.
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "haptic_node/mapping.hpp"
#include "haptic_node/rendering/renderer.hpp"
#include "rtbus/shapes/shapes.hpp"

namespace haptic {

/// What a law may be made from.
struct RendererContext {
  double stiffness_n_per_m = 0.0;  ///< At the device, after its limit.
  double damping_n_s_per_m = 0.0;
  const Mapping& mapping;                          ///< Outlives the renderer.
  std::vector<rtbus::shapes::PlacedShape> shapes;  ///< Static analytic bodies of the scene, in W.
  bool paper = false;                              ///< `form: paper`.
  double proxy_mass_kg = 0.1;                      ///< In the world, for a law that simulates the proxy itself.
};

/// What a law orders of physics besides the proxy.
enum class ServerForce : std::uint8_t {
  kNone,
  kPlain,      ///< Eq. (3).
  kPredicted,  ///< Eq. (4).
};

struct RendererEntry {
  std::string_view name;
  bool needs_physics;
  /// The law integrates the proxy itself: physics publishes ProxyContacts (rtbus/contact_messages.hpp), which it else saves,
  /// and its proxy follows without pushing.
  bool needs_contacts;
  std::unique_ptr<Renderer> (*make)(const RendererContext& context);
  ServerForce server_force = ServerForce::kNone;
  bool books_world = false;  ///< Its spring ends at the proxy: the work that the world does there is booked as well.
};

[[nodiscard]] std::span<const RendererEntry> registered_renderers() noexcept;

/// Null when no law has that name.
[[nodiscard]] const RendererEntry* find_renderer(std::string_view name) noexcept;

}  // namespace haptic
