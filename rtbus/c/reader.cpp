// The handles of the C interface that read.
#include <algorithm>
#include <cstring>
#include <memory>
#include <optional>

#include "rtbus/c/detail/boundary.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/topic_directory.hpp"

using rtbus::capi::fail;
using rtbus::capi::guarded;

namespace {

/// Between two looks whether the topic was made anew.
constexpr std::uint64_t kLook_ns = 20 * rtbus::kNsPerMs;

}  // namespace

struct rtbus_reader {
  rtbus::Session session;
  std::string topic;
  rtbus::ReaderOptions options;
  std::optional<rtbus::RawReader> reader;
  rtbus_type type{};
  std::vector<rtbus_field> fields;
  std::uint64_t missed_before = 0, refused_before = 0;  // by the segments before the present one

  [[nodiscard]] int open();
  /// Follows the topic to another segment; a status < 0 when that carries another type.
  [[nodiscard]] int follow();
};

int rtbus_reader::open() {
  auto opened = rtbus::RawReader::open(session, topic, options);
  if (!opened) return fail(opened.error(), session.name, topic);
  reader.emplace(std::move(*opened));
  const rtbus::Segment::Description& description = reader->description();
  type.struct_bytes = sizeof type;
  rtbus::capi::put(description.type_name, type.name);
  type.hash = description.type_hash;
  type.bytes = description.sample_bytes;
  fields.clear();
  for (const auto& field : description.fields) fields.push_back(rtbus::capi::field_of(field));
  return RTBUS_OK;
}

int rtbus_reader::follow() {
  if (!reader->replaced()) return RTBUS_SAME;
  rtbus::ReaderOptions anew = options;
  anew.from_oldest = true;  // nothing of the new segment has been seen
  auto opened = rtbus::RawReader::open(session, topic, anew);
  if (!opened) return RTBUS_SAME;  // not there yet: the old one may still be read
  if (opened->description().type_hash != type.hash || opened->description().sample_bytes != type.bytes) {
    return fail(RTBUS_E_LAYOUT, "session " + session.name + ", topic " + topic + ": a new writer publishes " +
                                    opened->description().type_name + " of another layout than " + type.name +
                                    " before; open the topic again");
  }
  if (reader->writer_alive() && !opened->writer_alive()) return RTBUS_SAME;
  missed_before += reader->missed();
  refused_before += reader->refused();
  reader.emplace(std::move(*opened));
  return RTBUS_OK;
}

int rtbus_reader_open(const char* session, const char* topic, uint32_t flags, rtbus_reader** out) {
  return guarded([&]() -> int {
    if (session == nullptr || topic == nullptr || out == nullptr) {
      return fail(RTBUS_E_ARGUMENT, "session, topic and out must not be null");
    }
    *out = nullptr;
    auto made = std::make_unique<rtbus_reader>();
    made->session.name = session;
    made->topic = topic;
    made->options.presence = (flags & RTBUS_PRESENCE) != 0;
    made->options.from_oldest = (flags & RTBUS_FROM_OLDEST) != 0;
    if ((flags & RTBUS_ANY_OWNER) != 0) made->options.trust = rtbus::OwnerTrust::kAnyone;
    if (const int status = made->open(); status < 0) return status;
    *out = made.release();
    return RTBUS_OK;
  });
}

void rtbus_reader_close(rtbus_reader* reader) { delete reader; }

int rtbus_reader_type(const rtbus_reader* reader, rtbus_type* out) {
  if (reader == nullptr || out == nullptr) return fail(RTBUS_E_ARGUMENT, "reader and out must not be null");
  return rtbus::capi::put_type(reader->type, reader->fields, *out);
}

int rtbus_read_latest(rtbus_reader* reader, void* out, size_t bytes, rtbus_stamp* stamp) {
  if (reader == nullptr || out == nullptr) return fail(RTBUS_E_ARGUMENT, "reader and out must not be null");
  if (bytes != reader->type.bytes) return fail(RTBUS_E_ARGUMENT, "bytes must be those of one sample (rtbus_type)");
  switch (reader->reader->read_latest()) {
    case rtbus::ReadStatus::kFresh:
      break;
    case rtbus::ReadStatus::kLapped:
      return RTBUS_LAPPED;
    case rtbus::ReadStatus::kRefused:
      return RTBUS_REFUSED;
    case rtbus::ReadStatus::kSame:
    case rtbus::ReadStatus::kDetached:
      return RTBUS_SAME;
  }
  std::memcpy(out, reader->reader->bytes().data(), bytes);
  if (stamp != nullptr) *stamp = {reader->reader->sequence(), reader->reader->stamp_ns()};
  return RTBUS_FRESH;
}

int rtbus_read_next(rtbus_reader* reader, void* out, size_t bytes, rtbus_stamp* stamps, size_t capacity) {
  if (reader == nullptr || out == nullptr) return fail(RTBUS_E_ARGUMENT, "reader and out must not be null");
  const size_t sample_bytes = reader->type.bytes;
  capacity = std::min({capacity, bytes / sample_bytes, size_t{INT32_MAX}});
  if (capacity == 0) return fail(RTBUS_E_ARGUMENT, "out has no room for a sample (rtbus_type)");
  size_t count = 0;
  while (count < capacity && reader->reader->read_next() == rtbus::ReadStatus::kFresh) {
    std::memcpy(static_cast<char*>(out) + count * sample_bytes, reader->reader->bytes().data(), sample_bytes);
    if (stamps != nullptr) stamps[count] = {reader->reader->sequence(), reader->reader->stamp_ns()};
    ++count;
  }
  return static_cast<int>(count);
}

int rtbus_wait(rtbus_reader* reader, uint64_t deadline_ns) {
  return guarded([&]() -> int {
    if (reader == nullptr) return fail(RTBUS_E_ARGUMENT, "reader must not be null");
    while (true) {
      const std::uint64_t look_ns = rtbus::monotonic_ns() + kLook_ns;
      if (reader->reader->wait(std::min(deadline_ns, look_ns))) return RTBUS_FRESH;
      if (const int status = reader->follow(); status < 0) return status;
      if (rtbus::monotonic_ns() >= deadline_ns) return RTBUS_SAME;
    }
  });
}

uint64_t rtbus_missed(const rtbus_reader* reader) {
  return reader == nullptr ? 0 : reader->missed_before + reader->reader->missed();
}
uint64_t rtbus_refused(const rtbus_reader* reader) {
  return reader == nullptr ? 0 : reader->refused_before + reader->reader->refused();
}
int rtbus_writer_alive(const rtbus_reader* reader) {
  return reader != nullptr && reader->reader->writer_alive() ? 1 : 0;
}
