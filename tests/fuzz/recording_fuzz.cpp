// A recording as somebody may send it: a well-formed HDF5 file whose groups, shapes, types and attributes the input
// chooses. Reading and replaying it ends with values or a Fault. Damage below that, in HDF5's own format, is the
// library's to see (docs/security.md).
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "drivers/device_config.hpp"
#include "drivers/replay/replay_config.hpp"
#include "rtbus/recording/h5.hpp"
#include "rtbus/recording/reader.hpp"
#include "tests/support/temporary_file.hpp"

namespace {

using rtbus::recording::Recording;
using rtbus::recording::h5::Handle;

/// Choices out of the input; zeros when it is used up.
class Choices {
 public:
  Choices(const std::uint8_t* data, std::size_t size) : data_(data), left_(size) {}
  std::uint8_t byte() {
    if (left_ == 0) return 0;
    --left_;
    return *data_++;
  }
  std::size_t below(std::size_t count) { return byte() % count; }
  /// Mostly small, sometimes any of 64 bits.
  std::uint64_t number() {
    const std::uint8_t first = byte();
    if (first < 224) return first % 24;
    std::uint64_t out = 0;
    for (int i = 0; i < 8; ++i) out = out << 8 | byte();
    return out;
  }
  [[nodiscard]] bool over() const { return left_ == 0; }

 private:
  const std::uint8_t* data_;
  std::size_t left_;
};

Handle type_of(Choices& choose) {
  const std::array<hid_t, 8> plain{H5T_NATIVE_DOUBLE, H5T_NATIVE_UINT64, H5T_NATIVE_UINT32, H5T_NATIVE_INT64,
                                   H5T_NATIVE_UINT8,  H5T_NATIVE_FLOAT,  H5T_NATIVE_INT16,  H5T_NATIVE_INT32};
  switch (choose.below(4)) {
    case 0:
      return rtbus::recording::h5::text_type(1 + choose.below(40));
    case 1: {
      Handle type(H5Tcopy(H5T_C_S1), &H5Tclose);
      (void)H5Tset_size(type.id(), choose.below(2) == 0 ? H5T_VARIABLE : std::size_t{1} << choose.below(32));
      return type;
    }
    default:
      return {H5Tcopy(plain[choose.below(plain.size())]), &H5Tclose};
  }
}

Handle space_of(Choices& choose) {
  const int rank = static_cast<int>(choose.below(4));
  if (rank == 0) return {H5Screate(H5S_SCALAR), &H5Sclose};
  std::array<hsize_t, 3> size{};
  for (hsize_t& n : size) n = choose.number();
  return {H5Screate_simple(rank, size.data(), nullptr), &H5Sclose};
}

/// Filled as far as it is small.
void add_attribute(Choices& choose, hid_t object, const char* name) {
  const Handle type = type_of(choose), space = space_of(choose);
  const hssize_t count = H5Sget_simple_extent_npoints(space.id());
  if (count < 0 || count > 64 || H5Tget_size(type.id()) > 4096) return;
  const Handle attribute(H5Acreate2(object, name, type.id(), space.id(), H5P_DEFAULT, H5P_DEFAULT), &H5Aclose);
  if (!attribute || H5Tis_variable_str(type.id()) > 0) return;
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(count) * H5Tget_size(type.id()));
  for (auto& byte : bytes) byte = choose.byte();
  if (!bytes.empty()) (void)H5Awrite(attribute.id(), type.id(), bytes.data());
}

