#pragma once
/// @file config_warnings.hpp
/// What a session allows and its author hardly means: each warning names the place, the cause and the remedy.
#include <cstddef>
#include <string>
#include <vector>

#include "haptic_node/node_config.hpp"

namespace haptic {

/// Where the hand of entry `index` goes, where its tip starts, and the mass and size of its tool; of the first entry
/// also bodies that dwarf the workspace or that the device cannot move. @param config Read from that entry already.
[[nodiscard]] std::vector<std::string> config_warnings(const HapticConfig& config,
                                                       rtbus::config::SessionConfig& session, std::size_t index);

/// Why more damping is rendered than the session requests; empty: it is not.
[[nodiscard]] std::string damping_raised(const HapticConfig& config);

/// That the stiffness is above what the device's own damping makes passive, with the formula's figures, and what covers
/// it; empty: it is not.
[[nodiscard]] std::string beyond_passive(const HapticConfig& config);

}  // namespace haptic
