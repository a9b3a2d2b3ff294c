#include "tools/cli/devices/device_file.hpp"

#include <fcntl.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "drivers/registry/registry.hpp"

namespace tools {

namespace {

namespace fs = std::filesystem;

/// Sets `path` ("gimbal.zero_rad") to a value written in YAML; makes the maps that lead there.
void assign(YAML::Node root, const std::string& path, const std::string& value) {
  YAML::Node node = root;
  std::size_t begin = 0;
  for (std::size_t dot = path.find('.'); dot != std::string::npos; dot = path.find('.', begin)) {
    node.reset(node[path.substr(begin, dot - begin)]);
    begin = dot + 1;
  }
  node[path.substr(begin)] = YAML::Load(value);
}

/// Values of keys that may name a file.
void make_files_absolute(YAML::Node node, const fs::path& folder, const std::string& key = "") {
  if (node.IsScalar()) {
    std::error_code failed;
    const fs::path name = node.Scalar();
    const bool may_name = key == "file" || key == "firmware" || key == "hand";
    if (may_name && name.is_relative() && !name.empty() && fs::is_regular_file(folder / name, failed)) {
      node = fs::absolute(folder / name).lexically_normal().string();
    }
    return;
  }
  for (auto item : node) {
    if (node.IsMap()) {
      make_files_absolute(item.second, folder, item.first.Scalar());
    } else {
      make_files_absolute(YAML::Node(item), folder);
    }
  }
}

}  // namespace

double number_in(const std::string& yaml, const std::vector<rtbus::config::Override>& changes, const std::string& key,
                 double fallback) {
  try {
    YAML::Node root = YAML::Load(yaml);
    for (const rtbus::config::Override& change : changes) assign(root, change.path, change.value);
    return root[key] ? root[key].as<double>() : fallback;
  } catch (const YAML::Exception&) {
    return fallback;  // its reader has accepted it: what is no number there is no number to us
  }
}

rtbus::Result<void, std::string> write_device_file(const std::string& yaml, const std::string& origin,
                                                   const std::vector<rtbus::config::Override>& changes,
                                                   const std::string& comment, const std::string& file,
                                                   bool overwrite) {
  using rtbus::Failure;
  std::string text;
  try {
    YAML::Node root = YAML::Load(yaml);
    make_files_absolute(root, fs::path(origin).parent_path());
    for (const rtbus::config::Override& change : changes) assign(root, change.path, change.value);
    YAML::Emitter out;
    out << root;
    text = comment + out.c_str() + "\n";
  } catch (const YAML::Exception& error) {
    return Failure{"the device file cannot be changed: " + std::string(error.what())};
  }
  // Written beside it, read as the driver will, then moved into place.
  const std::string draft = file + ".new" + std::to_string(::getpid());
  const auto failed = [&](const std::string& what) {
    ::unlink(draft.c_str());
    return Failure{what};
  };
  const int fd = ::open(draft.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (fd < 0) return Failure{draft + " cannot be written: " + std::strerror(errno)};
  const bool written = ::write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  if (::close(fd) != 0 || !written) return failed(draft + " cannot be written: " + std::strerror(errno));
  try {
    auto map = rtbus::config::load(draft);
    (void)drivers::parse_device(map);
  } catch (const rtbus::config::Error& error) {
    return failed("the result would be refused: " + std::string(error.what()));
  }
  // link() does not replace, rename() does.
  if (overwrite ? ::rename(draft.c_str(), file.c_str()) != 0 : ::link(draft.c_str(), file.c_str()) != 0) {
    return failed(errno == EEXIST ? file + " exists; name another file, or replace it with --overwrite"
                                  : file + " cannot be written: " + std::strerror(errno));
  }
  if (!overwrite) ::unlink(draft.c_str());
  return {};
}

}  // namespace tools
