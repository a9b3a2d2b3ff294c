// Recordings that somebody has made up: sizes, shapes and types that the format allows and a recorder never writes.
// Found by reading the code for tests/fuzz/recording_fuzz.cpp, and by that: they wrote beyond a variable, asked for
// terabytes or copied from nowhere.
#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "rtbus/recording/h5.hpp"
#include "rtbus/recording/reader.hpp"
#include "tests/support/temporary_file.hpp"

namespace {

using rtbus::recording::Recording;
using rtbus::recording::h5::Handle;
using rtbus::recording::h5::set_attribute;
using rtbus::recording::h5::text_type;

class HostileRecording : public testing::Test {
 protected:
  HostileRecording() {
    rtbus::recording::h5::quiet();
    (void)set_attribute(file_.id(), "schema", std::string(rtbus::recording::kSchema));
    (void)set_attribute(topic_.id(), "type", std::string("rtbus/DeviceState"));
  }
  static Handle group(hid_t at, const char* name) {
    return {H5Gcreate2(at, name, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), &H5Gclose};
  }
  static Handle rows(hsize_t count) { return {H5Screate_simple(1, &count, nullptr), &H5Sclose}; }
  /// Of many values where the reader has room for one.
  static void many_numbers(hid_t object, const char* name) {
    const std::vector<unsigned long long> values(4096, ~0ULL);
    const Handle space = rows(values.size() / 8);  // an attribute holds at most 64 KiB
    const Handle attribute(H5Acreate2(object, name, H5T_NATIVE_ULLONG, space.id(), H5P_DEFAULT, H5P_DEFAULT),
                           &H5Aclose);
    ASSERT_GE(H5Awrite(attribute.id(), H5T_NATIVE_ULLONG, values.data()), 0);
  }
  static Handle dataset(hid_t at, const char* name, hid_t type, const Handle& space) {
    const Handle settings(H5Pcreate(H5P_DATASET_CREATE), &H5Pclose);
    const std::array<hsize_t, 1> chunk{16};
    (void)H5Pset_chunk(settings.id(), 1, chunk.data());
    return {H5Dcreate2(at, name, type, space.id(), H5P_DEFAULT, settings.id(), H5P_DEFAULT), &H5Dclose};
  }
  void add_rows_of_nothing(const char* name, hsize_t count) {
    const std::array<hsize_t, 2> size{count, 0};
    const Handle space(H5Screate_simple(2, size.data(), nullptr), &H5Sclose);
    const Handle data(
        H5Dcreate2(topic_.id(), name, H5T_NATIVE_UINT64, space.id(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), &H5Dclose);
    ASSERT_TRUE(data);
    (void)set_attribute(data.id(), "offset", 0);
  }
  auto read() {
    topic_ = {};
    topics_ = {};
    file_ = {};
    return Recording::open(path_);
  }

  tests::TemporaryFolder folder_;
  std::string path_ = (folder_.path() / "r.h5").string();
  Handle file_{H5Fcreate(path_.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT), &H5Fclose};
  Handle topics_ = group(file_.id(), "topics");
  Handle topic_ = group(topics_.id(), "haptic0.device_state");
};

TEST_F(HostileRecording, AnAttributeOfManyValuesIsNone) {
  many_numbers(file_.id(), "started_unix_ns");
  many_numbers(topic_.id(), "sample_bytes");
  const auto recording = read();
  ASSERT_TRUE(recording) << recording.error().message;
  EXPECT_EQ(recording->started_unix_ns(), 0u);
}

TEST_F(HostileRecording, ATextOfManyRowsIsNone) {
  const Handle type = text_type(8), space = rows(500);
  const std::vector<char> text(std::size_t{8} * 500, 'x');
  const Handle attribute(H5Acreate2(file_.id(), "session", type.id(), space.id(), H5P_DEFAULT, H5P_DEFAULT), &H5Aclose);
  ASSERT_GE(H5Awrite(attribute.id(), type.id(), text.data()), 0);
  const auto recording = read();
  ASSERT_TRUE(recording);
  EXPECT_EQ(recording->session(), "");
}

TEST_F(HostileRecording, ManyCountsOfDroppedSamplesAreNone) {
  (void)set_attribute(topic_.id(), "sample_bytes", 544);
  {
    const std::vector<std::uint64_t> values(4096, ~0ULL);
    const Handle space = rows(values.size()), data = dataset(topic_.id(), "dropped", H5T_NATIVE_UINT64, space);
    ASSERT_GE(H5Dwrite(data.id(), H5T_NATIVE_UINT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()), 0);
  }
  const auto recording = read();
  ASSERT_TRUE(recording);
  EXPECT_EQ(recording->topics().at(0).dropped, 0u);
}

TEST_F(HostileRecording, MoreRowsThanTheFileCanHoldAreDamage) {
  (void)set_attribute(topic_.id(), "sample_bytes", 544);
  { const Handle data = dataset(topic_.id(), "stamp_ns", H5T_NATIVE_UINT64, rows(hsize_t{1} << 50)); }
  const auto recording = read();
  ASSERT_FALSE(recording);
  EXPECT_NE(recording.error().message.find("haptic0.device_state is damaged"), std::string::npos);
}

TEST_F(HostileRecording, ASampleOfGigabytesIsDamage) {
  (void)set_attribute(topic_.id(), "sample_bytes", 4'000'000'000ULL);
  EXPECT_FALSE(read());
}

TEST_F(HostileRecording, AFieldOfNoElementsIsDamage) {
  (void)set_attribute(topic_.id(), "sample_bytes", 544);
  add_rows_of_nothing("position_m", 3);
  EXPECT_FALSE(read());
}

TEST_F(HostileRecording, ManyRowsOfNoElementsAreDamage) {
  (void)set_attribute(topic_.id(), "sample_bytes", 544);
  add_rows_of_nothing("stamp_ns", hsize_t{1} << 62);
  EXPECT_FALSE(read());
}

TEST_F(HostileRecording, ConfigurationFilesThatAreNoTextAreLeftOut) {
  {
    const Handle config = group(file_.id(), "config");
    const Handle type(H5Tcopy(H5T_C_S1), &H5Tclose);
    (void)H5Tset_size(type.id(), H5T_VARIABLE);
    const Handle text = dataset(config.id(), "0", type.id(), rows(3));
    const Handle numbers = dataset(config.id(), "1", H5T_NATIVE_UINT64, rows(400));
    const Handle inner = group(config.id(), "2");
  }
  const auto recording = read();
  ASSERT_TRUE(recording);
  EXPECT_TRUE(recording->config().empty());
}

TEST_F(HostileRecording, MarksWithoutTextOrWithoutEndAreNone) {
  {
    const Handle marks = group(file_.id(), "marks");
    const Handle stamps = dataset(marks.id(), "stamp_ns", H5T_NATIVE_UINT64, rows(hsize_t{1} << 50));
    const Handle type(H5Tcopy(H5T_C_S1), &H5Tclose);
    (void)H5Tset_size(type.id(), H5T_VARIABLE);
    const Handle texts = dataset(marks.id(), "text", type.id(), rows(hsize_t{1} << 50));
  }
  const auto recording = read();
  ASSERT_TRUE(recording);
  EXPECT_TRUE(recording->marks().empty());
}

}  // namespace
