// The C interface, as a program without our C++ sees it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstring>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "rtbus/c/rtbus.h"
#include "rtbus/c/rtbus_messages.h"
#include "tests/unit/c_api/exported.hpp"

extern "C" size_t rtbus_abi_checked(void);

namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;

struct ReaderCloser {
  void operator()(rtbus_reader* reader) const { rtbus_reader_close(reader); }
};
struct WriterCloser {
  void operator()(rtbus_writer* writer) const { rtbus_writer_close(writer); }
};
using Reader = std::unique_ptr<rtbus_reader, ReaderCloser>;
using Writer = std::unique_ptr<rtbus_writer, WriterCloser>;

/// 24 bytes: a counter and two coordinates.
struct Point {
  std::uint64_t number;
  double position_m[2];
};

rtbus_field field(const char* name, const char* unit, std::uint32_t type, std::uint32_t offset, std::uint32_t count,
                  std::uint32_t inner = 1) {
  rtbus_field out{};
  std::strncpy(out.name, name, sizeof out.name - 1);
  std::strncpy(out.unit, unit, sizeof out.unit - 1);
  out.type = type;
  out.offset = offset;
  out.count = count;
  out.inner = inner;
  return out;
}

class CApi : public testing::Test {
 protected:
  CApi() {
    fields_ = {field("number", "1", RTBUS_U64, 0, 1), field("position_m", "m", RTBUS_F64, 8, 2)};
    type_.struct_bytes = sizeof type_;
    std::strcpy(type_.name, "test/Point");
    type_.bytes = sizeof(Point);
    type_.field_count = 2;
    type_.fields = fields_.data();
    static int count = 0;
    session_ = "capi-" + std::to_string(::getpid()) + "-" + std::to_string(++count);
  }
  Writer write(std::uint32_t capacity = 0) {
    rtbus_writer_options options{};
    options.struct_bytes = sizeof options;
    options.capacity = capacity;
    rtbus_writer* out = nullptr;
    EXPECT_EQ(rtbus_writer_create(session_.c_str(), "points", &type_, &options, &out), RTBUS_OK) << rtbus_last_error();
    return Writer(out);
  }
  Reader read(std::uint32_t flags = 0) {
    rtbus_reader* out = nullptr;
    EXPECT_EQ(rtbus_reader_open(session_.c_str(), "points", flags, &out), RTBUS_OK) << rtbus_last_error();
    return Reader(out);
  }
  int refused_type() {
    rtbus_writer* out = nullptr;
    const int status = rtbus_writer_create(session_.c_str(), "points", &type_, nullptr, &out);
    rtbus_writer_close(out);
    return status;
  }
  static int publish(const Writer& writer, std::uint64_t number) {
    const Point point{number, {0.001 * static_cast<double>(number), -1.0}};
    return rtbus_publish(writer.get(), &point, sizeof point, 0);
  }
  std::string session_;
  std::vector<rtbus_field> fields_;
  rtbus_type type_{};
};

TEST_F(CApi, ExportsExactlyThePinnedSymbols) {
  EXPECT_EQ(tests::exported_by(RTBUS_C_LIBRARY, "RTBUS_1"),
            tests::lines_of(RTBUS_SOURCE_DIR "/tests/unit/c_api/symbols.txt"));
  EXPECT_EQ(rtbus_abi_checked(), sizeof(rtbus_type));
  EXPECT_EQ(rtbus_abi_version(), static_cast<std::uint32_t>(RTBUS_C_ABI_VERSION));
}

TEST_F(CApi, DescribesTheKnownMessagesWithTheirShapes) {
  rtbus_type type{};
  type.struct_bytes = sizeof type;
  ASSERT_EQ(rtbus_known_type("rtbus/BodyPoses", &type), RTBUS_OK);
  ASSERT_EQ(type.field_count, 9U);
  EXPECT_STREQ(type.fields[7].name, "position_m");
  EXPECT_EQ(type.fields[7].count, 192U);
  EXPECT_EQ(type.fields[7].inner, 3U);
  EXPECT_EQ(type.fields[8].inner, 4U);
  EXPECT_EQ(type.bytes, sizeof(rtbus_body_poses));
  EXPECT_STREQ(rtbus_known_type_name(0), "rtbus/DeviceState");
  EXPECT_EQ(rtbus_known_type_name(1000), nullptr);
  EXPECT_EQ(rtbus_known_type("rtbus/Nothing", &type), RTBUS_E_NOT_FOUND);
  EXPECT_THAT(rtbus_last_error(), HasSubstr("rtbus/Nothing"));
  type.struct_bytes = 8;
  EXPECT_EQ(rtbus_known_type("rtbus/BodyPoses", &type), RTBUS_E_ARGUMENT);
}

