// libdrivers_replay.so: the replay driver in a module, for nothing else of a node maps HDF5.
#include "drivers/driver_module.hpp"
#include "drivers/replay/replay_config.hpp"

RTBUS_DRIVER_MODULE("replay", "The hand's motion out of a recording, no hardware", &drivers::replay::parse)
