#include "tools/cli/recording/recorder.hpp"

#include <algorithm>
#include <utility>

#include "rtbus/clock.hpp"
#include "tools/cli/host/loop_cores.hpp"

namespace tools {
namespace {

using rtbus::recording::Fault;

/// Bulky, and needed neither for a replay nor for the usual plots.
bool is_bodies(const std::string& topic) { return topic == "physics.body_poses" || topic == "physics.soft_nodes"; }
bool is_contacts(const std::string& topic) { return topic.starts_with("physics.contacts."); }
/// Published once, when the engine begins.
bool is_told_once(const std::string& topic) { return topic == "physics.body_shapes"; }

}  // namespace

Recorder::Recorder(rtbus::Session session, rtbus::recording::Writer writer, RecordedTopics wanted)
    : session_(std::move(session)), writer_(std::move(writer)), wanted_(std::move(wanted)), inbox_(session_.name) {}

bool Recorder::wants(const std::string& topic) const {
  if (wanted_.names.empty()) {
    return (wanted_.bodies || !is_bodies(topic)) && (wanted_.contacts || !is_contacts(topic));
  }
  return std::any_of(wanted_.names.begin(), wanted_.names.end(),
                     [&](const std::string& name) { return topic.starts_with(name); });
}

rtbus::Result<void, Fault> Recorder::follow(Followed& topic) {
  // Presence: a node publishes its telemetry only while somebody says that he looks.
  auto reader =
      rtbus::RawReader::open(session_, topic.name,
                             {.presence = true,
                              .from_oldest = wanted_.from_first || topic.reader.has_value() || is_told_once(topic.name),
                              .trust = rtbus::OwnerTrust::kAnyone});
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

std::string Recorder::why_no_replay() const {
  for (const Followed& topic : topics_) {
    if (topic.name.ends_with(".device_state") && topic.reader) {
      const std::uint64_t lost = topic.missed_before + topic.reader->missed();
      return lost == 0 ? "" : std::to_string(lost) + " samples of " + topic.name + " were lost: the motion has gaps";
    }
  }
  return "it has no motion of a device; record the topic NODE.device_state too";
}

bool Recorder::writers_alive() const {
  return std::any_of(topics_.begin(), topics_.end(),
                     [](const Followed& topic) { return topic.reader && topic.reader->writer_alive(); });
}

}  // namespace tools
