#include "drivers/usb_module/usb_module.hpp"

namespace drivers::usb {

rtbus::Result<const UsbModule*, std::string> load_usb_module() {
  return load_module<UsbModule>({kUsbModuleFile, kUsbModuleSymbol, kUsbAbiVersion,
                                 "build with RTBUS_WITH_USB=ON (Debian package libusb-1.0-0-dev)"});
}

}  // namespace drivers::usb
