#include "drivers/force_dimension/sdk.hpp"

#include <cstdlib>
#include <vector>

#include "drivers/vendor/shared_library.hpp"

namespace drivers::force_dimension {
namespace {

std::vector<std::string> usual_files() {
  std::vector<std::string> out;
  for (const char* const variable : {"FDSDK", "FORCEDIM_SDK", "FD_SDK_DIR"}) {
    const char* const folder = std::getenv(variable);
    if (folder == nullptr || *folder == '\0') continue;
    for (const char* const below : {"/lib/release/lin-x86_64-gcc/", "/lib/"}) {
      for (const char* const name : {"libdrd.so.3", "libdrd.so"}) out.push_back(folder + std::string(below) + name);
    }
  }
  // libdrd has libdhd's functions too: only one of them is loaded.
  for (const char* const name : {"libdrd.so.3", "libdrd.so", "libdhd.so.3", "libdhd.so"}) out.emplace_back(name);
  return out;
}

}  // namespace

std::string Sdk::version() const {
  int v[4] = {};
  dhdGetSDKVersion(&v[0], &v[1], &v[2], &v[3]);
  return std::to_string(v[0]) + "." + std::to_string(v[1]) + "." + std::to_string(v[2]);
}

std::string Sdk::last_error() const {
  const int error = dhdErrorGetLast();
  const char* const text = dhdErrorGetStr(error);
  return std::string(text == nullptr ? "no text" : text) + " (error " + std::to_string(error) + ")";
}

rtbus::Result<Sdk, std::string> load_sdk(const std::string& file) {
  Sdk out;
  std::vector<vendor::Symbol> symbols;
#define RTBUS_FD_SYMBOL(required, result, name, arguments) \
  symbols.push_back({#name, reinterpret_cast<void**>(&out.name), required});
  RTBUS_FD_FUNCTIONS(RTBUS_FD_SYMBOL)
#undef RTBUS_FD_SYMBOL
  vendor::LibraryRequest request;
  request.files = file.empty() ? usual_files() : std::vector<std::string>{file};
  request.remedy_missing =
      file.empty()
          ? "install the Force Dimension SDK (from forcedimension.com) and run ldconfig, or name its libdrd.so "
            "by `library:` in the device file"
          : "correct `library:` in the device file, or leave it out to search the usual places";
  request.remedy_old = "it belongs to an SDK before 3.7; install a newer one";
  auto loaded = vendor::load_library(request, symbols);
  if (!loaded) return rtbus::Failure{loaded.error()};
  out.file = *loaded;
  return out;
}

}  // namespace drivers::force_dimension
