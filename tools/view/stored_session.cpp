#include "tools/view/stored_session.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <vector>

namespace view {

namespace {

namespace fs = std::filesystem;
using rtbus::recording::ConfigFile;

/// A folder of this process alone, which goes with the object.
class Folder {
 public:
  Folder() {
    std::string pattern = (fs::temp_directory_path() / "rtbus_view_XXXXXX").string();
    if (::mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("cannot make a folder like " + pattern);
    path_ = pattern;
  }
  ~Folder() {
    std::error_code error;
    fs::remove_all(path_, error);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  [[nodiscard]] const fs::path& path() const { return path_; }
  /// Where the file `original`, an absolute path, lies in here.
  [[nodiscard]] fs::path place_of(const fs::path& original) const {
    return path_ / original.lexically_normal().relative_path();
  }

 private:
  fs::path path_;
};

/// `--config F` and `--set …` of a command line whose words are apart by blanks. A value that holds blanks goes on up
/// to the next option.
struct Started {
  std::string file;
  std::vector<std::string> assignments;
};
Started started_with(const std::string& line) {
  Started out;
  std::istringstream words(line);
  std::string* value = nullptr;
  for (std::string word; words >> word;) {
    if (word == "--config") {
      value = &out.file;
    } else if (word == "--set") {
      value = &out.assignments.emplace_back();
    } else if (word.starts_with("--")) {
      value = nullptr;
    } else if (value != nullptr) {
      *value += (value->empty() ? "" : " ") + word;
    }
  }
  return out;
}

/// Files that a text names, meshes above all, are linked to where they were.
void link_meshes(const ConfigFile& file, const Folder& folder) {
  std::string text = file.text;
  std::replace_if(
      text.begin(), text.end(), [](char c) { return std::string_view("\"',{}[]:").find(c) != std::string_view::npos; },
      ' ');
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    if (!word.ends_with(".obj")) continue;
    const fs::path original = (fs::path(file.path).parent_path() / word).lexically_normal();
    const fs::path place = folder.place_of(original);
    std::error_code error;
    fs::create_directories(place.parent_path(), error);
    fs::create_symlink(original, place, error);
  }
}

}  // namespace

void with_stored_session(const rtbus::recording::Recording& recording,
                         const std::function<void(rtbus::config::SessionConfig& session)>& use) {
  const std::vector<ConfigFile> files = recording.config();
  const Folder folder;
  for (const ConfigFile& file : files) {
    const fs::path place = folder.place_of(file.path);
    fs::create_directories(place.parent_path());
    std::ofstream(place, std::ios::binary) << file.text;
    link_meshes(file, folder);
  }
  for (const std::string& line : recording.commands()) {
    const Started started = started_with(line);
    if (started.file.empty()) continue;
    const std::string name = fs::path(started.file).lexically_normal().string();
    const auto stored = std::find_if(files.begin(), files.end(), [&](const ConfigFile& file) {
      return file.path == name || (name.front() != '/' && file.path.ends_with("/" + name)) ||
             (name.starts_with("../") && fs::path(file.path).filename() == fs::path(name).filename());
    });
    if (stored == files.end()) continue;
    try {
      std::vector<rtbus::config::Override> overrides;
      for (const std::string& text : started.assignments) overrides.push_back(rtbus::config::parse_override(text));
      rtbus::config::SessionConfig session =
          rtbus::config::load_session(folder.place_of(stored->path).string(), overrides);
      use(session);
      return;
    } catch (const std::exception& error) {
      std::string text = error.what();
      const std::string prefix = folder.path().string();
      for (std::size_t at = 0; (at = text.find(prefix)) != std::string::npos;) text.erase(at, prefix.size());
      throw std::runtime_error(text);
    }
  }
  throw std::runtime_error("it holds no session file");
}

}  // namespace view
