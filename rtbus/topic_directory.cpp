#include "rtbus/topic_directory.hpp"

#include <dirent.h>
#include <sys/mman.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <tuple>

#include "rtbus/detail/file.hpp"

namespace rtbus {

namespace {

struct Name {
  std::string file, session, topic;
};

/// Names in /dev/shm that follow our pattern "rtbus.<session>.<topic>".
std::vector<Name> our_names(std::optional<std::string_view> session) {
  std::vector<Name> names;
  DIR* const directory = ::opendir(detail::kShmDirectory);
  if (directory == nullptr) return names;
  while (const dirent* const entry = ::readdir(directory)) {
    constexpr std::string_view kPrefix = "rtbus.";
    const std::string_view file = entry->d_name;
    if (!file.starts_with(kPrefix)) continue;
    const std::string_view rest = file.substr(kPrefix.size());
    const std::size_t dot = rest.find('.');
    if (dot == std::string_view::npos) continue;
    const std::string_view its_session = rest.substr(0, dot), topic = rest.substr(dot + 1);
    if (!Session::valid_name(its_session) || !valid_topic_name(topic)) continue;
    if (session && its_session != *session) continue;
    names.push_back({std::string(file), std::string(its_session), std::string(topic)});
  }
  ::closedir(directory);
  std::sort(names.begin(), names.end(),
            [](const Name& a, const Name& b) { return std::tie(a.session, a.topic) < std::tie(b.session, b.topic); });
  return names;
}

Session session_named(const std::string& name) {
  Session session;
  session.name = name;
  return session;
}

template <class T>
T element(std::span<const std::byte> sample, std::uint64_t offset) noexcept {
  T value{};
  if (offset + sizeof value <= sample.size()) std::memcpy(&value, sample.data() + offset, sizeof value);
  return value;
}

}  // namespace

std::vector<TopicInfo> list_topics(std::optional<std::string_view> session) {
  std::vector<TopicInfo> topics;
  for (const Name& name : our_names(session)) {
    TopicInfo info;
    info.session = name.session;
    info.topic = name.topic;
    struct stat status {};
    if (!detail::look_up(name.file, status)) continue;  // gone since
    info.segment_bytes = static_cast<std::uint64_t>(status.st_size);
    info.owner = status.st_uid;
    auto segment = Segment::open(session_named(name.session), name.topic, nullptr, OwnerTrust::kAnyone, false);
    if (segment) {
      const Segment::Description& description = segment->description();
      info.type_name = description.type_name;
      info.fields = description.fields;
      info.sample_bytes = description.sample_bytes;
      info.capacity = description.capacity;
      info.published = segment->ring().newest->load(std::memory_order_acquire);
      info.epoch = segment->epoch();
      info.writer_pid = segment->writer_pid();
      info.writer_start_ns = segment->writer_start_ns();
      info.writer_alive = segment->writer_alive();
      info.segment_bytes = segment->bytes();
    } else if (segment.error() == TopicError::kNotFound) {
      if (!detail::look_up(name.file, status)) continue;
      info.problem = "not finished: its writer is starting, or died while it did";
    } else {
      info.problem = to_string(segment.error());
    }
    topics.push_back(std::move(info));
  }
  return topics;
}

RemovedTopics remove_dead(std::optional<std::string_view> session) {
  RemovedTopics removed;
  for (const Name& name : our_names(session)) {
    const std::string path = "/" + name.file;
    struct stat status {};
    if (!detail::look_up(name.file, status) || !S_ISREG(status.st_mode)) continue;
    if (status.st_uid != ::geteuid() && ::geteuid() != 0) continue;
    const int fd = ::shm_open(path.c_str(), O_RDWR, 0);
    if (fd < 0) continue;
    // The order matters: lock, then see that the name still leads to what was locked, then unlink, then unlock.
    if (::fstat(fd, &status) == 0 && detail::lock_byte(fd, F_WRLCK, detail::kWriterLockByte) &&
        detail::leads_to(name.file, detail::file_id(status)) && ::shm_unlink(path.c_str()) == 0) {
      removed.names.push_back(name.file);
      removed.bytes += static_cast<std::uint64_t>(status.st_size);
    }
    ::close(fd);
  }
  return removed;
}

RawReader::RawReader(Segment segment, const ReaderOptions& options)
    : segment_(std::move(segment)),
      ring_(segment_.ring()),
      sample_(segment_.description().sample_bytes / 8),
      scratch_(sample_.size()),
      sane_(rules_of(segment_.description().type_hash, segment_.description().sample_bytes)) {
  ring_.start(options.from_oldest);
}

Result<RawReader, TopicError> RawReader::open(const Session& session, std::string_view topic, ReaderOptions options) {
  auto segment = Segment::open(session, topic, nullptr, options.trust, options.presence);
  if (!segment) return Failure{segment.error()};
  return RawReader(std::move(*segment), options);
}

ReadStatus RawReader::take(detail::RingRead read) noexcept {
  switch (read) {
    case detail::RingRead::kFresh:
      sample_.swap(scratch_);
      return ReadStatus::kFresh;
    case detail::RingRead::kSame:
      return ReadStatus::kSame;
    case detail::RingRead::kRefused:
      return ReadStatus::kRefused;
    case detail::RingRead::kLapped:
      break;
  }
  return ReadStatus::kLapped;
}
bool RawReader::believes(const void* sample, std::uint64_t stamp_ns) noexcept {
  return sane_ == nullptr || (stamp_ns >= stamp_ns_ && sane_stamp(stamp_ns) && sane_(sample, stamp_ns));
}
ReadStatus RawReader::read_latest() noexcept {
  const auto judge = [this](const void* sample, std::uint64_t stamp_ns) { return believes(sample, stamp_ns); };
  return take(ring_.read_latest(scratch_.data(), sequence_, stamp_ns_, judge));
}
ReadStatus RawReader::read_next() noexcept {
  const auto judge = [this](const void* sample, std::uint64_t stamp_ns) { return believes(sample, stamp_ns); };
  return take(detail::pass_over_refused([&] { return ring_.read_next(scratch_.data(), sequence_, stamp_ns_, judge); }));
}
std::span<const std::byte> RawReader::bytes() const noexcept { return std::as_bytes(std::span(sample_)); }

std::uint32_t field_elements(const Segment::OwnedField& field) noexcept {
  return field.type == FieldType::kText ? 1 : field.count;
}

FieldValue field_value(std::span<const std::byte> sample, const Segment::OwnedField& field, std::uint32_t index) {
  const std::uint64_t offset = std::uint64_t{field.offset} + std::uint64_t{index} * field_type_bytes(field.type);
  switch (field.type) {
    case FieldType::kF64:
      return element<double>(sample, offset);
    case FieldType::kU64:
      return element<std::uint64_t>(sample, offset);
    case FieldType::kI64:
      return element<std::int64_t>(sample, offset);
    case FieldType::kU32:
      return std::uint64_t{element<std::uint32_t>(sample, offset)};
    case FieldType::kI32:
      return std::int64_t{element<std::int32_t>(sample, offset)};
    case FieldType::kU8:
      return std::uint64_t{element<std::uint8_t>(sample, offset)};
    case FieldType::kText:
      break;
  }
  std::string text;
  for (std::uint64_t i = field.offset; i < std::uint64_t{field.offset} + field.count && i < sample.size(); ++i) {
    const auto c = static_cast<unsigned char>(sample[i]);
    if (c == 0) break;
    text.push_back(c < 0x20 || c == 0x7f ? '?' : static_cast<char>(c));
  }
  return text;
}

void visit_fields(std::span<const std::byte> sample, const Segment::Description& description,
                  const std::function<void(const std::string&, const std::string&, const FieldValue&)>& visit) {
  for (const Segment::OwnedField& field : description.fields) {
    const std::uint32_t elements = field_elements(field);
    for (std::uint32_t i = 0; i < elements; ++i) {
      visit(elements == 1 ? field.name : field.name + "[" + std::to_string(i) + "]", field.unit,
            field_value(sample, field, i));
    }
  }
}

std::string to_text(const FieldValue& value) {
  if (const auto* const text = std::get_if<std::string>(&value)) return *text;
  char digits[40];
  char* const end = std::visit(
      [&digits](const auto& number) -> char* {
        if constexpr (std::is_same_v<std::decay_t<decltype(number)>, std::string>) {
          return digits;
        } else {
          return std::to_chars(std::begin(digits), std::end(digits), number).ptr;
        }
      },
      value);
  return {digits, end};
}

}  // namespace rtbus
