#include "tools/cli/recording/session_description.hpp"

#include <sys/utsname.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include "rtbus/config/session.hpp"
#include "rtbus/topic_directory.hpp"

namespace tools {
namespace {

using rtbus::recording::ConfigFile;
using rtbus::recording::Metadata;
namespace fs = std::filesystem;

std::optional<std::string> whole_file(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) return std::nullopt;
  return std::string(std::istreambuf_iterator<char>(in), {});
}

/// Words of a YAML text that end in .yaml or .yml: files it may refer to.
std::vector<std::string> file_names_in(const std::string& text) {
  std::vector<std::string> names;
  std::string word;
  for (const char c : text + "\n") {
    if (std::isspace(static_cast<unsigned char>(c)) == 0 &&
        std::string_view("\"',{}[]").find(c) == std::string_view::npos) {
      word += c;
      continue;
    }
    if (word.ends_with(".yaml") || word.ends_with(".yml")) names.push_back(word);
    word.clear();
  }
  return names;
}

void add_file(const fs::path& path, std::vector<ConfigFile>& files, int depth) {
  const fs::path clean = path.lexically_normal();
  if (std::any_of(files.begin(), files.end(), [&](const ConfigFile& file) { return file.path == clean; })) return;
  const auto text = whole_file(clean);
  if (!text || files.size() >= 64) return;
  files.push_back({clean, *text});
  if (depth >= 4) return;
  for (const std::string& name : file_names_in(*text)) add_file(clean.parent_path() / name, files, depth + 1);
}

/// Adds the names; leaves them out where the files cannot be read any more.
void add_body_names(const SessionStart& start, Metadata& about) {
  try {
    std::vector<rtbus::config::Override> overrides;
    for (const std::string& text : start.assignments) overrides.push_back(rtbus::config::parse_override(text));
    about.body_names.clear();
    for (const auto& body : rtbus::config::load_session(start.file, overrides).scene.bodies) {
      about.body_names.push_back(body.name);
    }
  } catch (const rtbus::config::Error&) {
  }
}

Metadata describe_machine(const std::string& session) {
  Metadata about;
  about.session = session;
  about.version = RTBUS_VERSION;
  utsname machine{};
  if (::uname(&machine) == 0) {
    about.machine = std::string(machine.sysname) + " " + machine.release + " " + machine.machine;
  }
  return about;
}

/// The command line of a process; empty when it is gone.
std::vector<std::string> words_of(const fs::path& process) {
  std::vector<std::string> words;
  std::string word;
  for (const char c : whole_file(process / "cmdline").value_or("")) {
    if (c != '\0') {
      word += c;
      continue;
    }
    words.push_back(std::exchange(word, {}));
  }
  return words;
}

void add_process(const fs::path& process, Metadata& about) {
  const std::vector<std::string> words = words_of(process);
  if (words.empty()) return;
  std::error_code failed;
  const fs::path folder = fs::read_symlink(process / "cwd", failed);
  std::string line;
  SessionStart start;
  for (std::size_t i = 0; i < words.size(); ++i) {
    line += (i > 0 ? " " : "") + words[i];
    if (words[i].ends_with(".yaml") || words[i].ends_with(".yml")) add_file(folder / words[i], about.config, 0);
    if (i == 0) continue;
    if (words[i - 1] == "--config") start.file = folder / words[i];
    if (words[i - 1] == "--set") start.assignments.push_back(words[i]);
  }
  about.commands.push_back(line);
  if (!start.file.empty() && about.body_names.empty()) add_body_names(start, about);
}

}  // namespace

Metadata describe_session(const std::string& session) {
  Metadata about = describe_machine(session);
  std::set<std::uint32_t> pids;
  for (const rtbus::TopicInfo& topic : rtbus::list_topics(session)) {
    if (topic.writer_alive) pids.insert(topic.writer_pid);
  }
  for (const std::uint32_t pid : pids) add_process("/proc/" + std::to_string(pid), about);
  return about;
}

Metadata describe_session(const std::string& session, const SessionStart& start) {
  Metadata about = describe_machine(session);
  add_file(fs::absolute(start.file), about.config, 0);
  std::string line = "rtbus run " + start.file;
  for (const std::string& text : start.assignments) line += " --set " + text;
  about.commands.push_back(line);
  add_body_names(start, about);
  return about;
}

}  // namespace tools
