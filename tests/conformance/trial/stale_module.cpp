// A module that was built against another rtbus: its ABI version is not ours.
#include "drivers/driver_module.hpp"

extern "C" __attribute__((visibility("default"))) const drivers::ModuleHead* rtbus_driver_module() {
  static const drivers::ModuleHead head{drivers::kDriverAbiVersion + 1000};
  return &head;
}
