#include "tools/cli/common/find_config.hpp"

#include <set>

#include "rtbus/config/document.hpp"

namespace tools {

namespace fs = std::filesystem;

namespace {

/// Empty when no folder has it.
std::string look_for(const std::string& name) {
  std::error_code failed;
  for (const fs::path& folder : config_folders()) {
    if (fs::is_regular_file(folder / name, failed)) return fs::weakly_canonical(folder / name).string();
  }
  return "";
}

}  // namespace

std::vector<fs::path> config_folders() {
  const fs::path program = folder_of_this_program();
  return {"config", "/etc/rtbus", program / "../../../share/rtbus/config", program / "../../config"};
}

std::string find_config(const std::string& name) {
  if (std::string file = look_for(name); !file.empty()) return file;
  std::string folders;
  for (const fs::path& folder : config_folders()) {
    folders += (folders.empty() ? "" : ", ") + folder.lexically_normal().string();
  }
  throw rtbus::config::Error(name + " is in none of " + folders + "; name the file itself");
}

std::string find_session(const std::string& file_or_name) {
  const bool named_by_path = file_or_name.ends_with(".yaml") || file_or_name.find('/') != std::string::npos;
  std::error_code failed;
  // A folder of that name, say of results, is not meant. A path that is not there is the reader's to complain about.
  if (named_by_path || (fs::exists(file_or_name, failed) && !fs::is_directory(file_or_name, failed))) {
    return file_or_name;
  }
  if (std::string file = look_for(file_or_name + ".yaml"); !file.empty()) return file;
  std::string known;
  for (const std::string& name : session_names()) known += (known.empty() ? "" : ", ") + name;
  throw rtbus::config::Error("there is no session file " + file_or_name + "; name a file, or one of " +
                             (known.empty() ? "config/ (which is not here)" : known));
}

std::vector<std::string> session_names() {
  std::set<std::string> names;
  std::error_code failed;
  for (const fs::path& folder : config_folders()) {
    for (const fs::directory_entry& entry : fs::directory_iterator(folder, failed)) {
      if (entry.path().extension() == ".yaml") names.insert(entry.path().stem().string());
    }
  }
  return {names.begin(), names.end()};
}

std::string folder_of_this_program() { return fs::read_symlink("/proc/self/exe").parent_path().string(); }

}  // namespace tools
