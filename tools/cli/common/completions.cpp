#include <algorithm>

#include "rtbus/topic_directory.hpp"
#include "tools/cli/common/choose.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/common/find_config.hpp"

namespace tools {

namespace {

/// The words of "TEXT:{drop,stack}".
std::vector<std::string> words_in_braces(const std::string& type) {
  std::vector<std::string> words;
  std::size_t begin = type.find('{');
  const std::size_t end = type.find('}');
  while (begin != std::string::npos && begin < end && end != std::string::npos) {
    const std::size_t next = std::min(type.find(',', begin + 1), end);
    words.push_back(type.substr(begin + 1, next - begin - 1));
    begin = next;
  }
  return words;
}

/// What may stand where --help says `type`.
std::vector<std::string> values(const std::string& type) {
  std::vector<std::string> out = words_in_braces(type);
  const auto add = [&out](std::vector<std::string> more) { out.insert(out.end(), more.begin(), more.end()); };
  if (type.find("NAME") != std::string::npos) add(session_names());
  if (type.find("SESSION") != std::string::npos) add(sessions_in(rtbus::list_topics(), true));
  if (type.find("TOPIC") != std::string::npos) {
    for (const rtbus::TopicInfo& topic : rtbus::list_topics()) out.push_back(topic.topic);
  }
  return out;
}

}  // namespace

std::vector<std::string> completions(std::span<const std::pair<std::string, rtbus::Command>> commands,
                                     std::span<const std::string> words) {
  std::vector<std::string> out;
  const std::string& begun = words.back();
  if (words.size() == 1) {
    for (const auto& [name, command] : commands) out.push_back(name);
  }
  for (const auto& [name, command] : commands) {
    if (words.size() == 1 || words.front() != name) continue;
    const std::string& before = words[words.size() - 2];
    const std::string type = before.starts_with('-') ? command.value_type(before) : "";
    out = begun.starts_with('-') ? command.option_names() : values(type.empty() ? command.value_type("") : type);
  }
  std::erase_if(out, [&begun](const std::string& word) { return !word.starts_with(begun); });
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

}  // namespace tools
