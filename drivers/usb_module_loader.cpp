#include <dlfcn.h>

#include <filesystem>

#include "drivers/usb/driver_module.hpp"

namespace drivers::usb {

rtbus::Result<const UsbModule*, std::string> load_usb_module() {
  using rtbus::Failure;
  // Beside this program, or in ../lib: where the build and an installation put modules.
  std::error_code failed;
  const auto folder = std::filesystem::read_symlink("/proc/self/exe", failed).parent_path();
  const std::filesystem::path places[] = {folder / kUsbModuleFile,
                                          (folder / "../lib" / kUsbModuleFile).lexically_normal()};
  std::filesystem::path file;
  for (const auto& place : places) {
    if (file.empty() && std::filesystem::is_regular_file(place, failed)) file = place;
  }
  if (file.empty()) {
    return Failure{std::string("needs the module ") + kUsbModuleFile + ", which is not in " +
                   places[0].parent_path().string() + " or " + places[1].parent_path().string() +
                   "; build with RTBUS_WITH_USB=ON (Debian package libusb-1.0-0-dev)"};
  }
  void* const library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);  // again: the same handle
  if (library == nullptr) return Failure{std::string("cannot load its module: ") + dlerror()};
  const auto function = reinterpret_cast<UsbModuleFunction>(dlsym(library, kUsbModuleSymbol));
  if (function == nullptr) return Failure{"finds that " + file.string() + " is no module of ours; build it anew"};
  const UsbModule* const module = function();
  if (module->abi_version != kUsbAbiVersion || module->info_bytes != sizeof(DeviceInfo)) {
    return Failure{"finds that " + file.string() + " belongs to another build of this program; build both anew"};
  }
  return module;
}

}  // namespace drivers::usb
