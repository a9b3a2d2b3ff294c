#include "tools/cli/host/ask_logind.hpp"

#include <algorithm>
#include <cctype>
#include <fstream>
#include <map>
#include <system_error>
#include <vector>

namespace tools {

namespace {

namespace fs = std::filesystem;

constexpr uid_t kLastSystemUser = 999;  // SYS_UID_MAX of Debian and Ubuntu

std::string trimmed(const std::string& text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string::npos) return "";
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

/// The last RemoveIPC= of a file; nullopt: it says nothing.
std::optional<bool> remove_ipc_in(const fs::path& file) {
  std::ifstream in(file);
  std::optional<bool> out;
  for (std::string line; std::getline(in, line);) {
    line = trimmed(line);
    if (line.empty() || line[0] == '#' || line[0] == ';') continue;
    const auto equals = line.find('=');
    if (equals == std::string::npos || trimmed(line.substr(0, equals)) != "RemoveIPC") continue;
    std::string value = trimmed(line.substr(equals + 1));
    std::transform(value.begin(), value.end(), value.begin(), [](unsigned char c) { return std::tolower(c); });
    if (value == "yes" || value == "true" || value == "on" || value == "1" || value == "y" || value == "t") out = true;
    if (value == "no" || value == "false" || value == "off" || value == "0" || value == "n" || value == "f")
      out = false;
  }
  return out;
}

/// In the order in which they are read, later ones win (systemd.syntax(7), logind.conf(5)): the main file, then the
/// drop-ins of all folders by file name, where /etc hides /run hides /usr/lib.
std::vector<fs::path> files(const fs::path& root) {
  std::vector<fs::path> out;
  for (const char* const place : {"etc", "run", "usr/lib"}) {
    const fs::path file = root / place / "systemd/logind.conf";
    if (fs::exists(file)) {
      out.push_back(file);
      break;
    }
  }
  std::map<std::string, fs::path> drop_ins;
  std::error_code none;
  for (const char* const place : {"etc", "run", "usr/lib"}) {
    for (const auto& entry : fs::directory_iterator(root / place / "systemd/logind.conf.d", none)) {
      if (entry.path().extension() == ".conf") drop_ins.try_emplace(entry.path().filename().string(), entry.path());
    }
  }
  for (const auto& [name, path] : drop_ins) out.push_back(path);
  return out;
}

}  // namespace

LogindFacts ask_logind(uid_t user, const std::string& user_name, const fs::path& root) {
  LogindFacts out;
  std::error_code none;
  out.running = fs::is_directory(root / "run/systemd/users", none);
  for (const fs::path& file : files(root)) {
    if (const auto said = remove_ipc_in(file)) {
      out.remove_ipc = *said;
      out.set_in = file.string();
    }
  }
  out.system_user = user <= kLastSystemUser;
  out.lingers = fs::exists(root / "var/lib/systemd/linger" / user_name, none);
  return out;
}

}  // namespace tools
