#pragma once
/// @file nodes.hpp
/// The nodes of one session as processes of this build, without a supervisor, observed over the bus.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/messages.hpp"
#include "rtbus/topic.hpp"
#include "tests/support/process.hpp"

namespace tests {

using rtbus::Reader;
using rtbus::ReadStatus;
using rtbus::Stamped;
using rtbus::Telemetry;

inline double norm(const rtbus::Vec3& v) { return std::hypot(v[0], v[1], v[2]); }

/// One session with nodes of this build, observed.
class Nodes : public testing::Test {
 protected:
  void SetUp() override {
    const auto* const test = testing::UnitTest::GetInstance()->current_test_info();
    bus_.name = std::string(test->name()).substr(0, 20) + std::to_string(getpid());
    std::transform(bus_.name.begin(), bus_.name.end(), bus_.name.begin(), ::tolower);
  }
  void TearDown() override {
    haptic_.reset();
    physics_.reset();
    plant_.reset();
    Child clean({binary("rtbus"), "clean", "--session", bus_.name}, "/dev/null");
    clean.wait();
    EXPECT_EQ(segments_of(bus_.name), std::vector<std::string>{});
  }

  static std::string binary(const std::string& name) { return std::string(RTBUS_BINARY_DIR) + "/" + name; }
  std::vector<std::string> command(const std::string& program, std::vector<std::string> more = {}) {
    std::vector<std::string> out{binary(program), "--config",
                                 std::string(RTBUS_SOURCE_DIR) + "/config/" + session_file_, "--set",
                                 "session=" + bus_.name};
    out.insert(out.end(), more.begin(), more.end());
    return out;
  }
  void start_physics() { physics_.emplace(command("physics_node"), "/dev/null"); }
  void start_haptic() { haptic_.emplace(command("haptic_node"), "/dev/null"); }
  void start_plant() { plant_.emplace(command("simulated_plant", {"--node", "haptic0"}), "/dev/null"); }

  template <class T>
  std::optional<Reader<T>> reader(const std::string& topic) {
    std::optional<Reader<T>> out;
    eventually(5.0, [&] {
      auto opened = Reader<T>::open(bus_, topic, {.presence = true});
      if (opened) out.emplace(std::move(*opened));
      return out.has_value() && out->writer_alive();
    });
    return out;
  }

  /// Follows the telemetry until `condition(tick)`; false after `timeout_s`.
  template <class Condition>
  bool follow(Reader<Telemetry>& ticks, double timeout_s, Condition condition) {
    bool met = false;
    return eventually(timeout_s, [&] {
      Stamped<Telemetry> tick;
      while (!met && ticks.read_next(tick) == ReadStatus::kFresh) met = condition(tick);
      return met;
    });
  }

  rtbus::Session bus_;
  std::string session_file_ = "wall.yaml";
  std::optional<Child> physics_, haptic_, plant_;
};

}  // namespace tests
