#include "rtbus/recording/reader.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <map>

#include "rtbus/recording/h5.hpp"

namespace rtbus::recording {
namespace {

using h5::Handle;

// A file may come from anybody: what it says about sizes is checked before anything is allocated or read.
constexpr std::size_t kLongestText = 64U << 20;  // of a configuration file, an attribute or a mark
constexpr std::size_t kLargestSample = 1U << 20;
/// deflate makes data at most 1032 times smaller (zlib's manual); and what a recording that is being written has not
/// stored yet.
constexpr std::uint64_t kMostCompression = 1032, kNotYetStored = 256U << 20;

/// One value, and no more: what is read into a variable.
bool is_single(const Handle& space) { return space && H5Sget_simple_extent_npoints(space.id()) == 1; }

/// Bytes of a text of fixed length; 0: it is something else, or too long.
std::size_t text_bytes(hid_t type) {
  if (H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) != 0) return 0;
  const std::size_t bytes = H5Tget_size(type);
  return bytes <= kLongestText ? bytes : 0;
}

Handle attribute(hid_t object, const char* name) {
  if (H5Aexists(object, name) <= 0) return {};
  return {H5Aopen(object, name, H5P_DEFAULT), &H5Aclose};
}

std::string text_attribute(hid_t object, const char* name) {
  const Handle found = attribute(object, name);
  if (!found) return {};
  const Handle type(H5Aget_type(found.id()), &H5Tclose), space(H5Aget_space(found.id()), &H5Sclose);
  std::string text(is_single(space) ? text_bytes(type.id()) : 0, '\0');
  if (text.empty()) return {};
  if (H5Aread(found.id(), type.id(), text.data()) < 0) return {};
  text.resize(std::strlen(text.c_str()));
  return text;
}

std::uint64_t number_attribute(hid_t object, const char* name) {
  unsigned long long value = 0;
  const Handle found = attribute(object, name);
  if (!found) return 0;
  const Handle space(H5Aget_space(found.id()), &H5Sclose);
  if (is_single(space)) (void)H5Aread(found.id(), H5T_NATIVE_ULLONG, &value);
  return value;
}

std::vector<std::string> links(hid_t group) {
  std::vector<std::string> names;
  const auto visit = [](hid_t, const char* name, const H5L_info_t*, void* out) -> herr_t {
    static_cast<std::vector<std::string>*>(out)->emplace_back(name);
    return 0;
  };
  hsize_t index = 0;
  (void)H5Literate(group, H5_INDEX_NAME, H5_ITER_INC, &index, +visit, &names);
  return names;
}

/// Type of one element as the bus calls it, or none.
bool field_type_of(hid_t type, FieldType& out) {
  const std::size_t bytes = H5Tget_size(type);
  switch (H5Tget_class(type)) {
    case H5T_FLOAT:
      out = FieldType::kF64;
      return bytes == 8;
    case H5T_STRING:
      out = FieldType::kText;
      return H5Tis_variable_str(type) == 0;
    case H5T_INTEGER: {
      const bool is_signed = H5Tget_sign(type) == H5T_SGN_2;
      if (bytes == 8) return out = is_signed ? FieldType::kI64 : FieldType::kU64, true;
      if (bytes == 4) return out = is_signed ? FieldType::kI32 : FieldType::kU32, true;
      out = FieldType::kU8;
      return bytes == 1 && !is_signed;
    }
    default:
      return false;
  }
}

/// Rows and elements per row of a dataset.
std::array<hsize_t, 2> shape(hid_t dataset) {
  std::array<hsize_t, 2> size{0, 1};
  const Handle space(H5Dget_space(dataset), &H5Sclose);
  if (H5Sget_simple_extent_ndims(space.id()) <= 2) (void)H5Sget_simple_extent_dims(space.id(), size.data(), nullptr);
  return size;
}

/// The file may well hold so many values. Rows of none are no rows: there could be any number of them.
bool plausible(hid_t dataset, hid_t type) {
  const auto [rows, count] = shape(dataset);
  const std::uint64_t most =
      std::min<std::uint64_t>(H5Dget_storage_size(dataset), 1ULL << 48) * kMostCompression + kNotYetStored;
  const std::uint64_t value = H5Tget_size(type);
  return value > 0 && count > 0 && count <= most / value && rows <= most / (value * count);
}

/// Reads rows [first, first + rows) and elements [element, element + count) as `memory_type`.
bool read_block(hid_t dataset, hid_t memory_type, hsize_t first, hsize_t rows, hsize_t element, hsize_t count,
                void* out) {
  if (rows == 0) return true;
  const Handle space(H5Dget_space(dataset), &H5Sclose);
  const int rank = H5Sget_simple_extent_ndims(space.id());
  const std::array<hsize_t, 2> start{first, element}, block{rows, count};
  if (H5Sselect_hyperslab(space.id(), H5S_SELECT_SET, start.data(), nullptr, block.data(), nullptr) < 0) return false;
  const Handle memory(H5Screate_simple(rank, block.data(), nullptr), &H5Sclose);
  return H5Dread(dataset, memory_type, memory.id(), space.id(), H5P_DEFAULT, out) >= 0;
}

}  // namespace

