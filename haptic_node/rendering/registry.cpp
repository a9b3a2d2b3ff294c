#include "haptic_node/rendering/registry.hpp"

#include <algorithm>
#include <array>

#include "haptic_node/rendering/direct.hpp"
#include "haptic_node/rendering/interpolation.hpp"
#include "haptic_node/rendering/local_contact.hpp"
#include "haptic_node/rendering/remote_virtual_coupling.hpp"
#include "haptic_node/rendering/virtual_coupling.hpp"

namespace haptic {

namespace {

std::unique_ptr<Method> make_direct(const MethodContext& context) {
  return std::make_unique<Direct>(context.stiffness_n_per_m, context.damping_n_s_per_m, context.mapping,
                                  context.shapes);
}

std::unique_ptr<Method> make_remote_virtual_coupling(const MethodContext& context) {
  return std::make_unique<RemoteVirtualCoupling>(context.stiffness_n_per_m, context.damping_n_s_per_m, context.paper,
                                                 context.echo);
}

std::unique_ptr<Method> make_interpolation(const MethodContext& context) {
  return std::make_unique<Interpolation>("interpolation", context.paper);
}

std::unique_ptr<Method> make_interpolation_predicted(const MethodContext& context) {
  return std::make_unique<Interpolation>("interpolation_predicted", context.paper);
}

std::unique_ptr<Method> make_virtual_coupling(const MethodContext& context) {
  return std::make_unique<VirtualCoupling>(context.stiffness_n_per_m, context.damping_n_s_per_m, context.proxy_mass_kg,
                                           context.paper, context.mapping, context.shapes);
}

std::unique_ptr<Method> make_local_contact(const MethodContext& context) {
  return std::make_unique<LocalContact>(context.stiffness_n_per_m, context.damping_n_s_per_m, context.mapping,
                                        context.known, context.other_hands);
}

constexpr std::array kMethods{
    MethodEntry{"direct", false, false, &make_direct},
    MethodEntry{"virtual_coupling", false, false, &make_virtual_coupling},
    MethodEntry{"remote_virtual_coupling", true, false, &make_remote_virtual_coupling, ServerForce::kNone, true},
    MethodEntry{"local_contact", true, true, &make_local_contact},
    MethodEntry{"interpolation", true, false, &make_interpolation, ServerForce::kPlain},
    MethodEntry{"interpolation_predicted", true, false, &make_interpolation_predicted, ServerForce::kPredicted},
};

}  // namespace

std::span<const MethodEntry> registered_methods() noexcept { return kMethods; }

const MethodEntry* find_method(std::string_view name) noexcept {
  const auto* found = std::find_if(kMethods.begin(), kMethods.end(), [&](const auto& row) { return row.name == name; });
  return found == kMethods.end() ? nullptr : found;
}

}  // namespace haptic
