#include "tools/cli/run/restarts.hpp"

#include <algorithm>

namespace tools {

Restarts::Restarts(const RunPlan& plan, bool allowed) : plan_(plan), rules_(plan.supervise) {
  if (!allowed) rules_.restart = false;
}

const ChildSpec* Restarts::find(const std::string& name) const {
  for (const std::vector<ChildSpec>* children : {&plan_.plants, &plan_.nodes}) {
    for (const ChildSpec& child : *children) {
      if (child.name == name) return &child;
    }
  }
  return plan_.bridge && plan_.bridge->name == name ? &*plan_.bridge : nullptr;
}

RestartPolicy::Verdict Restarts::on_end(const ChildEnd& end, std::uint64_t now_ns) {
  RestartPolicy& policy = policies_.try_emplace(end.name, rules_).first->second;
  const RestartPolicy::Verdict verdict = policy.on_end(end.wait_status, end.started_ns, now_ns);
  if (!verdict.restart) return verdict;
  ended_cpu_s_[end.name] += end.cpu_s;
  if (const ChildSpec* const child = find(end.name)) {
    waiting_.push_back({*child, now_ns + static_cast<std::uint64_t>(verdict.delay_s * 1e9)});
  }
  return verdict;
}

std::optional<ChildSpec> Restarts::take_due(std::uint64_t now_ns) {
  const auto due =
      std::find_if(waiting_.begin(), waiting_.end(), [now_ns](const Waiting& each) { return now_ns >= each.due_ns; });
  if (due == waiting_.end()) return std::nullopt;
  ChildSpec child = std::move(due->child);
  waiting_.erase(due);
  return child;
}

std::vector<std::string> Restarts::waiting() const {
  std::vector<std::string> names;
  for (const Waiting& each : waiting_) names.push_back(each.child.name);
  return names;
}

double Restarts::ended_cpu_s(const std::string& name) const {
  const auto found = ended_cpu_s_.find(name);
  return found == ended_cpu_s_.end() ? 0.0 : found->second;
}

}  // namespace tools