struct Recording::Impl {
  std::string path, session, version, started_utc;
  std::uint64_t started_unix_ns = 0, started_monotonic_ns = 0;
  bool complete = false;
  Handle file;
  std::vector<RecordedTopic> topics;

  [[nodiscard]] Handle dataset(const std::string& topic, const std::string& name) const {
    return {H5Dopen2(file.id(), ("topics/" + topic + "/" + name).c_str(), H5P_DEFAULT), &H5Dclose};
  }
  [[nodiscard]] bool read_topic(const std::string& name);
  [[nodiscard]] std::vector<std::uint64_t> numbers(const RecordedTopic& topic, const char* name, std::uint64_t first,
                                                   std::uint64_t count) const;
};

namespace {
/// [first, first + count) cut to what there is.
std::uint64_t rows_from(const RecordedTopic& topic, std::uint64_t first, std::uint64_t count) {
  return first >= topic.rows ? 0 : std::min(count, topic.rows - first);
}
}  // namespace

Recording::Recording(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Recording::Recording(Recording&&) noexcept = default;
Recording& Recording::operator=(Recording&&) noexcept = default;
Recording::~Recording() = default;

bool Recording::Impl::read_topic(const std::string& name) {
  const Handle group(H5Gopen2(file.id(), ("topics/" + name).c_str(), H5P_DEFAULT), &H5Gclose);
  if (!group) return false;
  RecordedTopic topic;
  topic.name = name;
  topic.type_name = text_attribute(group.id(), "type");
  topic.sample_bytes = static_cast<std::uint32_t>(number_attribute(group.id(), "sample_bytes"));
  if (topic.sample_bytes > kLargestSample) return false;
  topic.rows = UINT64_MAX;
  for (const std::string& link : links(group.id())) {
    const Handle data(H5Dopen2(group.id(), link.c_str(), H5P_DEFAULT), &H5Dclose);
    if (!data) return false;
    if (link == "dropped") {
      const Handle space(H5Dget_space(data.id()), &H5Sclose);
      if (is_single(space)) (void)H5Dread(data.id(), H5T_NATIVE_UINT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, &topic.dropped);
      continue;
    }
    const Handle type(H5Dget_type(data.id()), &H5Tclose);
    if (!plausible(data.id(), type.id())) return false;
    const auto [rows, count] = shape(data.id());
    topic.rows = std::min<std::uint64_t>(topic.rows, rows);  // a cut-off recording may end in the middle of a row
    if (link == "sequence" || link == "stamp_ns") continue;
    Segment::OwnedField field;
    field.name = link;
    field.unit = text_attribute(data.id(), "unit");
    field.offset = static_cast<std::uint32_t>(number_attribute(data.id(), "offset"));
    if (!field_type_of(type.id(), field.type)) return false;
    field.count = static_cast<std::uint32_t>(field.type == FieldType::kText ? H5Tget_size(type.id()) : count);
    const std::uint64_t end = field.offset + std::uint64_t{field.count} * field_type_bytes(field.type);
    if (end > topic.sample_bytes) return false;
    topic.fields.push_back(std::move(field));
  }
  std::sort(topic.fields.begin(), topic.fields.end(), [](const auto& a, const auto& b) { return a.offset < b.offset; });
  if (topic.rows == UINT64_MAX) topic.rows = 0;
  topics.push_back(std::move(topic));
  return true;
}

Result<Recording, Fault> Recording::open(const std::string& path) {
  h5::quiet();
  if (::access(path.c_str(), R_OK) != 0) {
    return Failure{Fault{"cannot read " + path + ": " + std::strerror(errno)}};
  }
  auto impl = std::make_unique<Impl>();
  impl->path = path;
  // One that is being written, or whose recorder was killed, says so in its header and opens only in this way.
  impl->file = Handle(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), &H5Fclose);
  if (!impl->file) {
    impl->file = Handle(H5Fopen(path.c_str(), H5F_ACC_RDONLY | H5F_ACC_SWMR_READ, H5P_DEFAULT), &H5Fclose);
  }
  if (!impl->file) return Failure{Fault{path + " is no recording: " + h5::last_error()}};
  const hid_t root = impl->file.id();
  if (const std::string schema = text_attribute(root, "schema"); schema != kSchema) {
    return Failure{
        Fault{path + " is no recording of this version: its schema is \"" + schema + "\", not \"" + kSchema + "\""}};
  }
  impl->session = text_attribute(root, "session");
  impl->version = text_attribute(root, "version");
  impl->started_utc = text_attribute(root, "started_utc");
  impl->started_unix_ns = number_attribute(root, "started_unix_ns");
  impl->started_monotonic_ns = number_attribute(root, "started_monotonic_ns");
  impl->complete = H5Aexists(root, "ended_unix_ns") > 0;
  const Handle group(H5Gopen2(root, "topics", H5P_DEFAULT), &H5Gclose);
  for (const std::string& name : links(group.id())) {
    if (!impl->read_topic(name)) return Failure{Fault{path + ": the topic " + name + " is damaged"}};
  }
  return Recording(std::move(impl));
}

