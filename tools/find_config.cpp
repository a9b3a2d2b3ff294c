#include "tools/find_config.hpp"

#include <filesystem>

#include "rtbus/config/document.hpp"
#include "tools/supervisor.hpp"

namespace tools {

std::string find_config(const std::string& name) {
  for (const std::string& folder : {std::string("config"), folder_of_this_program() + "/../../config"}) {
    const std::filesystem::path file = std::filesystem::path(folder) / name;
    if (std::filesystem::exists(file)) return std::filesystem::weakly_canonical(file).string();
  }
  throw rtbus::config::Error("config/" + name + " is neither here nor beside the program; name the file itself");
}

}  // namespace tools
