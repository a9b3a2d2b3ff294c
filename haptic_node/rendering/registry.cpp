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

std::unique_ptr<Renderer> make_direct(const RendererContext& context) {
  return std::make_unique<Direct>(context.stiffness_n_per_m, context.damping_n_s_per_m, context.mapping,
                                  context.shapes);
}

std::unique_ptr<Renderer> make_remote_virtual_coupling(const RendererContext& context) {
  return std::make_unique<RemoteVirtualCoupling>(context.stiffness_n_per_m, context.damping_n_s_per_m, context.paper);
}

std::unique_ptr<Renderer> make_interpolation(const RendererContext& context) {
  return std::make_unique<Interpolation>("interpolation", context.paper);
}

std::unique_ptr<Renderer> make_interpolation_predicted(const RendererContext& context) {
  return std::make_unique<Interpolation>("interpolation_predicted", context.paper);
}

std::unique_ptr<Renderer> make_virtual_coupling(const RendererContext& context) {
  return std::make_unique<VirtualCoupling>(context.stiffness_n_per_m, context.damping_n_s_per_m, context.proxy_mass_kg,
                                           context.paper, context.mapping, context.shapes);
}

std::unique_ptr<Renderer> make_local_contact(const RendererContext& context) {
  return std::make_unique<LocalContact>(context.stiffness_n_per_m, context.damping_n_s_per_m, context.mapping);
}

constexpr std::array kRenderers{
    RendererEntry{"direct", false, false, &make_direct},
    RendererEntry{"virtual_coupling", false, false, &make_virtual_coupling},
    RendererEntry{"remote_virtual_coupling", true, false, &make_remote_virtual_coupling, ServerForce::kNone, true},
    RendererEntry{"local_contact", true, true, &make_local_contact},
    RendererEntry{"interpolation", true, false, &make_interpolation, ServerForce::kPlain},
    RendererEntry{"interpolation_predicted", true, false, &make_interpolation_predicted, ServerForce::kPredicted},
};

}  // namespace

std::span<const RendererEntry> registered_renderers() noexcept { return kRenderers; }

const RendererEntry* find_renderer(std::string_view name) noexcept {
  const auto* found =
      std::find_if(kRenderers.begin(), kRenderers.end(), [&](const auto& row) { return row.name == name; });
  return found == kRenderers.end() ? nullptr : found;
}

}  // namespace haptic
