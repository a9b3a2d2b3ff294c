#pragma once
/// @file set_up.hpp
/// What the makers' setup tool has left on this machine, and what a Touch needs besides libHD. Files are read only.
#include <string>
#include <vector>

#include "drivers/driver_module.hpp"

namespace drivers::openhaptics {

/// Names of the devices that are set up for this user, as hdInitDevice() takes them: the files in $GTDD_HOME/config, or
/// in the usual folders when GTDD_HOME is not set.
[[nodiscard]] std::vector<std::string> devices_set_up();

/// Each device that is set up; that none is; GTDD_HOME.
[[nodiscard]] std::vector<Finding> look_at_configuration();

/// The libraries of ncurses 5, which older drivers of the maker need and newer systems no longer have. Maps them.
[[nodiscard]] std::vector<Finding> look_at_ncurses();

}  // namespace drivers::openhaptics
