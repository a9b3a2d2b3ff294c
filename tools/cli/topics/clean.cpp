// `rtbus clean`: removes what dead processes left in shared memory, and nothing else.
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/segment.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/common/text_table.hpp"
#include "tools/cli/orders/order_socket.hpp"

namespace tools {

namespace {

struct CleanOptions {
  std::optional<std::string> session;
  bool dry_run = false;
  bool json = false;
};

/// A segment that stays, and why.
struct Kept {
  std::string name;
  std::string reason;
  bool live = false;
  bool ours = false;
};

std::vector<Kept> kept_of(const std::vector<rtbus::TopicInfo>& topics) {
  std::vector<Kept> kept;
  for (const rtbus::TopicInfo& info : topics) {
    Kept entry{rtbus::segment_name(info.session, info.topic), "", info.writer_alive, info.owner == ::geteuid()};
    if (info.writer_alive) {
      entry.reason = "in use by process " + std::to_string(info.writer_pid);
    } else if (!entry.ours && ::geteuid() != 0) {
      entry.reason = "belongs to user " + std::to_string(info.owner);
    } else {
      entry.reason = info.problem.empty() ? "could not be removed" : info.problem;
    }
    kept.push_back(std::move(entry));
  }
  return kept;
}

/// What remove_dead() would take, as far as it can be told without taking it.
rtbus::RemovedTopics predict(std::vector<rtbus::TopicInfo>& topics) {
  rtbus::RemovedTopics removed;
  std::erase_if(topics, [&](const rtbus::TopicInfo& info) {
    if (info.writer_alive || (info.owner != ::geteuid() && ::geteuid() != 0)) return false;
    removed.names.push_back(rtbus::segment_name(info.session, info.topic));
    removed.bytes += info.segment_bytes;
    return true;
  });
  return removed;
}

void print(const CleanOptions& options, const rtbus::RemovedTopics& removed, const std::vector<std::string>& sockets,
           const std::vector<Kept>& kept) {
  const char* const verb = options.dry_run ? "would remove" : "removed";
  for (const std::string& name : removed.names) std::printf("%s /dev/shm/%s\n", verb, name.c_str());
  for (const std::string& path : sockets) std::printf("%s %s\n", verb, path.c_str());
  for (const Kept& entry : kept) std::printf("left /dev/shm/%s: %s\n", entry.name.c_str(), entry.reason.c_str());
  if (removed.names.empty() && sockets.empty()) {
    std::puts("nothing dead was found");
  } else if (!removed.names.empty()) {
    std::printf("%s %zu segment%s, %s\n", verb, removed.names.size(), removed.names.size() == 1 ? "" : "s",
                human_bytes(removed.bytes).c_str());
  }
}

void print_json(const CleanOptions& options, const rtbus::RemovedTopics& removed,
                const std::vector<std::string>& sockets, const std::vector<Kept>& kept) {
  nlohmann::ordered_json report = {{"schema", "rtbus-clean/1"}, {"dry_run", options.dry_run},
                                   {"removed", removed.names},  {"bytes", removed.bytes},
                                   {"sockets", sockets},        {"left", nlohmann::ordered_json::array()}};
  for (const Kept& entry : kept) {
    report["left"].push_back({{"name", entry.name}, {"live", entry.live}, {"reason", entry.reason}});
  }
  std::cout << report.dump(2) << '\n';
}

int clean(const CleanOptions& options) {
  if (options.session && !rtbus::Session::valid_name(*options.session)) {
    std::cerr << "rtbus clean: --session '" << *options.session
              << "': a session name has 1 to 32 characters of a-z 0-9 _ -\n";
    return kExitUsage;
  }
  const std::optional<std::string_view> session = options.session;
  rtbus::RemovedTopics removed;
  std::vector<rtbus::TopicInfo> topics;
  if (options.dry_run) {
    topics = rtbus::list_topics(session);
    removed = predict(topics);
  } else {
    removed = rtbus::remove_dead(session);
    topics = rtbus::list_topics(session);
  }
  const std::vector<Kept> kept = kept_of(topics);
  const std::vector<std::string> sockets = remove_dead_order_sockets(options.session.value_or(""), options.dry_run);
  options.json ? print_json(options, removed, sockets, kept) : print(options, removed, sockets, kept);
  // What is dead and ours must be gone now.
  const bool failed = !options.dry_run && std::any_of(kept.begin(), kept.end(),
                                                      [](const Kept& entry) { return entry.ours && !entry.live; });
  return failed ? kExitFailed : kExitFine;
}

}  // namespace

Action add_clean(rtbus::Command command) {
  auto options = std::make_shared<CleanOptions>();
  command.option("-s,--session", options->session, "Only this session").type_name("SESSION");
  command.flag("--dry-run", options->dry_run, "Say what would be removed, remove nothing");
  command.flag("--json", options->json, "As JSON, schema rtbus-clean/1");
  return [options] { return clean(*options); };
}

}  // namespace tools
