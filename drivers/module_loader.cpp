#include "drivers/module_loader.hpp"

#include <dlfcn.h>

#include <filesystem>

namespace drivers {

rtbus::Result<const ModuleHead*, std::string> load_module_head(const ModuleFile& module) {
  using rtbus::Failure;
  // Beside this program, or in ../lib: where the build and an installation put modules.
  std::error_code failed;
  const auto folder = std::filesystem::read_symlink("/proc/self/exe", failed).parent_path();
  const std::filesystem::path places[] = {folder / module.file, (folder / "../lib" / module.file).lexically_normal()};
  std::filesystem::path file;
  for (const auto& place : places) {
    if (file.empty() && std::filesystem::is_regular_file(place, failed)) file = place;
  }
  if (file.empty()) {
    return Failure{std::string("needs the module ") + module.file + ", which is not in " +
                   places[0].parent_path().string() + " or " + places[1].parent_path().string() + "; " + module.remedy};
  }
  void* const library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);  // again: the same handle
  if (library == nullptr) return Failure{std::string("cannot load its module: ") + dlerror()};
  const auto function = reinterpret_cast<const ModuleHead* (*)()>(dlsym(library, module.symbol));
  if (function == nullptr) return Failure{"finds that " + file.string() + " is no module of ours; build it anew"};
  const ModuleHead* const head = function();
  if (head->abi_version != module.abi_version || head->info_bytes != sizeof(DeviceInfo)) {
    return Failure{"finds that " + file.string() + " belongs to another build of this program; build both anew"};
  }
  return head;
}

}  // namespace drivers
