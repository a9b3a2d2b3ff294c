#include "rtbus/recording/writer.hpp"

#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <ctime>
#include <map>

#include "rtbus/clock.hpp"
#include "rtbus/recording/frames.hpp"
#include "rtbus/recording/h5.hpp"

namespace rtbus::recording {
namespace {

using h5::Handle;

constexpr std::size_t kMarkBytes = 256;
constexpr hsize_t kChunkBytes = 32u << 10;
constexpr std::size_t kIndexCacheBytes = 2u << 20;

std::uint64_t unix_ns() {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  return static_cast<std::uint64_t>(now.tv_sec) * kNsPerS + static_cast<std::uint64_t>(now.tv_nsec);
}

std::string utc_text(std::uint64_t ns) {
  const auto seconds = static_cast<std::time_t>(ns / kNsPerS);
  std::tm utc{};
  gmtime_r(&seconds, &utc);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &utc);
  return text.data();
}

hid_t native_type(FieldType type) noexcept {
  switch (type) {
    case FieldType::kF64:
      return H5T_NATIVE_DOUBLE;
    case FieldType::kU64:
      return H5T_NATIVE_UINT64;
    case FieldType::kI64:
      return H5T_NATIVE_INT64;
    case FieldType::kU32:
      return H5T_NATIVE_UINT32;
    case FieldType::kI32:
      return H5T_NATIVE_INT32;
    default:
      return H5T_NATIVE_UINT8;
  }
}

/// The newest format, for which readers may look on, and caches that do not grow with the file. Rows are only appended,
/// so the chunk that is being filled and the next one are enough; the library's default, a mebibyte for each of some
/// hundred columns, fills over hours. Said for the file and not for each dataset: H5Fstart_swmr_write opens them anew.
Handle file_access() {
  Handle access(H5Pcreate(H5P_FILE_ACCESS), &H5Pclose);
  (void)H5Pset_libver_bounds(access.id(), H5F_LIBVER_LATEST, H5F_LIBVER_LATEST);
  constexpr std::size_t kSlots = 7;  // a prime; of the hash table
  (void)H5Pset_cache(access.id(), 0, kSlots, 2 * kChunkBytes, 1.0);
  H5AC_cache_config_t cache{};
  cache.version = H5AC__CURR_CACHE_CONFIG_VERSION;
  if (H5Pget_mdc_config(access.id(), &cache) >= 0) {
    cache.set_initial_size = true;
    cache.initial_size = cache.min_size = cache.max_size = kIndexCacheBytes;
    (void)H5Pset_mdc_config(access.id(), &cache);
  }
  return access;
}

/// One growing dataset and what waits to be written to it.
class Column {
 public:
  /// @param element Type of one element. @param count Elements per row.
  bool create(hid_t group, const std::string& name, hid_t element, std::size_t element_bytes, hsize_t count,
              int compression) {
    element_ = Handle(H5Tcopy(element), &H5Tclose);
    row_bytes_ = element_bytes * count;
    count_ = count;
    name_ = name;
    const hsize_t rows = std::clamp<hsize_t>(kChunkBytes / row_bytes_, 16, 4096);
    const std::array<hsize_t, 2> size{0, count}, most{H5S_UNLIMITED, count}, chunk{rows, count};
    const Handle space(H5Screate_simple(rank(), size.data(), most.data()), &H5Sclose);
    const Handle settings(H5Pcreate(H5P_DATASET_CREATE), &H5Pclose);
    (void)H5Pset_chunk(settings.id(), rank(), chunk.data());
    if (compression > 0) {
      (void)H5Pset_shuffle(settings.id());
      (void)H5Pset_deflate(settings.id(), static_cast<unsigned>(compression));
    }
    dataset_ = Handle(
        H5Dcreate2(group, name.c_str(), element_.id(), space.id(), H5P_DEFAULT, settings.id(), H5P_DEFAULT), &H5Dclose);
    return static_cast<bool>(dataset_);
  }

