/// A recorded hand's motion, replayed under the simulated clock: the same method gives the same force to the last bit,
/// another one gives its own force on the same motion.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#if RTBUS_WITH_HDF5
#include "tests/support/bad_config.hpp"
#include "tests/support/recording.hpp"
#include "tests/support/temporary_file.hpp"
#include "tools/harness/harness.hpp"

namespace {

using rtbus::Telemetry;
using tools::Harness;

class Replay : public testing::Test {
 protected:
  /// Runs a session for three seconds. @param recording File that takes its motion; empty: none.
  std::vector<Telemetry> run(const std::string& session, const std::vector<std::string>& assignments,
                             const std::string& recording = "") {
    std::vector<rtbus::config::Override> overrides;
    for (const std::string& text : assignments) overrides.push_back(rtbus::config::parse_override(text));
    auto settings =
        rtbus::config::load_session(std::string(RTBUS_SOURCE_DIR) + "/config/" + session + ".yaml", overrides);
    Harness harness(settings, {});
    std::optional<rtbus::recording::Writer> writer;
    std::size_t states = 0, ticks = 0;
    if (!recording.empty()) {
      rtbus::recording::Metadata about;
      about.session = session;
      auto created = rtbus::recording::Writer::create(recording, about);
      if (!created) throw std::runtime_error(created.error().message);
      writer.emplace(std::move(*created));
      states = *writer->add_topic("haptic0.device_state", tests::description_of<rtbus::DeviceState>());
      ticks = *writer->add_topic("haptic0.telemetry", tests::description_of<Telemetry>());
    }
    std::vector<Telemetry> out;
    harness.run(3.0, [&](const Telemetry& tick) {
      out.push_back(tick);
      if (!writer) return;
      writer->append(states, tick.tick, tick.device_time_ns, tests::bytes_of(harness.device_state()));
      writer->append(ticks, tick.tick, tick.device_time_ns, tests::bytes_of(tick));
    });
    if (writer) {
      EXPECT_TRUE(writer->close());
    }
    return out;
  }
  [[nodiscard]] std::string file() const { return folder_.path() / "motion.h5"; }
  [[nodiscard]] std::vector<std::string> replayed(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> out{"haptic.0.device=devices/replay.yaml", "haptic.0.device.file=" + file()};
    out.insert(out.end(), more.begin(), more.end());
    return out;
  }

  tests::TemporaryFolder folder_;
};

bool same_bits(const rtbus::Vec3& a, const rtbus::Vec3& b) { return std::memcmp(a.data(), b.data(), sizeof a) == 0; }

TEST_F(Replay, GivesTheForceOfEveryTickToTheLastBit) {
  for (const char* session : {"drop", "wall"}) {  // direct, and remote_virtual_coupling through physics
    std::filesystem::remove(file());
    const auto first = run(session, {}, file());
    const auto again = run(session, replayed());
    ASSERT_EQ(first.size(), again.size());
    std::size_t in_contact = 0;
    for (std::size_t i = 0; i < first.size(); ++i) {
      ASSERT_TRUE(same_bits(first[i].position_m, again[i].position_m)) << session << " tick " << i;
      ASSERT_TRUE(same_bits(first[i].velocity_m_s, again[i].velocity_m_s)) << session << " tick " << i;
      ASSERT_TRUE(same_bits(first[i].rendered_force_n, again[i].rendered_force_n)) << session << " tick " << i;
      ASSERT_TRUE(same_bits(first[i].force_n, again[i].force_n)) << session << " tick " << i;
      in_contact += first[i].force_n[1] > 0.1;
    }
    EXPECT_GT(in_contact, 500u) << session;  // there was something to reproduce
  }
}

TEST_F(Replay, ComparesMethodsOnTheSameMotion) {
  const auto first = run("wall", {}, file());
  const auto stiffer = run("wall", replayed({"haptic.0.coupling.stiffness_n_per_m=300"}));
  ASSERT_EQ(first.size(), stiffer.size());
  std::size_t other_force = 0;
  for (std::size_t i = 0; i < first.size(); ++i) {
    ASSERT_TRUE(same_bits(first[i].position_m, stiffer[i].position_m)) << i;
    other_force += !same_bits(first[i].force_n, stiffer[i].force_n);
  }
  EXPECT_GT(other_force, 500u);
}

TEST_F(Replay, EndsAtZeroForceWhenTheMotionEnds) {
  (void)run("drop", {}, file());
  const auto ticks = run("drop", replayed({"haptic.0.device.to_s=2"}));
  EXPECT_GT(ticks[1900].force_n[1], 0.1);
  for (std::size_t i = 2100; i < ticks.size(); ++i) ASSERT_EQ(ticks[i].force_n, rtbus::Vec3{}) << i;
}

class BadReplay : public testing::TestWithParam<tests::BadConfig> {};
TEST_P(BadReplay, IsRefusedWithItsReason) {
  EXPECT_TRUE(tests::fails_as_expected(GetParam(), [](const std::string& file, const auto& overrides) {
    rtbus::config::Map map = rtbus::config::load(file, overrides);
    (void)drivers::parse_device(map);
  }));
}
INSTANTIATE_TEST_SUITE_P(Files, BadReplay, testing::ValuesIn(tests::bad_configs("replay")), tests::bad_config_name);

TEST_F(Replay, RefusesWhatTheRecordingDoesNotHold) {
  tests::record_stillness(file(), 0.1);
  const auto refusal = [&](const std::string& line) -> std::string {
    const std::string device =
        folder_.write("device.yaml", "schema: device/1\ndriver: replay\nfile: " + file() + "\n" + line + "\n");
    try {
      rtbus::config::Map map = rtbus::config::load(device, {});
      (void)drivers::parse_device(map);
    } catch (const rtbus::config::Error& error) {
      return error.what();
    }
    return "was accepted";
  };
  EXPECT_EQ(refusal("topic: haptic0"), "was accepted");
  EXPECT_THAT(refusal("topic: haptic7"), testing::HasSubstr("device.yaml:4: topic = \"haptic7\" cannot be replayed"));
  EXPECT_THAT(refusal("topic: haptic7"), testing::HasSubstr("haptic0.device_state"));
  EXPECT_THAT(refusal("tpoic: haptic0"), testing::HasSubstr("topic"));
  EXPECT_THAT(refusal("tpoic: haptic0"), testing::HasSubstr("device.yaml:4"));
}

}  // namespace
#endif
