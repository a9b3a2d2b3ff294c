#include "haptic_node/rendering/registry.hpp"

#include <algorithm>
#include <array>

#include "haptic_node/rendering/direct.hpp"
#include "haptic_node/rendering/remote_virtual_coupling.hpp"

namespace haptic {

namespace {

std::unique_ptr<Renderer> make_direct(const RendererContext& context) {
  return std::make_unique<Direct>(context.stiffness_n_per_m, context.damping_n_s_per_m, context.mapping,
                                  context.shapes);
}

std::unique_ptr<Renderer> make_remote_virtual_coupling(const RendererContext& context) {
  return std::make_unique<RemoteVirtualCoupling>(context.stiffness_n_per_m, context.damping_n_s_per_m);
}

constexpr std::array kRenderers{
    RendererEntry{"direct", false, false, &make_direct},
    RendererEntry{"remote_virtual_coupling", true, false, &make_remote_virtual_coupling},
};

}  // namespace

std::span<const RendererEntry> registered_renderers() noexcept { return kRenderers; }

const RendererEntry* find_renderer(std::string_view name) noexcept {
  const auto* found =
      std::find_if(kRenderers.begin(), kRenderers.end(), [&](const auto& row) { return row.name == name; });
  return found == kRenderers.end() ? nullptr : found;
}

}  // namespace haptic
