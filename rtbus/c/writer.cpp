// The handles of the C interface that publish.
#include <cstring>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "rtbus/c/detail/boundary.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/raw_writer.hpp"

using rtbus::capi::fail;
using rtbus::capi::guarded;

struct rtbus_writer {
  std::string topic;
  rtbus::RawWriter writer;
};

namespace {

template <std::size_t N>
std::string text_in(const char (&from)[N]) {
  return {from, ::strnlen(from, N)};
}

rtbus::RawType type_of(const rtbus_type& given) {
  rtbus::RawType out;
  out.name = text_in(given.name);
  out.bytes = given.bytes;
  for (std::uint32_t i = 0; i < given.field_count; ++i) {
    const rtbus_field& field = given.fields[i];
    // A number beyond the enumeration becomes 0, which problem_of() refuses by the field's name.
    const auto type = static_cast<rtbus::FieldType>(field.type > 0xff ? 0 : field.type);
    out.fields.push_back({text_in(field.name), text_in(field.unit), type, field.offset, field.count,
                          field.inner == 0 ? 1 : field.inner});
  }
  return out;
}

/// What the caller's options say; those of a shorter structure are zero.
rtbus_writer_options options_of(const rtbus_writer_options* given) {
  rtbus_writer_options out{};
  if (given != nullptr) std::memcpy(&out, given, std::min(given->struct_bytes, sizeof out));
  if (out.capacity == 0) out.capacity = rtbus::WriterOptions{}.capacity;
  if (out.mode == 0) out.mode = 0600;
  return out;
}

std::string milliseconds(std::uint64_t ns) { return std::to_string(ns / rtbus::kNsPerMs) + " ms"; }

/// A sample that was not published: the field, and what is wrong with it.
std::string why_refused(std::span<const std::byte> sample, const rtbus::RawType& type, std::uint64_t stamp_ns) {
  if (const std::string field = rtbus::not_finite(sample, type.fields); !field.empty()) return field + " is not finite";
  const std::string field = rtbus::impossible_field(sample, type, stamp_ns);
  for (const auto& each : type.fields) {
    if (each.name != field || each.type != rtbus::FieldType::kU64) continue;
    std::uint64_t value = 0;
    std::memcpy(&value, sample.data() + each.offset, sizeof value);
    if (each.unit != "ns" || value <= stamp_ns) break;
    return field + " lies " + milliseconds(value - stamp_ns) + " after the sample's own stamp: in the future";
  }
  if (!field.empty()) return field + " is impossible in a " + type.name;
  return "the fields of this " + type.name + " do not fit together (a row that names no other row)";
}

}  // namespace

int rtbus_writer_create(const char* session, const char* topic, const rtbus_type* type,
                        const rtbus_writer_options* options, rtbus_writer** out) {
  return guarded([&]() -> int {
    if (session == nullptr || topic == nullptr || type == nullptr || out == nullptr) {
      return fail(RTBUS_E_ARGUMENT, "session, topic, type and out must not be null");
    }
    *out = nullptr;
    if (type->struct_bytes < sizeof(rtbus_type) || type->fields == nullptr) {
      return fail(RTBUS_E_ARGUMENT, "set type->struct_bytes to sizeof(rtbus_type), and give its fields");
    }
    if (type->field_count > 1024) return fail(RTBUS_E_ARGUMENT, "a type has at most 1024 fields");
    rtbus::RawType raw = type_of(*type);
    if (const std::string problem = problem_of(raw); !problem.empty()) {
      return fail(RTBUS_E_ARGUMENT, "topic " + std::string(topic) + ", type " + raw.name + ": " + problem);
    }
    const rtbus_writer_options chosen = options_of(options);
    if (chosen.capacity < 2 || chosen.capacity > 65536 || (chosen.capacity & (chosen.capacity - 1)) != 0) {
      return fail(RTBUS_E_ARGUMENT, "topic " + std::string(topic) + ": capacity = " + std::to_string(chosen.capacity) +
                                        " is no power of two from 2 to 65536");
    }
    if ((chosen.mode & ~0666U) != 0 || (chosen.mode & 0602U) != 0600U) {
      return fail(RTBUS_E_ARGUMENT, "mode must let the owner read and write, and nobody write but owner and group");
    }
    rtbus::Session where;
    where.name = session;
    where.mode = static_cast<mode_t>(chosen.mode);
    auto made = rtbus::RawWriter::create(where, topic, std::move(raw),
                                         {.capacity = chosen.capacity, .doorbell = chosen.doorbell != 0});
    if (!made) return fail(made.error(), session, topic);
    *out = new rtbus_writer{topic, std::move(*made)};
    return RTBUS_OK;
  });
}

void rtbus_writer_close(rtbus_writer* writer) { delete writer; }

int rtbus_publish(rtbus_writer* writer, const void* sample, size_t bytes, uint64_t stamp_ns) {
  return guarded([&]() -> int {
    if (writer == nullptr || sample == nullptr) return fail(RTBUS_E_ARGUMENT, "writer and sample must not be null");
    const rtbus::RawType& type = writer->writer.type();
    if (bytes != type.bytes) {
      return fail(RTBUS_E_ARGUMENT, "topic " + writer->topic + ": a sample of " + std::to_string(bytes) +
                                        " bytes, and a " + type.name + " has " + std::to_string(type.bytes));
    }
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    if (stamp_ns > now_ns + rtbus::kMaxAhead_ns) {
      return fail(RTBUS_E_VALUE, "topic " + writer->topic + ": stamp_ns lies " + milliseconds(stamp_ns - now_ns) +
                                     " in the future; give 0, or a time of rtbus_now_ns()");
    }
    const std::uint64_t stamped_ns = stamp_ns == 0 ? now_ns : stamp_ns;
    if (writer->writer.publish(sample, stamped_ns)) return RTBUS_OK;
    const std::span all(static_cast<const std::byte*>(sample), bytes);
    return fail(RTBUS_E_VALUE, "topic " + writer->topic + ": " + why_refused(all, type, stamped_ns));
  });
}

int rtbus_observed(rtbus_writer* writer) {
  return guarded([&]() -> int {
    if (writer == nullptr) return fail(RTBUS_E_ARGUMENT, "writer must not be null");
    return writer->writer.observed() ? 1 : 0;
  });
}