  /// After the file was opened anew.
  bool reopen(hid_t group) {
    dataset_ = Handle(H5Dopen2(group, name_.c_str(), H5P_DEFAULT), &H5Dclose);
    return static_cast<bool>(dataset_);
  }
  void release() noexcept { dataset_ = Handle(); }

  void push(const void* row) {
    const auto* const begin = static_cast<const std::byte*>(row);
    pending_.insert(pending_.end(), begin, begin + row_bytes_);
  }

  bool write() {
    if (pending_.empty()) return true;
    const hsize_t rows = pending_.size() / row_bytes_;
    const std::array<hsize_t, 2> size{written_ + rows, count_}, start{written_, 0}, block{rows, count_};
    if (H5Dset_extent(dataset_.id(), size.data()) < 0) return false;
    const Handle file_space(H5Dget_space(dataset_.id()), &H5Sclose);
    const Handle memory_space(H5Screate_simple(rank(), block.data(), nullptr), &H5Sclose);
    (void)H5Sselect_hyperslab(file_space.id(), H5S_SELECT_SET, start.data(), nullptr, block.data(), nullptr);
    if (H5Dwrite(dataset_.id(), element_.id(), memory_space.id(), file_space.id(), H5P_DEFAULT, pending_.data()) < 0) {
      return false;
    }
    written_ += rows;
    pending_.clear();
    return true;
  }

  bool flush() { return H5Dflush(dataset_.id()) >= 0; }
  [[nodiscard]] hid_t id() const noexcept { return dataset_.id(); }
  [[nodiscard]] std::uint64_t rows() const noexcept { return written_ + pending_.size() / row_bytes_; }
  [[nodiscard]] std::uint64_t pending_bytes() const noexcept { return pending_.size(); }

 private:
  [[nodiscard]] int rank() const noexcept { return count_ > 1 ? 2 : 1; }

