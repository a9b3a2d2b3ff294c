#pragma once
/// @file method_settings.hpp
/// A method as it is compared: by its name, remote coupling with the lead that makes its impulses equal at both ends,
/// or local_contact without the shapes of the scene.
#include <string>
#include <string_view>
#include <vector>

namespace tools {

/// What a user sets who wants remote coupling without its drag (config/README.md, proxy.lead_steps).
inline constexpr const char* kLeadingCoupling = "remote_virtual_coupling, lead_steps: 2";

/// As with an engine of which no shape is known: contacts are the planes that physics tells, one answer old. The
/// harness runs it with HarnessOptions::knows_shapes = false.
inline constexpr const char* kPlanesAlone = "local_contact, planes of physics";

/// Assignments as for --set.
[[nodiscard]] inline std::vector<std::string> method_settings(std::string_view method) {
  if (method == kLeadingCoupling) {
    return {"haptic.0.method=remote_virtual_coupling", "haptic.0.proxy.lead_steps=2"};
  }
  return {"haptic.0.method=" + std::string(method == kPlanesAlone ? "local_contact" : method)};
}

}  // namespace tools
