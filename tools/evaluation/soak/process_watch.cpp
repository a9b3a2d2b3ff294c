#include "tools/evaluation/soak/process_watch.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <system_error>
#include <vector>

namespace tools {

namespace {

namespace fs = std::filesystem;

std::string folder_of(pid_t pid) { return "/proc/" + std::to_string(pid); }

int entries_in(const std::string& folder) {
  std::error_code gone;
  const auto entries = fs::directory_iterator(folder, gone);
  return gone ? 0 : static_cast<int>(std::distance(fs::begin(entries), fs::end(entries)));
}

std::vector<pid_t> children_of(pid_t parent) {
  std::vector<pid_t> out;
  std::error_code gone;
  for (const auto& task : fs::directory_iterator(folder_of(parent) + "/task", gone)) {
    std::ifstream file(task.path() / "children");
    std::copy(std::istream_iterator<pid_t>(file), {}, std::back_inserter(out));
  }
  return out;
}

ProcessUse use_of(pid_t pid) {
  ProcessUse out;
  out.pid = pid;
  std::ifstream status(folder_of(pid) + "/status");
  for (std::string line; std::getline(status, line);) {
    std::istringstream words(line);
    std::string key;
    words >> key;
    if (key == "VmRSS:") words >> out.resident_kib;
    if (key == "Threads:") words >> out.threads;
  }
  out.descriptors = entries_in(folder_of(pid) + "/fd");
  return out;
}

}  // namespace

std::map<std::string, ProcessUse> uses_below(pid_t parent) {
  std::map<std::string, ProcessUse> out;
  std::vector<pid_t> all = children_of(parent);
  all.push_back(parent);
  for (const pid_t pid : all) {
    std::ifstream file(folder_of(pid) + "/comm");
    std::string name;
    if (!std::getline(file, name)) continue;
    const ProcessUse use = use_of(pid);
    if (use.threads > 0 && use.resident_kib > 0) out.emplace(name, use);
  }
  return out;
}

int segments_of(const std::string& session) {
  std::error_code error;
  int count = 0;
  for (const auto& entry : fs::directory_iterator("/dev/shm", error)) {
    if (entry.path().filename().string().starts_with("rtbus." + session + ".")) ++count;
  }
  return count;
}

void ProcessWatch::look(pid_t parent) {
  for (const auto& [name, use] : uses_below(parent)) {
    const ProcessUse& first = first_.emplace(name, use).first->second;
    UseGrowth& most = growth_[name];
    most.resident_kib = std::max(most.resident_kib, use.resident_kib - first.resident_kib);
    most.descriptors = std::max(most.descriptors, use.descriptors - first.descriptors);
    most.threads = std::max(most.threads, use.threads - first.threads);
  }
}

bool ProcessWatch::more_descriptors(pid_t parent) const {
  const auto now = uses_below(parent);
  return std::any_of(now.begin(), now.end(), [this](const auto& each) {
    const auto first = first_.find(each.first);
    return first != first_.end() && each.second.descriptors > first->second.descriptors;
  });
}

}  // namespace tools