const std::string& Recording::path() const noexcept { return impl_->path; }
const std::string& Recording::session() const noexcept { return impl_->session; }
const std::string& Recording::version() const noexcept { return impl_->version; }
const std::string& Recording::started_utc() const noexcept { return impl_->started_utc; }
std::uint64_t Recording::started_unix_ns() const noexcept { return impl_->started_unix_ns; }
std::uint64_t Recording::started_monotonic_ns() const noexcept { return impl_->started_monotonic_ns; }
bool Recording::complete() const noexcept { return impl_->complete; }
const std::vector<RecordedTopic>& Recording::topics() const noexcept { return impl_->topics; }

const RecordedTopic* Recording::find(std::string_view name) const noexcept {
  const auto found = std::find_if(impl_->topics.begin(), impl_->topics.end(),
                                  [&](const RecordedTopic& topic) { return topic.name == name; });
  return found == impl_->topics.end() ? nullptr : &*found;
}

std::vector<RecordedMark> Recording::marks() const {
  const Handle stamps(H5Dopen2(impl_->file.id(), "marks/stamp_ns", H5P_DEFAULT), &H5Dclose);
  const Handle texts(H5Dopen2(impl_->file.id(), "marks/text", H5P_DEFAULT), &H5Dclose);
  if (!stamps || !texts) return {};
  const hsize_t rows = std::min(shape(stamps.id())[0], shape(texts.id())[0]);
  const Handle type(H5Dget_type(texts.id()), &H5Tclose);
  const std::size_t bytes = text_bytes(type.id());
  if (bytes == 0 || !plausible(texts.id(), type.id()) || !plausible(stamps.id(), H5T_NATIVE_UINT64)) return {};
  std::vector<std::uint64_t> when(rows);
  std::vector<char> what(rows * bytes);
  if (!read_block(stamps.id(), H5T_NATIVE_UINT64, 0, rows, 0, 1, when.data()) ||
      !read_block(texts.id(), type.id(), 0, rows, 0, 1, what.data())) {
    return {};
  }
  std::vector<RecordedMark> marks(rows);
  for (hsize_t i = 0; i < rows; ++i) {
    const char* const text = what.data() + i * bytes;
    marks[i] = {when[i], std::string(text, ::strnlen(text, bytes))};
  }
  return marks;
}

std::vector<ConfigFile> Recording::config() const {
  std::vector<ConfigFile> files;
  const Handle group(H5Gopen2(impl_->file.id(), "config", H5P_DEFAULT), &H5Gclose);
  for (const std::string& name : links(group.id())) {
    const Handle data(H5Dopen2(group.id(), name.c_str(), H5P_DEFAULT), &H5Dclose);
    if (!data) continue;
    const Handle type(H5Dget_type(data.id()), &H5Tclose), space(H5Dget_space(data.id()), &H5Sclose);
    std::string text(is_single(space) ? text_bytes(type.id()) : 0, '\0');
    if (text.empty() || H5Dread(data.id(), type.id(), H5S_ALL, H5S_ALL, H5P_DEFAULT, text.data()) < 0) continue;
    text.resize(std::strlen(text.c_str()));
    files.push_back({text_attribute(data.id(), "path"), std::move(text)});
  }
  return files;
}

