// The toy driver as a module: `driver: {module: libtoy.so}` in a device file, or `driver: toy` with RTBUS_DRIVER_PATH.
#include "drivers/driver_module.hpp"
#include "toy_device.hpp"

RTBUS_DRIVER_MODULE("toy", "A mass on a damper, no hardware", &toy::parse)
