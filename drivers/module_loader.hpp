#pragma once
/// @file module_loader.hpp
/// Drivers that need a library of their own live in modules, which dlopen maps when a device file names one of them: a
/// session without it maps neither the module nor its library. A module carries C++ types and belongs to the build it
/// was made with; it is never unloaded.
///
/// A module exports one C function that returns its table, and the table begins with a ModuleHead.
#include <cstdint>
#include <string>
#include <type_traits>

#include "drivers/driver_module.hpp"
#include "rtbus/result.hpp"

namespace drivers {

struct ModuleFile {
  const char* file;           ///< "libdrivers_usb.so"
  const char* symbol;         ///< Of the function that returns the table.
  std::uint32_t abi_version;  ///< That this program was built with.
  const char* remedy;         ///< What to do when the file is not there, after "; ".
};

/// Loads the module beside this program or in ../lib, once per process, and checks its head. The text of the failure
/// says what is missing and how to get it. Any thread; @realtime No.
[[nodiscard]] rtbus::Result<const ModuleHead*, std::string> load_module_head(const ModuleFile& module);

/// The same as the table that the module promises. `Table` is of standard layout with a ModuleHead as first member.
template <class Table>
[[nodiscard]] rtbus::Result<const Table*, std::string> load_module(const ModuleFile& module) {
  static_assert(std::is_standard_layout_v<Table>);
  const auto head = load_module_head(module);
  if (!head) return rtbus::Failure{head.error()};
  return reinterpret_cast<const Table*>(*head);
}

}  // namespace drivers
