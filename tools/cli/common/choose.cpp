#include "tools/cli/common/choose.hpp"

#include <algorithm>
#include <numeric>
#include <set>

namespace tools {

namespace {

using rtbus::Failure;
using rtbus::TopicInfo;

std::string join(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

/// Candidates for a misspelt topic: near in letters, nearest first.
std::vector<std::string> near_names(std::span<const TopicInfo> topics, std::string_view typed) {
  std::vector<std::pair<std::size_t, std::string>> ranked;
  for (const TopicInfo& info : topics) {
    // People forget the node: "loopstats" should find "haptic0.loop_stats".
    const std::string_view full = info.topic;
    const std::string_view subject = full.substr(full.find('.') == std::string_view::npos ? 0 : full.find('.') + 1);
    const std::size_t distance = std::min(edit_distance(typed, full), edit_distance(typed, subject));
    if (distance <= std::max<std::size_t>(2, typed.size() / 3)) ranked.emplace_back(distance, info.topic);
  }
  std::sort(ranked.begin(), ranked.end());
  std::vector<std::string> names;
  for (auto& [distance, name] : ranked) {
    if (names.size() < 4) names.push_back(std::move(name));
  }
  return names;
}

}  // namespace

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({replaced, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row.back();
}

std::vector<std::string> sessions_in(std::span<const TopicInfo> topics, bool live_only) {
  std::set<std::string> names;
  for (const TopicInfo& info : topics) {
    if (!live_only || info.writer_alive) names.insert(info.session);
  }
  return {names.begin(), names.end()};
}

rtbus::Result<std::string, Refusal> choose_session(std::span<const TopicInfo> topics,
                                                   const std::optional<std::string>& wanted) {
  const std::vector<std::string> all = sessions_in(topics, false), live = sessions_in(topics, true);
  if (wanted) {
    if (std::find(all.begin(), all.end(), *wanted) != all.end()) return *wanted;
    if (!rtbus::Session::valid_name(*wanted)) {
      return Failure{Refusal{"--session '" + *wanted + "': a session name has 1 to 32 characters of a-z 0-9 _ -"}};
    }
    return Failure{Refusal{"there is no session '" + *wanted + "'" +
                               (all.empty() ? std::string("; nothing is running") : "; there is: " + join(all)),
                           all.empty() ? 1 : 2}};
  }
  if (live.size() == 1) return live.front();
  if (live.size() > 1) {
    return Failure{Refusal{"several sessions are live: " + join(live) + "; choose one with --session NAME"}};
  }
  if (!all.empty()) {
    return Failure{
        Refusal{"no session is live that this user may read; there are segments of: " + join(all) +
                    " (`rtbus list` says more, `rtbus clean` removes what is dead, --session NAME looks into it)",
                1}};
  }
  return Failure{Refusal{"no session is running; start one, for example with `rtbus run wall`", 1}};
}

rtbus::Result<std::string, Refusal> choose_topic(std::span<const TopicInfo> topics, std::string_view typed) {
  std::vector<std::string> beginning, containing, all;
  for (const TopicInfo& info : topics) {
    if (info.topic == typed) return info.topic;
    if (info.topic.starts_with(typed)) beginning.push_back(info.topic);
    if (info.topic.find(typed) != std::string::npos) containing.push_back(info.topic);
    all.push_back(info.topic);
  }
  for (const auto* const matches : {&beginning, &containing}) {
    if (matches->size() == 1) return matches->front();
    if (matches->size() > 1) {
      return Failure{Refusal{"'" + std::string(typed) + "' may be any of: " + join(*matches)}};
    }
  }
  const std::vector<std::string> near = near_names(topics, typed);
  return Failure{Refusal{"there is no topic '" + std::string(typed) + "'; " +
                         (near.empty() ? "there is: " + join(all) : "did you mean " + join(near) + "?")}};
}

rtbus::Result<Choice, Refusal> choose(const std::optional<std::string>& wanted_session, std::string_view typed_topic) {
  std::vector<TopicInfo> topics = rtbus::list_topics();
  auto session = choose_session(topics, wanted_session);
  if (!session) return Failure{session.error()};
  std::erase_if(topics, [&](const TopicInfo& info) { return info.session != *session; });
  auto topic = choose_topic(topics, typed_topic);
  if (!topic)
    return Failure{Refusal{"session '" + *session + "': " + topic.error().message, topic.error().exit_status}};
  Choice choice;
  choice.session.name = *session;
  choice.topic = *topic;
  return choice;
}

}  // namespace tools