  std::string name_;
  Handle element_;
  Handle dataset_;
  std::size_t row_bytes_ = 0;
  hsize_t count_ = 1;
  hsize_t written_ = 0;
  std::vector<std::byte> pending_;
};

struct Topic {
  std::string group;
  std::vector<Segment::OwnedField> fields;
  std::uint32_t sample_bytes = 0;
  std::vector<Column> columns;  ///< sequence, stamp_ns, then one per field.
  Handle dropped;               ///< One number, overwritten.
  std::uint64_t dropped_count = 0;
  bool dropped_changed = false;
};

/// `bodies/name`: one row per body.
bool write_body_names(hid_t root, const std::vector<std::string>& names) {
  if (names.empty()) return true;
  std::size_t longest = 1;
  for (const std::string& name : names) longest = std::max(longest, name.size());
  std::string rows;
  for (const std::string& name : names) {
    rows += name;
    rows.resize((&name - names.data() + 1) * longest);
  }
  const hsize_t count = names.size();
  const Handle type = h5::text_type(longest);
  const Handle space(H5Screate_simple(1, &count, nullptr), &H5Sclose);
  const Handle group(H5Gcreate2(root, "bodies", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), &H5Gclose);
  const Handle data(H5Dcreate2(group.id(), "name", type.id(), space.id(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
                    &H5Dclose);
  return data && H5Dwrite(data.id(), type.id(), H5S_ALL, H5S_ALL, H5P_DEFAULT, rows.data()) >= 0;
}

Fault fault(const std::string& what) { return {what + ": " + h5::last_error()}; }

}  // namespace

struct Writer::Impl {
  std::string path;
  Metadata metadata;
  Handle file;
  std::vector<Topic> topics;
  Column mark_stamps, mark_texts;
  bool streaming = false;  ///< In the mode that survives a kill; nothing can be added then.
  bool failed = false;
  bool closed = false;

  Result<void, Fault> begin();
  Result<void, Fault> reopen();
  bool create_marks();
  bool create_topic(Topic& topic, const Segment::Description& description);
  Result<void, Fault> write_out();
  Result<void, Fault> room() const;
};

Writer::Writer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Writer::Writer(Writer&&) noexcept = default;
Writer& Writer::operator=(Writer&&) noexcept = default;
Writer::~Writer() {
  if (impl_) (void)close();
}

Result<Writer, Fault> Writer::create(const std::string& path, Metadata metadata) {
  h5::quiet();
  if (::access(path.c_str(), F_OK) == 0) {
    return Failure{Fault{path + " exists already; choose another name, or remove it first"}};
  }
  const Handle access = file_access();
  auto impl = std::make_unique<Impl>();
  impl->path = path;
  errno = 0;
  impl->file = Handle(H5Fcreate(path.c_str(), H5F_ACC_EXCL, H5P_DEFAULT, access.id()), &H5Fclose);
  if (!impl->file) {
    const int error = errno;
    const std::string reason = error != 0 ? std::string(std::strerror(error)) : h5::last_error();
    return Failure{Fault{"cannot create " + path + ": " + reason}};
  }
  impl->metadata = std::move(metadata);
  const Metadata& about = impl->metadata;
  const hid_t root = impl->file.id();
  const std::uint64_t wall_ns = unix_ns(), clock_ns = monotonic_ns();
  bool fine = h5::set_attribute(root, "schema", kSchema) && h5::set_attribute(root, "session", about.session) &&
              h5::set_attribute(root, "version", about.version) && h5::set_attribute(root, "machine", about.machine) &&
              h5::set_attribute(root, "started_utc", utc_text(wall_ns)) &&
              h5::set_attribute(root, "started_unix_ns", wall_ns) &&
              h5::set_attribute(root, "started_monotonic_ns", clock_ns);
  for (const char* name : {"topics", "marks", "config"}) {
    const Handle group(H5Gcreate2(root, name, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), &H5Gclose);
    fine = fine && group;
  }
  const Handle config(H5Gopen2(root, "config", H5P_DEFAULT), &H5Gclose);
  const Handle scalar(H5Screate(H5S_SCALAR), &H5Sclose);
  for (std::size_t i = 0; i < about.config.size(); ++i) {
    const ConfigFile& text = about.config[i];
    const std::string stored = text.text.empty() ? std::string(1, '\0') : text.text;
    const Handle type = h5::text_type(stored.size());
    const Handle dataset(H5Dcreate2(config.id(), ("file" + std::to_string(i)).c_str(), type.id(), scalar.id(),
                                    H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
                         &H5Dclose);
    fine = fine && dataset && h5::set_attribute(dataset.id(), "path", text.path) &&
           H5Dwrite(dataset.id(), type.id(), H5S_ALL, H5S_ALL, H5P_DEFAULT, stored.data()) >= 0;
  }
  std::string commands;
  for (const std::string& command : about.commands) commands += command + '\n';
  fine = fine && h5::set_attribute(config.id(), "commands", commands) && write_body_names(root, about.body_names) &&
         impl->create_marks();
  if (!fine) return Failure{fault("cannot write to " + path)};
  return Writer(std::move(impl));
}

bool Writer::Impl::create_marks() {
  const Handle group(H5Gopen2(file.id(), "marks", H5P_DEFAULT), &H5Gclose);
  return group && mark_stamps.create(group.id(), "stamp_ns", H5T_NATIVE_UINT64, 8, 1, 0) &&
         h5::set_attribute(mark_stamps.id(), "unit", "ns") &&
         mark_texts.create(group.id(), "text", h5::text_type(kMarkBytes).id(), kMarkBytes, 1, 0);
}

bool Writer::Impl::create_topic(Topic& topic, const Segment::Description& description) {
  const Handle parent(H5Gopen2(file.id(), "topics", H5P_DEFAULT), &H5Gclose);
  const Handle group(H5Gcreate2(parent.id(), topic.group.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), &H5Gclose);
  if (!group || !h5::set_attribute(group.id(), "type", description.type_name) ||
      !h5::set_attribute(group.id(), "sample_bytes", description.sample_bytes)) {
    return false;
  }
  const auto add = [&](const std::string& name, hid_t element, std::size_t bytes, hsize_t count,
                       const std::string& unit, std::string_view frame) {
    Column& column = topic.columns.emplace_back();
    return column.create(group.id(), name, element, bytes, count, metadata.compression) &&
           (unit.empty() || h5::set_attribute(column.id(), "unit", unit)) &&
           (frame.empty() || h5::set_attribute(column.id(), "frame", std::string(frame)));
  };
  // "sequence" and "stamp_ns" are the bus's own; no message of ours has fields of these names.
  bool fine = add("sequence", H5T_NATIVE_UINT64, 8, 1, "1", "") && add("stamp_ns", H5T_NATIVE_UINT64, 8, 1, "ns", "");
  for (const Segment::OwnedField& field : topic.fields) {
    if (field.type == FieldType::kText) {
      fine = fine && add(field.name, h5::text_type(field.count).id(), field.count, 1, "", "");
    } else {
      fine = fine && add(field.name, native_type(field.type), field_type_bytes(field.type), field.count, field.unit,
                         frame_of(description.type_name, field.name));
    }
    fine = fine && h5::set_attribute(topic.columns.back().id(), "offset", field.offset);  // within the sample
  }
  const Handle scalar(H5Screate(H5S_SCALAR), &H5Sclose);
  topic.dropped =
      Handle(H5Dcreate2(group.id(), "dropped", H5T_NATIVE_UINT64, scalar.id(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
             &H5Dclose);
  const std::uint64_t none = 0;
  return fine && topic.dropped && h5::set_attribute(topic.dropped.id(), "unit", "samples") &&
         H5Dwrite(topic.dropped.id(), H5T_NATIVE_UINT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, &none) >= 0;
}

Result<void, Fault> Writer::Impl::begin() {
  if (streaming) return {};
  if (H5Fstart_swmr_write(file.id()) < 0) return Failure{fault("cannot start writing " + path)};
  streaming = true;
  return {};
}

/// Leaves the streaming mode: only closing the file does.
Result<void, Fault> Writer::Impl::reopen() {
  if (!streaming) return {};
  if (auto written = write_out(); !written) return written;
  mark_stamps.release();
  mark_texts.release();
  for (Topic& topic : topics) {
    for (Column& column : topic.columns) column.release();
    topic.dropped = Handle();
  }
  if (!file.reset()) return Failure{fault("cannot close " + path)};
  streaming = false;
  const Handle access = file_access();
  file = Handle(H5Fopen(path.c_str(), H5F_ACC_RDWR, access.id()), &H5Fclose);
  if (!file) return Failure{fault("cannot open " + path + " again")};
  const Handle marks(H5Gopen2(file.id(), "marks", H5P_DEFAULT), &H5Gclose);
  bool fine = marks && mark_stamps.reopen(marks.id()) && mark_texts.reopen(marks.id());
  for (Topic& topic : topics) {
    const Handle group(H5Gopen2(file.id(), ("topics/" + topic.group).c_str(), H5P_DEFAULT), &H5Gclose);
    for (Column& column : topic.columns) fine = fine && column.reopen(group.id());
    topic.dropped = Handle(H5Dopen2(group.id(), "dropped", H5P_DEFAULT), &H5Dclose);
    fine = fine && topic.dropped;
  }
  if (!fine) return Failure{fault("cannot open " + path + " again")};
  return {};
}

Result<std::size_t, Fault> Writer::add_topic(const std::string& name, const Segment::Description& description) {
  if (auto opened = impl_->reopen(); !opened) return Failure{opened.error()};
  Topic topic;
  topic.group = name;
  for (int version = 2; std::any_of(impl_->topics.begin(), impl_->topics.end(),
                                    [&](const Topic& other) { return other.group == topic.group; });
       ++version) {
    topic.group = name + "~" + std::to_string(version);
  }
  topic.fields = description.fields;
  topic.sample_bytes = description.sample_bytes;
  if (!impl_->create_topic(topic, description)) return Failure{fault("cannot add the topic " + topic.group)};
  impl_->topics.push_back(std::move(topic));
  return impl_->topics.size() - 1;
}

void Writer::append(std::size_t handle, std::uint64_t sequence, std::uint64_t stamp_ns,
                    std::span<const std::byte> bytes) {
  Topic& topic = impl_->topics.at(handle);
  if (bytes.size() != topic.sample_bytes) return;
  topic.columns[0].push(&sequence);
  topic.columns[1].push(&stamp_ns);
  for (std::size_t i = 0; i < topic.fields.size(); ++i)
    topic.columns[i + 2].push(bytes.data() + topic.fields[i].offset);
}

void Writer::set_dropped(std::size_t handle, std::uint64_t count) {
  Topic& topic = impl_->topics.at(handle);
  topic.dropped_changed = topic.dropped_changed || count != topic.dropped_count;
  topic.dropped_count = count;
}

void Writer::mark(std::uint64_t stamp_ns, const std::string& text) {
  std::array<char, kMarkBytes> stored{};
  std::memcpy(stored.data(), text.data(), std::min(text.size(), kMarkBytes - 1));
  impl_->mark_stamps.push(&stamp_ns);
  impl_->mark_texts.push(stored.data());
}

Result<void, Fault> Writer::Impl::room() const {
  struct statvfs disk {};
  if (::statvfs(path.c_str(), &disk) != 0) return {};
  const std::uint64_t free_bytes = static_cast<std::uint64_t>(disk.f_bavail) * disk.f_frsize;
  if (free_bytes >= metadata.reserve_bytes) return {};
  return Failure{Fault{"the disk of " + path + " is nearly full (" + std::to_string(free_bytes >> 20) +
                       " MiB left); the recording has ended, what was written is whole"}};
}

Result<void, Fault> Writer::Impl::write_out() {
  if (failed) return Failure{Fault{path + " could not be written before"}};
  bool fine = mark_stamps.write() && mark_texts.write() && mark_stamps.flush() && mark_texts.flush();
  for (Topic& topic : topics) {
    for (Column& column : topic.columns) fine = fine && column.write() && column.flush();
    if (topic.dropped_changed) {
      topic.dropped_changed = false;
      fine = fine &&
             H5Dwrite(topic.dropped.id(), H5T_NATIVE_UINT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, &topic.dropped_count) >= 0;
    }
  }
  fine = fine && H5Fflush(file.id(), H5F_SCOPE_LOCAL) >= 0;
  if (fine) return {};
  failed = true;
  return Failure{fault("cannot write to " + path)};
}

Result<void, Fault> Writer::flush() {
  if (auto begun = impl_->begin(); !begun) return begun;
  if (auto enough = impl_->room(); !enough) return enough;
  return impl_->write_out();
}

Result<void, Fault> Writer::close() {
  if (std::exchange(impl_->closed, true)) return {};
  Result<void, Fault> outcome = impl_->failed ? Result<void, Fault>{} : impl_->write_out();
  impl_->mark_stamps.release();
  impl_->mark_texts.release();
  for (Topic& topic : impl_->topics) {
    for (Column& column : topic.columns) column.release();
    topic.dropped = Handle();
  }
  if (!impl_->file.reset() && outcome) outcome = Failure{fault("cannot close " + impl_->path)};
  if (!outcome || impl_->failed) return outcome;
  const Handle file(H5Fopen(impl_->path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT), &H5Fclose);
  if (!file || !h5::set_attribute(file.id(), "ended_unix_ns", unix_ns())) {
    return Failure{fault("cannot finish " + impl_->path)};
  }
  return {};
}

std::uint64_t Writer::rows(std::size_t topic) const noexcept { return impl_->topics[topic].columns[0].rows(); }

std::uint64_t Writer::pending_bytes() const noexcept {
  std::uint64_t sum = 0;
  for (const Topic& topic : impl_->topics) {
    for (const Column& column : topic.columns) sum += column.pending_bytes();
  }
  return sum;
}

std::uint64_t Writer::file_bytes() const noexcept {
  struct stat status {};
  return ::stat(impl_->path.c_str(), &status) == 0 ? static_cast<std::uint64_t>(status.st_size) : 0;
}

}  // namespace rtbus::recording
