// libdrivers_replay.so: the replay driver behind one C symbol.
#include "drivers/replay/driver_module.hpp"
#include "drivers/replay/replay_config.hpp"

extern "C" const drivers::ModuleHead* rtbus_replay_driver() {
  using namespace drivers::replay;
  static const ReplayModule module{{kReplayModule.abi_version}, &parse};
  return &module.head;
}
