// Topics in /dev/shm that are deleted, cut, written over, or taken the permission from.
#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <random>

#include "rtbus/topic_directory.hpp"
#include "tools/evaluation/faults/fault_session.hpp"

namespace tools {

namespace {

constexpr double kMadeAnew_s = 5.0;
constexpr double kWritten_s = 1.0;
constexpr double kReaderEnd_s = 10.0;
constexpr int kWritesPerLook = 200;

std::string path_of(const std::string& session, const std::string& topic) {
  return "/dev/shm/" + rtbus::segment_name(session, topic);
}

/// The trace comes from there: damaged, it would be no witness.
constexpr const char* kWitness = "haptic0.plant_state";

/// What a real device has in its cable.
bool is_cable(const std::string& topic) { return topic == kWitness || topic == "haptic0.plant_command"; }

void delete_topics(FaultSession& cell) {
  for (const rtbus::TopicInfo& topic : rtbus::list_topics(cell.name())) {
    if (::unlink(path_of(cell.name(), topic.topic).c_str()) != 0) continue;
    ++cell.outcome().topics;
    const auto is_back = [&] {
      for (const rtbus::TopicInfo& now : rtbus::list_topics(cell.name())) {
        if (now.topic != topic.topic) continue;
        // What is published for observers alone may be silent, before and after.
        return now.writer_alive && now.writer_pid == topic.writer_pid && (now.published > 0 || topic.published == 0);
      }
      return false;
    };
    if (cell.follow_until(kMadeAnew_s, is_back)) ++cell.outcome().topics_back;
    // Until the old memory has been let go: what still hung on it would starve now.
    cell.follow(0.35);
  }
  const FaultOutcome& out = cell.outcome();
  if (out.topics == 0 || out.topics_back != out.topics) {
    cell.fail("of " + std::to_string(out.topics) + " deleted topics " + std::to_string(out.topics_back) + " came back");
  }
}

void cut_topics(FaultSession& cell) {
  for (const rtbus::TopicInfo& topic : rtbus::list_topics(cell.name())) {
    if (topic.topic == kWitness) continue;
    if (::truncate(path_of(cell.name(), topic.topic).c_str(), 0) != 0 && errno != ENOENT) cell.fail("truncate failed");
  }
  cell.follow(FaultSession::kHold_s);
}

/// Any bytes anywhere but behind the end, as one with the right to write could.
void scribble(FaultSession& cell) {
  struct Target {
    int fd;
    off_t bytes;
  };
  std::vector<Target> targets;
  for (const rtbus::TopicInfo& topic : rtbus::list_topics(cell.name())) {
    if (is_cable(topic.topic)) continue;
    const int fd = ::open(path_of(cell.name(), topic.topic).c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW);
    if (fd >= 0) targets.push_back({fd, static_cast<off_t>(topic.segment_bytes)});
  }
  std::mt19937_64 random(1);
  const std::uint64_t end_ns = rtbus::monotonic_ns() + static_cast<std::uint64_t>(kWritten_s * 1e9);
  (void)cell.follow_until(2.0 * kWritten_s, [&] {
    for (const Target& target : targets) {
      struct stat now {};
      if (::fstat(target.fd, &now) != 0 || now.st_size < target.bytes) continue;
      for (int i = 0; i < kWritesPerLook; ++i) {
        const std::uint64_t word = random();
        const auto at = static_cast<off_t>(random() % static_cast<std::uint64_t>(target.bytes - 8));
        (void)!::pwrite(target.fd, &word, 1 + random() % 8, at);
      }
    }
    return rtbus::monotonic_ns() > end_ns;
  });
  for (const Target& target : targets) ::close(target.fd);
  if (targets.empty()) cell.fail("no segment could be written");
}

void forbid_topics(FaultSession& cell) {
  std::vector<std::string> paths;
  for (const rtbus::TopicInfo& topic : rtbus::list_topics(cell.name()))
    paths.push_back(path_of(cell.name(), topic.topic));
  for (const std::string& path : paths) {
    if (::chmod(path.c_str(), 0) != 0) cell.fail("chmod failed");
  }
  // One who comes now: root reads them, others are told that they may not.
  const pid_t reader = cell.start_tool({"echo", "haptic0.telemetry", "--session", cell.name()});
  cell.follow(FaultSession::kHold_s);
  for (const std::string& path : paths) (void)::chmod(path.c_str(), 0600);
  if (reader == 0) return;
  if (!cell.tool_end()) cell.signal(reader, SIGINT);
  if (!cell.follow_until(kReaderEnd_s, [&] { return cell.tool_end().has_value(); })) cell.fail("a reader stayed");
}

}  // namespace

std::vector<FaultRow> topic_faults() {
  std::vector<FaultRow> out;
  out.push_back({.name = "topics_deleted",
                 .what = "every topic's file is removed from /dev/shm, one after the other",
                 .feels = Feels::kNothing,
                 .hold_s = 10.0,
                 .happen = &delete_topics});
  out.push_back({.name = "topics_truncated",
                 .what = "every topic's file but the witness is cut to nothing, all at once",
                 .feels = Feels::kAnything,
                 .happen = &cut_topics});
  out.push_back(
      {.name = "topics_scribbled",
       .what = "random bytes are written into all segments for a second, but for the cable of the simulated device",
       .feels = Feels::kAnything,
       .happen = &scribble});
  out.push_back({.name = "topics_forbidden",
                 .what = "every topic's file gets mode 000 for a second",
                 .feels = Feels::kNothing,
                 .happen = &forbid_topics});
  return out;
}

}  // namespace tools
