#include "tools/cli/common/tree_python.hpp"

#include <cstdlib>
#include <filesystem>

#include "tools/cli/common/find_config.hpp"

namespace tools {

namespace fs = std::filesystem;

std::vector<std::pair<std::string, std::string>> tree_python() {
  const fs::path build = fs::path(folder_of_this_program()).parent_path();
  const fs::path package = build.parent_path() / "rtbus/python";
  if (std::error_code failed; !fs::exists(package / "rtbus/engine.py", failed)) return {};
  const char* const users = std::getenv("PYTHONPATH");
  const std::string path = users == nullptr || *users == '\0' ? "" : std::string(users) + ":";
  std::vector<std::pair<std::string, std::string>> out{{"PYTHONPATH", path + package.string()}};
  if (std::getenv("RTBUS_LIBRARY_DIR") == nullptr) out.emplace_back("RTBUS_LIBRARY_DIR", (build / "lib").string());
  return out;
}

}  // namespace tools
