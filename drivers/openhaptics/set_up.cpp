#include "drivers/openhaptics/set_up.hpp"

#include <dlfcn.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace drivers::openhaptics {
namespace {

namespace fs = std::filesystem;

/// Folders in which the setup tool writes one file per device.
std::vector<fs::path> config_folders() {
  std::vector<fs::path> out;
  if (const char* const home = std::getenv("GTDD_HOME"); home != nullptr && *home != '\0') {
    out.push_back(fs::path(home) / "config");
    return out;
  }
  if (const char* const home = std::getenv("HOME")) out.push_back(fs::path(home) / ".3dsystems/config");
  out.emplace_back("/usr/share/3DSystems/config");
  return out;
}

std::vector<fs::path> configuration_files() {
  std::vector<fs::path> out;
  std::error_code failed;
  for (const fs::path& folder : config_folders()) {
    for (const auto& entry : fs::directory_iterator(folder, failed)) {
      if (entry.path().extension() == ".config") out.push_back(entry.path());
    }
  }
  std::sort(out.begin(), out.end());
  return out;
}

/// The value of `key` in a file of lines "key=value"; empty: not there.
std::string value_in(const fs::path& file, const std::string& key) {
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    if (!line.starts_with(key)) continue;
    const std::size_t equals = line.find('=');
    if (equals == line.npos) continue;
    std::string out = line.substr(equals + 1);
    std::erase_if(out, [](char c) { return c == ' ' || c == '\r' || c == '\t'; });
    return out;
  }
  return {};
}

}  // namespace

std::vector<std::string> devices_set_up() {
  std::vector<std::string> out;
  for (const fs::path& file : configuration_files()) out.push_back(file.stem().string());
  return out;
}

std::vector<Finding> look_at_configuration() {
  std::vector<Finding> out;
  fs::path found_in;
  for (const fs::path& file : configuration_files()) {
    found_in = file.parent_path();
    const bool never_set_up = value_in(file, "Channel") == "300";
    out.push_back({"OpenHaptics device \"" + file.stem().string() + "\"", !never_set_up,
                   file.string() + (never_set_up ? ": Channel 300, never set up" : ""),
                   never_set_up ? "run Touch_HeadlessSetup or Touch_Setup, then TouchCheckup" : ""});
  }
  if (out.empty()) {
    out.push_back({"OpenHaptics devices", false, "none is set up for this user",
                   "run Touch_Setup or Touch_HeadlessSetup as the user that runs rtbus (not by sudo), and export "
                   "GTDD_HOME where it wrote its files (~/.3dsystems or /usr/share/3DSystems)"});
  } else if (const char* const home = std::getenv("GTDD_HOME"); home == nullptr || *home == '\0') {
    out.push_back({"GTDD_HOME", false, "not set, though a device is set up",
                   "export GTDD_HOME=" + found_in.parent_path().string() + " for the user or service that runs rtbus"});
  }
  return out;
}

std::vector<Finding> look_at_ncurses() {
  std::string missing;
  for (const char* const file : {"libncurses.so.5", "libtinfo.so.5"}) {
    if (void* const library = dlopen(file, RTLD_LAZY | RTLD_LOCAL)) {
      dlclose(library);
    } else {
      missing += (missing.empty() ? "" : ", ") + std::string(file);
    }
  }
  if (missing.empty()) return {};
  return {{"ncurses 5", false, missing + " not installed",
           "a TouchDriver before 2025 needs the packages libncurses5 and libtinfo5; Ubuntu 23.10 and later no longer "
           "have them, those of 22.04 fit"}};
}

}  // namespace drivers::openhaptics
