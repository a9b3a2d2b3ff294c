#include "drivers/module_loader.hpp"

#include <dlfcn.h>

#include "drivers/beside_program.hpp"

namespace drivers {

rtbus::Result<const ModuleHead*, std::string> load_module_head(const ModuleFile& module) {
  using rtbus::Failure;
  const std::string file = find_beside_program(module.file);
  if (file.empty()) {
    const auto folders = program_folders();
    return Failure{std::string("needs the module ") + module.file + ", which is not in " + folders[0].string() +
                   " or " + folders[1].string() + "; " + module.remedy};
  }
  void* const library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);  // again: the same handle
  if (library == nullptr) return Failure{std::string("cannot load its module: ") + dlerror()};
  const auto function = reinterpret_cast<const ModuleHead* (*)()>(dlsym(library, module.symbol));
  if (function == nullptr) {
    return Failure{"finds that " + file + " is no module of ours: it does not export " + module.symbol +
                   "; build it again"};
  }
  const ModuleHead* const head = function();
  if (head->abi_version != module.abi_version || head->info_bytes != sizeof(DeviceInfo)) {
    return Failure{"finds that " + file + " belongs to another build of this program: it has ABI version " +
                   std::to_string(head->abi_version) + " with " + std::to_string(head->info_bytes) +
                   " bytes of DeviceInfo, this program " + std::to_string(module.abi_version) + " with " +
                   std::to_string(sizeof(DeviceInfo)) + "; build both again, against the same rtbus"};
  }
  return head;
}

}  // namespace drivers
