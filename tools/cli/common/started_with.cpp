#include "tools/cli/common/started_with.hpp"

#include <algorithm>
#include <filesystem>

#include "tools/cli/common/slurp.hpp"

namespace tools {

std::optional<StartedWith> started_with(std::uint32_t pid) {
  const std::string proc = "/proc/" + std::to_string(pid);
  const std::string text = slurp(proc + "/cmdline");
  std::vector<std::string> words;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\0', begin), text.size());
    words.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  StartedWith out;
  for (std::size_t i = 0; i + 1 < words.size(); ++i) {
    if (words[i] == "--config") out.file = words[i + 1];
    if (words[i] == "--set") out.assignments.push_back(words[i + 1]);
  }
  if (out.file.empty()) return std::nullopt;
  std::error_code error;
  const std::filesystem::path folder = std::filesystem::read_symlink(proc + "/cwd", error);
  if (!error) out.file = (folder / out.file).string();
  return out;
}

}  // namespace tools
