#include "tools/recorder.hpp"

#include <sys/utsname.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <utility>

#include "rtbus/clock.hpp"
#include "tools/ask_kernel.hpp"
#include "tools/loop_cores.hpp"

namespace tools {
namespace {

using rtbus::recording::ConfigFile;
using rtbus::recording::Fault;
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

}  // namespace

rtbus::recording::Metadata describe_session(const std::string& session) {
  rtbus::recording::Metadata about;
  about.session = session;
  about.version = RTBUS_VERSION;
  utsname machine{};
  if (::uname(&machine) == 0) {
    about.machine = std::string(machine.sysname) + " " + machine.release + " " + machine.machine;
  }
  std::set<std::uint32_t> pids;
  for (const rtbus::TopicInfo& topic : rtbus::list_topics(session)) {
    if (topic.writer_alive) pids.insert(topic.writer_pid);
  }
  for (const std::uint32_t pid : pids) {
    const fs::path process = "/proc/" + std::to_string(pid);
    const auto raw = whole_file(process / "cmdline");
    if (!raw) continue;
    std::vector<std::string> words;
    std::string word;
    for (const char c : *raw) {
      if (c != '\0') {
        word += c;
        continue;
      }
      words.push_back(std::exchange(word, {}));
    }
    std::string line;
    std::error_code failed;
    const fs::path folder = fs::read_symlink(process / "cwd", failed);
    for (std::size_t i = 0; i < words.size(); ++i) {
      line += (i > 0 ? " " : "") + words[i];
      if (words[i].ends_with(".yaml") || words[i].ends_with(".yml")) add_file(folder / words[i], about.config, 0);
    }
    about.commands.push_back(line);
  }
  return about;
}

Recorder::Recorder(rtbus::Session session, rtbus::recording::Writer writer, std::vector<std::string> wanted)
    : session_(std::move(session)), writer_(std::move(writer)), wanted_(std::move(wanted)), inbox_(session_.name) {}

bool Recorder::wants(const std::string& topic) const {
  if (wanted_.empty()) return topic != kBodyPoses;
  return std::any_of(wanted_.begin(), wanted_.end(), [&](const std::string& name) { return topic.starts_with(name); });
}

rtbus::Result<void, Fault> Recorder::follow(Followed& topic) {
  // Presence: a node publishes its telemetry only while somebody says that he looks.
  auto reader = rtbus::RawReader::open(
      session_, topic.name,
      {.presence = true, .from_oldest = topic.reader.has_value(), .trust = rtbus::OwnerTrust::kAnyone});
  if (!reader) return {};  // not there yet, or gone again; the next look will tell
  if (topic.reader) {
    // What has the name may belong to a dead writer while a live one, whose segment was deleted, is about to make its
    // topic anew: stay where samples come from.
    if (topic.reader->writer_alive() && !reader->writer_alive()) return {};
    topic.missed_before += topic.reader->missed();
    topic.recorded_until_ns = topic.last_stamp_ns;  // a writer that makes its topic anew writes both for a while
  }
  if (!topic.reader || topic.type_hash != reader->description().type_hash) {
    if (topic.reader) writer_.set_dropped(topic.handle, topic.missed_before);
    missed_in_other_layouts_ += std::exchange(topic.missed_before, 0);
    auto handle = writer_.add_topic(topic.name, reader->description());
    if (!handle) return rtbus::Failure{handle.error()};
    topic.handle = *handle;
    topic.type_hash = reader->description().type_hash;
  }
  topic.reader.emplace(std::move(*reader));
  return {};
}

rtbus::Result<void, Fault> Recorder::attach() {
  const std::vector<rtbus::TopicInfo> topics = rtbus::list_topics(session_.name);
  keep_off_loops(topics);  // they may be there only now
  for (const rtbus::TopicInfo& info : topics) {
    if (!info.problem.empty() || !info.writer_alive || !wants(info.topic)) continue;
    const auto known =
        std::find_if(topics_.begin(), topics_.end(), [&](const Followed& topic) { return topic.name == info.topic; });
    if (known != topics_.end()) continue;  // drain() follows it
    topics_.emplace_back().name = info.topic;
    if (auto followed = follow(topics_.back()); !followed) return followed;
  }
  return {};
}

void Recorder::take(Followed& topic) {
  if (!topic.reader) return;
  rtbus::RawReader& reader = *topic.reader;
  // Bounded by two rings: a writer faster than this loop may not keep it from the others.
  for (std::uint64_t i = 0; i < 2ull * reader.description().capacity; ++i) {
    if (reader.read_next() != rtbus::ReadStatus::kFresh) break;
    if (reader.stamp_ns() <= topic.recorded_until_ns) continue;  // was taken from the segment before this one
    topic.last_stamp_ns = reader.stamp_ns();
    writer_.append(topic.handle, reader.sequence(), reader.stamp_ns(), reader.bytes());
    ++topic.samples;
  }
}

rtbus::Result<void, Fault> Recorder::drain() {
  for (Followed& topic : topics_) {
    // Asked before the old segment is emptied: what comes later is in the new one too.
    const bool replaced = !topic.reader || topic.reader->replaced();
    take(topic);
    if (replaced) {
      if (auto followed = follow(topic); !followed) return followed;
      take(topic);
    }
    if (!topic.reader) continue;
    writer_.set_dropped(topic.handle, topic.missed_before + topic.reader->missed());
  }
  while (auto mark = inbox_.take()) {
    writer_.mark(mark->stamp_ns, mark->text);
    ++marks_;
  }
  return {};
}

rtbus::Result<void, Fault> Recorder::close() {
  for (Followed& topic : topics_) topic.reader.reset();
  return writer_.close();
}

RecorderFigures Recorder::figures() const {
  RecorderFigures sum;
  sum.marks = marks_;
  sum.topics = topics_.size();
  sum.dropped = missed_in_other_layouts_;
  for (const Followed& topic : topics_) {
    sum.samples += topic.samples;
    sum.dropped += topic.missed_before + (topic.reader ? topic.reader->missed() : 0);
  }
  return sum;
}

bool Recorder::writers_alive() const {
  return std::any_of(topics_.begin(), topics_.end(),
                     [](const Followed& topic) { return topic.reader && topic.reader->writer_alive(); });
}

}  // namespace tools
