#include "drivers/vendor/shared_library.hpp"

#include <dlfcn.h>

#include <string_view>

namespace drivers::vendor {
namespace {

/// "libX.so.1: cannot open shared object file: No such file or directory" about the file itself, not about a library
/// that it needs.
bool is_simply_not_there(std::string_view file, std::string_view error) {
  return error.starts_with(std::string(file) + ":") && error.find("No such file") != error.npos;
}

std::string remedy_for(std::string_view error) {
  const auto says = [&](std::string_view text) { return error.find(text) != error.npos; };
  if (says("libncurses.so.5") || says("libtinfo.so.5")) {
    return "install the packages libncurses5 and libtinfo5; Ubuntu 23.10 and later no longer have them, those of 22.04 "
           "fit";
  }
  if (says("libPhantomIOLib42")) {
    return "install the device driver package TouchDriver of 3D Systems, run its installation script with bash, then "
           "ldconfig";
  }
  if (says("libusb-1.0")) return "install the package libusb-1.0-0";
  if (says("wrong ELF class") || says("invalid ELF header") || says("wrong architecture")) {
    return "it was made for another kind of computer; take the vendor's files for this one";
  }
  if (says("No such file")) return "install the library that it names, then run ldconfig";
  return "install the vendor's package again";
}

}  // namespace

rtbus::Result<std::string, std::string> load_library(const LibraryRequest& request,
                                                     const std::vector<Symbol>& symbols) {
  using rtbus::Failure;
  std::string tried;
  for (const std::string& file : request.files) {
    void* const library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (library == nullptr) {
      const char* const said = dlerror();
      const std::string error = said == nullptr ? "" : said;
      if (!is_simply_not_there(file, error))
        return Failure{file + " cannot be loaded: " + error + "; " + remedy_for(error)};
      tried += (tried.empty() ? "" : ", ") + file;
      continue;
    }
    for (const Symbol& symbol : symbols) {
      *symbol.address = dlsym(library, symbol.name);
      if (*symbol.address == nullptr && symbol.required) {
        return Failure{file + " has no function " + symbol.name + "; " + request.remedy_old};
      }
    }
    return file;
  }
  return Failure{"none of " + tried + " is there; " + request.remedy_missing};
}

}  // namespace drivers::vendor