void add_dataset(Choices& choose, hid_t group, const char* name) {
  const Handle type = type_of(choose), space = space_of(choose), settings(H5Pcreate(H5P_DATASET_CREATE), &H5Pclose);
  // Chunked, so that absurd sizes cost nothing to state.
  const int rank = H5Sget_simple_extent_ndims(space.id());
  const std::array<hsize_t, 3> chunk{4, 2, 2};
  if (rank > 0) (void)H5Pset_chunk(settings.id(), rank, chunk.data());
  const Handle data(H5Dcreate2(group, name, type.id(), space.id(), H5P_DEFAULT, settings.id(), H5P_DEFAULT), &H5Dclose);
  if (!data) return;
  const hssize_t count = H5Sget_simple_extent_npoints(space.id());
  if (count > 0 && count < 256 && H5Tget_size(type.id()) < 64 && H5Tis_variable_str(type.id()) == 0) {
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(count) * H5Tget_size(type.id()));
    for (auto& byte : bytes) byte = choose.byte();
    (void)H5Dwrite(data.id(), type.id(), H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data());
  }
  if (choose.below(2) == 0) add_attribute(choose, data.id(), "unit");
  if (choose.below(2) == 0) {
    (void)rtbus::recording::h5::set_attribute(data.id(), "offset", choose.number());
  } else {
    add_attribute(choose, data.id(), "offset");
  }
}

Handle group_in(hid_t at, const char* name) {
  return {H5Gcreate2(at, name, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), &H5Gclose};
}

void make_file(Choices& choose, const std::string& path) {
  const Handle file(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT), &H5Fclose);
  if (choose.below(16) == 0) {
    add_attribute(choose, file.id(), "schema");
  } else {
    (void)rtbus::recording::h5::set_attribute(file.id(), "schema", std::string(rtbus::recording::kSchema));
  }
  for (const char* name : {"session", "version", "started_unix_ns", "ended_unix_ns"}) {
    if (choose.below(4) == 0) add_attribute(choose, file.id(), name);
  }
  const Handle topics = group_in(file.id(), "topics"), topic = group_in(topics.id(), "haptic0.device_state");
  (void)rtbus::recording::h5::set_attribute(topic.id(), "type", std::string("rtbus/DeviceState"));
  if (choose.below(4) == 0) {
    add_attribute(choose, topic.id(), "sample_bytes");
  } else {
    (void)rtbus::recording::h5::set_attribute(topic.id(), "sample_bytes", 544 + choose.number());
  }
  for (const char* name :
       {"stamp_ns", "sequence", "dropped", "position_m", "orientation_wxyz", "buttons", "sample_time_ns", "text"}) {
    if (choose.below(8) != 0) add_dataset(choose, topic.id(), name);
  }
  const Handle marks = group_in(file.id(), "marks"), config = group_in(file.id(), "config"),
               bodies = group_in(file.id(), "bodies");
  add_dataset(choose, marks.id(), "stamp_ns");
  add_dataset(choose, marks.id(), "text");
  add_dataset(choose, config.id(), "0");
  add_attribute(choose, config.id(), "commands");
  add_dataset(choose, bodies.id(), "name");
}

void read_all(const std::string& path) {
  const auto recording = Recording::open(path);
  if (!recording) return;
  (void)recording->marks();
  (void)recording->config();
  (void)recording->body_names();
  (void)recording->commands();
  for (const auto& topic : recording->topics()) {
    constexpr std::uint64_t kSome = 1000;
    (void)recording->stamps_ns(topic, 0, kSome);
    (void)recording->sequences(topic, topic.rows / 2, kSome);
    (void)recording->samples(topic, 0, kSome);
    for (const auto& field : topic.fields) {
      (void)recording->column(topic, field.name, field.count - 1, 0, kSome);
      (void)recording->integers(topic, field.name, 0, kSome);
    }
  }
}

void replay(const tests::TemporaryFolder& folder) {
  static const std::string device =
      folder.write("replay.yaml", "schema: device/1\ndriver: replay\nfile: r.h5\nmodel: phantom_desktop\n");
  try {
    rtbus::config::Map file = rtbus::config::load(device);
    (void)file.text("schema");
    (void)file.text("driver");
    const auto config = drivers::replay::parse(file);
    if (auto opened = config->open({})) {
      drivers::DeviceSample sample;
      (void)(*opened)->start(1000);
      (void)(*opened)->read(2000, sample);
    }
  } catch (const rtbus::config::Error&) {  // the other end that it may have
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const tests::TemporaryFolder folder;
  rtbus::recording::h5::quiet();
  const std::string path = (folder.path() / "r.h5").string();
  Choices choose(data, size);
  make_file(choose, path);
  read_all(path);
  replay(folder);
  return 0;
}