TEST_F(CApi, WhatIsPublishedIsReadWithItsDescription) {
  const Writer writer = write();
  const Reader reader = read();
  rtbus_type type{};
  type.struct_bytes = sizeof type;
  ASSERT_EQ(rtbus_reader_type(reader.get(), &type), RTBUS_OK);
  EXPECT_STREQ(type.name, "test/Point");
  ASSERT_EQ(type.field_count, 2U);
  EXPECT_STREQ(type.fields[1].unit, "m");
  Point point{};
  rtbus_stamp stamp{};
  EXPECT_EQ(rtbus_read_latest(reader.get(), &point, sizeof point, &stamp), RTBUS_SAME);
  ASSERT_EQ(publish(writer, 7), RTBUS_OK);
  EXPECT_EQ(rtbus_read_latest(reader.get(), &point, sizeof point, &stamp), RTBUS_FRESH);
  EXPECT_EQ(point.number, 7U);
  EXPECT_EQ(stamp.sequence, 1U);
  EXPECT_LE(stamp.stamp_ns, rtbus_now_ns());
  EXPECT_EQ(rtbus_read_latest(reader.get(), &point, sizeof point, &stamp), RTBUS_SAME);
  EXPECT_EQ(rtbus_read_latest(reader.get(), &point, 8, &stamp), RTBUS_E_ARGUMENT);
  EXPECT_EQ(rtbus_writer_alive(reader.get()), 1);
}

TEST_F(CApi, ReadsManyInOneCallAndCountsWhatItMissed) {
  const Writer writer = write(16);
  const Reader reader = read();
  for (std::uint64_t i = 1; i <= 10; ++i) ASSERT_EQ(publish(writer, i), RTBUS_OK);
  std::vector<Point> points(64);
  std::vector<rtbus_stamp> stamps(64);
  ASSERT_EQ(rtbus_read_next(reader.get(), points.data(), 64 * sizeof(Point), stamps.data(), 64), 10);
  EXPECT_EQ(points[9].number, 10U);
  EXPECT_EQ(stamps[9].sequence, 10U);
  EXPECT_EQ(rtbus_missed(reader.get()), 0U);
  for (std::uint64_t i = 11; i <= 100; ++i) ASSERT_EQ(publish(writer, i), RTBUS_OK);
  const int count = rtbus_read_next(reader.get(), points.data(), 64 * sizeof(Point), nullptr, 64);
  ASSERT_GT(count, 4);
  EXPECT_EQ(points[static_cast<std::size_t>(count) - 1].number, 100U);
  EXPECT_EQ(rtbus_missed(reader.get()) + static_cast<std::uint64_t>(count), 90U);
  EXPECT_EQ(rtbus_read_next(reader.get(), points.data(), 8, nullptr, 1), RTBUS_E_ARGUMENT);
}