std::vector<std::string> Recording::body_names() const {
  if (H5Lexists(impl_->file.id(), "bodies", H5P_DEFAULT) <= 0) return {};
  const Handle data(H5Dopen2(impl_->file.id(), "bodies/name", H5P_DEFAULT), &H5Dclose);
  if (!data) return {};
  const Handle type(H5Dget_type(data.id()), &H5Tclose);
  const std::size_t bytes = text_bytes(type.id());
  if (bytes == 0 || !plausible(data.id(), type.id())) return {};
  const hsize_t rows = shape(data.id())[0];
  std::vector<char> text(rows * bytes);
  if (!read_block(data.id(), type.id(), 0, rows, 0, 1, text.data())) return {};
  std::vector<std::string> names(rows);
  for (hsize_t i = 0; i < rows; ++i) {
    const char* const name = text.data() + i * bytes;
    names[i].assign(name, ::strnlen(name, bytes));
  }
  return names;
}

std::vector<std::string> Recording::commands() const {
  const Handle group(H5Gopen2(impl_->file.id(), "config", H5P_DEFAULT), &H5Gclose);
  const std::string text = group ? text_attribute(group.id(), "commands") : std::string();
  std::vector<std::string> lines;
  for (std::size_t from = 0, to = 0; (to = text.find('\n', from)) != std::string::npos; from = to + 1) {
    lines.push_back(text.substr(from, to - from));
  }
  return lines;
}

std::vector<std::uint64_t> Recording::Impl::numbers(const RecordedTopic& topic, const char* name, std::uint64_t first,
                                                    std::uint64_t count) const {
  std::vector<std::uint64_t> out(rows_from(topic, first, count));
  const Handle data = dataset(topic.name, name);
  if (!data || !read_block(data.id(), H5T_NATIVE_UINT64, first, out.size(), 0, 1, out.data())) out.clear();
  return out;
}

std::vector<std::uint64_t> Recording::stamps_ns(const RecordedTopic& topic, std::uint64_t first,
                                                std::uint64_t count) const {
  return impl_->numbers(topic, "stamp_ns", first, count);
}
std::vector<std::uint64_t> Recording::sequences(const RecordedTopic& topic, std::uint64_t first,
                                                std::uint64_t count) const {
  return impl_->numbers(topic, "sequence", first, count);
}

std::vector<std::uint64_t> Recording::integers(const RecordedTopic& topic, const std::string& field,
                                               std::uint64_t first, std::uint64_t count) const {
  return impl_->numbers(topic, field.c_str(), first, count);
}

std::vector<double> Recording::column(const RecordedTopic& topic, const std::string& field, std::uint32_t element,
                                      std::uint64_t first, std::uint64_t count) const {
  std::vector<double> out(rows_from(topic, first, count));
  const Handle data = impl_->dataset(topic.name, field);
  if (!data || element >= shape(data.id())[1] ||
      !read_block(data.id(), H5T_NATIVE_DOUBLE, first, out.size(), element, 1, out.data())) {
    out.clear();
  }
  return out;
}

std::vector<std::byte> Recording::samples(const RecordedTopic& topic, std::uint64_t first, std::uint64_t count) const {
  const std::uint64_t rows = rows_from(topic, first, count);
  std::vector<std::byte> out(rows * topic.sample_bytes);
  std::vector<std::byte> values;
  for (const Segment::OwnedField& field : topic.fields) {
    const Handle data = impl_->dataset(topic.name, field.name);
    const Handle type(H5Dget_type(data.id()), &H5Tclose);
    const std::size_t bytes = std::size_t{field.count} * field_type_bytes(field.type);
    const hsize_t elements = field.type == FieldType::kText ? 1 : field.count;
    values.resize(rows * bytes);
    if (!data || !read_block(data.id(), type.id(), first, rows, 0, elements, values.data())) return {};
    for (std::uint64_t row = 0; row < rows; ++row) {
      std::memcpy(out.data() + row * topic.sample_bytes + field.offset, values.data() + row * bytes, bytes);
    }
  }
  return out;
}

}  // namespace rtbus::recording
