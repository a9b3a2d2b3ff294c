// The part of the C interface that has no handle: statuses, types, sessions and topics.
#include "rtbus/c/rtbus.h"

#include <algorithm>
#include <cstring>

#include "rtbus/c/detail/boundary.hpp"
#include "rtbus/c/detail/known_types.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/topic_directory.hpp"

using rtbus::capi::fail;
using rtbus::capi::guarded;
using rtbus::capi::put;

namespace {

/// A heartbeat older than this is that of a node which is dead or stopped.
constexpr std::uint64_t kBeatGoodFor_ns = 60 * rtbus::kNsPerMs;

/// Copies one entry into the caller's array, whose entries may be shorter than ours.
template <class Entry>
void put_entry(const Entry& entry, Entry* out, size_t entry_bytes, size_t capacity, size_t i) {
  if (out == nullptr || i >= capacity) return;
  std::memcpy(reinterpret_cast<char*>(out) + i * entry_bytes, &entry, std::min(entry_bytes, sizeof entry));
}

bool valid_array(const void* out, size_t entry_bytes, size_t capacity) {
  return capacity == 0 || (out != nullptr && entry_bytes >= 8);
}

rtbus_node node_info_of(const rtbus::Session& session, const rtbus::TopicInfo& topic) {
  rtbus_node info{};
  put(topic.topic.substr(0, topic.topic.size() - std::strlen(".heartbeat")), info.name);
  info.beat_age_ns = info.work_age_ns = UINT64_MAX;
  auto reader = rtbus::Reader<rtbus::Heartbeat>::open(session, topic.topic, {.trust = rtbus::OwnerTrust::kAnyone});
  rtbus::Stamped<rtbus::Heartbeat> beat;
  if (!reader || reader->read_latest(beat) != rtbus::ReadStatus::kFresh) return info;
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  const auto age = [now_ns](std::uint64_t then_ns) { return then_ns < now_ns ? now_ns - then_ns : 0; };
  info.pid = beat.value.pid;
  info.state = beat.value.state;
  info.beat_age_ns = age(beat.stamp_ns);
  if (beat.value.last_work_ns != 0) info.work_age_ns = age(beat.value.last_work_ns);
  info.work_period_ns = beat.value.work_period_ns;
  info.alive = reader->writer_alive() && info.beat_age_ns < kBeatGoodFor_ns ? 1 : 0;
  return info;
}

}  // namespace

const char* rtbus_strerror(int status) { return rtbus::capi::text_of(status); }
const char* rtbus_last_error(void) { return rtbus::capi::last_error(); }
uint32_t rtbus_abi_version(void) { return RTBUS_C_ABI_VERSION; }
const char* rtbus_version(void) { return RTBUS_VERSION; }
uint64_t rtbus_now_ns(void) { return rtbus::monotonic_ns(); }

int rtbus_known_type(const char* name, rtbus_type* out) {
  return guarded([&]() -> int {
    if (name == nullptr || out == nullptr) return fail(RTBUS_E_ARGUMENT, "name and out must not be null");
    const auto* const known = rtbus::capi::find_known_type(name);
    if (known == nullptr) {
      return fail(RTBUS_E_NOT_FOUND,
                  "there is no type '" + std::string(name) + "'; rtbus_known_type_name() lists them");
    }
    return rtbus::capi::put_type(known->type, known->fields, *out);
  });
}

const char* rtbus_known_type_name(size_t i) {
  const auto& types = rtbus::capi::known_types();
  return i < types.size() ? types[i].type.name : nullptr;
}

int rtbus_list(const char* session, rtbus_topic_info* out, size_t entry_bytes, size_t capacity) {
  return guarded([&]() -> int {
    if (!valid_array(out, entry_bytes, capacity)) return fail(RTBUS_E_ARGUMENT, "an array without room for entries");
    std::optional<std::string_view> wanted;
    if (session != nullptr) wanted = session;
    const auto topics = rtbus::list_topics(wanted);
    for (size_t i = 0; i < topics.size() && i < capacity; ++i) {
      const rtbus::TopicInfo& topic = topics[i];
      rtbus_topic_info info{};
      put(topic.session, info.session);
      put(topic.topic, info.topic);
      put(topic.type_name, info.type_name);
      put(topic.problem, info.problem);
      info.published = topic.published;
      info.segment_bytes = topic.segment_bytes;
      info.sample_bytes = topic.sample_bytes;
      info.capacity = topic.capacity;
      info.writer_pid = topic.writer_pid;
      info.writer_alive = topic.writer_alive ? 1 : 0;
      put_entry(info, out, entry_bytes, capacity, i);
    }
    return static_cast<int>(topics.size());
  });
}

int rtbus_session_nodes(const char* session, rtbus_node* out, size_t entry_bytes, size_t capacity) {
  return guarded([&]() -> int {
    if (session == nullptr) return fail(RTBUS_E_ARGUMENT, "session must not be null");
    if (!valid_array(out, entry_bytes, capacity)) return fail(RTBUS_E_ARGUMENT, "an array without room for entries");
    rtbus::Session where;
    where.name = session;
    int found = 0;
    for (const rtbus::TopicInfo& topic : rtbus::list_topics(session)) {
      if (!topic.problem.empty() || !topic.topic.ends_with(".heartbeat")) continue;
      put_entry(node_info_of(where, topic), out, entry_bytes, capacity, static_cast<size_t>(found++));
    }
    if (found == 0) {
      return fail(RTBUS_E_NOT_FOUND, "session " + std::string(session) +
                                         " has no node that beats; `rtbus list` shows which sessions are live");
    }
    return found;
  });
}