TEST_F(CApi, WaitWakesForASampleAndEndsAtTheDeadline) {
  const Writer writer = write();
  const Reader reader = read();
  const std::uint64_t began_ns = rtbus_now_ns();
  EXPECT_EQ(rtbus_wait(reader.get(), began_ns + 60'000'000), RTBUS_SAME);
  EXPECT_GE(rtbus_now_ns(), began_ns + 60'000'000);
  std::thread late([&] {
    ::usleep(30'000);
    publish(writer, 1);
  });
  EXPECT_EQ(rtbus_wait(reader.get(), rtbus_now_ns() + 5'000'000'000), RTBUS_FRESH);
  late.join();
}

TEST_F(CApi, PresenceIsSeenByTheWriter) {
  const Writer writer = write();
  EXPECT_EQ(rtbus_observed(writer.get()), 0);
  {
    const Reader reader = read(RTBUS_PRESENCE);
    EXPECT_EQ(rtbus_observed(writer.get()), 1);
  }
  EXPECT_EQ(rtbus_observed(writer.get()), 0);
}

TEST_F(CApi, ANumberThatIsNotFiniteIsRefusedByTheFieldsName) {
  rtbus_type type{};
  type.struct_bytes = sizeof type;
  ASSERT_EQ(rtbus_known_type(rtbus_proxy_state_type, &type), RTBUS_OK);
  rtbus_writer* made = nullptr;
  ASSERT_EQ(rtbus_writer_create(session_.c_str(), "p", &type, nullptr, &made), RTBUS_OK);
  const Writer writer(made);
  rtbus_proxy_state state{};
  state.orientation_wxyz[0] = 1.0;
  state.position_m[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(rtbus_publish(writer.get(), &state, sizeof state, 0), RTBUS_E_VALUE);
  EXPECT_THAT(rtbus_last_error(), HasSubstr("position_m[1] is not finite"));
  state.position_m[1] = 1e30;
  EXPECT_EQ(rtbus_publish(writer.get(), &state, sizeof state, 0), RTBUS_E_VALUE);
  EXPECT_THAT(rtbus_last_error(), HasSubstr("position_m[1] is impossible in a rtbus/ProxyState"));
  state.position_m[1] = 0.0;
  state.device_time_ns = rtbus_now_ns() + 1'000'000'000;
  EXPECT_EQ(rtbus_publish(writer.get(), &state, sizeof state, 0), RTBUS_E_VALUE);
  EXPECT_THAT(rtbus_last_error(), HasSubstr("device_time_ns lies "));
  EXPECT_THAT(rtbus_last_error(), HasSubstr("in the future"));
  state.device_time_ns = 0;
  EXPECT_EQ(rtbus_publish(writer.get(), &state, sizeof state, rtbus_now_ns() + 1'000'000'000), RTBUS_E_VALUE);
  EXPECT_THAT(rtbus_last_error(), HasSubstr("stamp_ns lies "));
  EXPECT_THAT(rtbus_last_error(), HasSubstr("in the future"));
  EXPECT_EQ(rtbus_publish(writer.get(), &state, sizeof state, 0), RTBUS_OK);
  EXPECT_EQ(rtbus_publish(writer.get(), &state, sizeof state - 8, 0), RTBUS_E_ARGUMENT);
}

TEST_F(CApi, ATypeThatCannotBeIsRefusedWithItsField) {
  fields_[1].offset = 12;
  EXPECT_EQ(refused_type(), RTBUS_E_ARGUMENT);
  EXPECT_THAT(rtbus_last_error(), HasSubstr("'position_m' begins at byte 12"));
  fields_[1].offset = 8;
  fields_[1].type = 300;
  EXPECT_EQ(refused_type(), RTBUS_E_ARGUMENT);
  EXPECT_THAT(rtbus_last_error(), HasSubstr("unknown type"));
  fields_[1].type = RTBUS_F64;
  fields_[1].count = 3;
  EXPECT_EQ(refused_type(), RTBUS_E_ARGUMENT);
  EXPECT_THAT(rtbus_last_error(), HasSubstr("do not fit"));
  fields_[1].count = 2;
  fields_[1].inner = 3;
  EXPECT_EQ(refused_type(), RTBUS_E_ARGUMENT);
  EXPECT_THAT(rtbus_last_error(), HasSubstr("no multiple"));
  fields_[1].inner = 1;
  type_.bytes = 32;
  EXPECT_EQ(refused_type(), RTBUS_E_ARGUMENT);
  EXPECT_THAT(rtbus_last_error(), HasSubstr("end at byte 24 of 32"));
}

TEST_F(CApi, FailuresSayWhatAndWhere) {
  rtbus_reader* reader = nullptr;
  EXPECT_EQ(rtbus_reader_open(session_.c_str(), "nothing", 0, &reader), RTBUS_E_NOT_FOUND);
  EXPECT_EQ(reader, nullptr);
  EXPECT_THAT(rtbus_last_error(), HasSubstr("session " + session_ + ", topic nothing"));
  EXPECT_EQ(rtbus_reader_open("No Name", "x", 0, &reader), RTBUS_E_NAME);
  EXPECT_EQ(rtbus_reader_open(nullptr, "x", 0, &reader), RTBUS_E_ARGUMENT);
  EXPECT_EQ(rtbus_read_latest(nullptr, nullptr, 0, nullptr), RTBUS_E_ARGUMENT);
  EXPECT_EQ(rtbus_publish(nullptr, nullptr, 0, 0), RTBUS_E_ARGUMENT);
  const Writer writer = write();
  EXPECT_EQ(refused_type(), RTBUS_E_OWNED);
  for (int status = RTBUS_E_ENDED; status <= RTBUS_REFUSED; ++status) {
    EXPECT_STRNE(rtbus_strerror(status), "unknown status") << status;
  }
  EXPECT_STREQ(rtbus_strerror(-99), "unknown status");
}

TEST_F(CApi, ListsTopicsAlsoForACallerOfAShorterStructure) {
  const Writer writer = write();
  ASSERT_EQ(publish(writer, 1), RTBUS_OK);
  rtbus_topic_info info{};
  ASSERT_EQ(rtbus_list(session_.c_str(), &info, sizeof info, 1), 1);
  EXPECT_STREQ(info.topic, "points");
  EXPECT_STREQ(info.type_name, "test/Point");
  EXPECT_EQ(info.published, 1U);
  EXPECT_EQ(info.writer_alive, 1U);
  EXPECT_EQ(info.writer_pid, static_cast<std::uint32_t>(::getpid()));
  char names[40] = "";
  ASSERT_EQ(rtbus_list(session_.c_str(), reinterpret_cast<rtbus_topic_info*>(names), sizeof names, 1), 1);
  EXPECT_EQ(names, session_);
  EXPECT_EQ(rtbus_list(session_.c_str(), nullptr, 0, 0), 1);
  rtbus_node node{};
  EXPECT_EQ(rtbus_session_nodes(session_.c_str(), &node, sizeof node, 1), RTBUS_E_NOT_FOUND);
}

TEST_F(CApi, AReaderFollowsAWriterThatDiesAndReturns) {
  int ready[2];
  ASSERT_EQ(::pipe(ready), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    const Writer writer = write();
    publish(writer, 1);
    (void)!::write(ready[1], "y", 1);
    for (;;) ::pause();
  }
  char byte = 0;
  ASSERT_EQ(::read(ready[0], &byte, 1), 1);
  const Reader reader = read(RTBUS_FROM_OLDEST);
  Point points[8];
  ASSERT_EQ(rtbus_read_next(reader.get(), points, sizeof points, nullptr, 8), 1);
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
  EXPECT_EQ(rtbus_writer_alive(reader.get()), 0);
  {
    const Writer second = write();  // takes over in place
    ASSERT_EQ(publish(second, 2), RTBUS_OK);
    EXPECT_EQ(rtbus_wait(reader.get(), rtbus_now_ns() + 1'000'000'000), RTBUS_FRESH);
    ASSERT_EQ(rtbus_read_next(reader.get(), points, sizeof points, nullptr, 8), 1);
    EXPECT_EQ(points[0].number, 2U);
  }
  const Writer third = write();  // the second has unlinked it: another segment
  ASSERT_EQ(publish(third, 3), RTBUS_OK);
  EXPECT_EQ(rtbus_wait(reader.get(), rtbus_now_ns() + 1'000'000'000), RTBUS_FRESH);
  ASSERT_EQ(rtbus_read_next(reader.get(), points, sizeof points, nullptr, 8), 1);
  EXPECT_EQ(points[0].number, 3U);
}

TEST_F(CApi, ANewWriterOfAnotherTypeIsToldToTheReader) {
  Writer writer = write();
  const Reader reader = read();
  writer.reset();
  std::strcpy(fields_[0].name, "count");
  writer = write();
  EXPECT_EQ(rtbus_wait(reader.get(), rtbus_now_ns() + 1'000'000'000), RTBUS_E_LAYOUT);
  EXPECT_THAT(rtbus_last_error(), HasSubstr("open the topic again"));
}

TEST_F(CApi, ATopicThatSomebodyDeletedIsMadeAnew) {
  const Writer writer = write();
  const Reader reader = read();
  ASSERT_EQ(::unlink(("/dev/shm/rtbus." + session_ + ".points").c_str()), 0);
  ::usleep(25'000);
  ASSERT_EQ(publish(writer, 1), RTBUS_OK);
  EXPECT_EQ(rtbus_wait(reader.get(), rtbus_now_ns() + 1'000'000'000), RTBUS_FRESH);
  const Reader newcomer = read(RTBUS_FROM_OLDEST);
  Point point{};
  EXPECT_EQ(rtbus_read_next(newcomer.get(), &point, sizeof point, nullptr, 1), 1);
}

TEST_F(CApi, AForkedChildLeavesTheTopicToItsParent) {
  for (const bool closes : {false, true}) {  // what an interpreter does at its end, or a child that lives on
    Writer writer = write();
    const Reader reader = read(RTBUS_PRESENCE);
    const pid_t child = ::fork();
    if (child == 0) {
      const Point point{9, {}};
      (void)rtbus_publish(writer.get(), &point, sizeof point, 0);  // goes nowhere
      if (closes) rtbus_writer_close(writer.release());
      ::pause();
      ::_exit(0);
    }
    ::usleep(50'000);
    ASSERT_EQ(publish(writer, 1), RTBUS_OK);
    Point point{};
    EXPECT_EQ(rtbus_read_latest(reader.get(), &point, sizeof point, nullptr), RTBUS_FRESH);
    EXPECT_EQ(point.number, 1U);
    EXPECT_EQ(::access(("/dev/shm/rtbus." + session_ + ".points").c_str(), F_OK), 0) << "the child has removed it";
    writer.reset();
    EXPECT_EQ(rtbus_writer_alive(reader.get()), 0) << "the child holds the writer's lock";
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
  }
}

}  // namespace
