/// `rtbus plot --signals` on names that have changed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tools/cli/recording/signals.hpp"

namespace {

using testing::HasSubstr;

tools::SignalSource telemetry(const std::string& energy) {
  tools::SignalSource out;
  out.topic = "haptic0.telemetry";
  out.fields.push_back({energy, "J", rtbus::FieldType::kF64, 0, 1});
  return out;
}

TEST(RenamedSignals, AnOldNameIsRefusedWithTheNewOne) {
  const auto signals = tools::choose_signals({telemetry("energy_observed_j")}, {"telemetry.energy_ledger_j"});
  ASSERT_FALSE(signals);
  EXPECT_THAT(signals.error().message, HasSubstr("its name is energy_observed_j"));
}

TEST(RenamedSignals, AnOldRecordingIsReadByTheOldName) {
  EXPECT_TRUE(tools::choose_signals({telemetry("energy_ledger_j")}, {"energy_ledger_j"}));
  const auto signals = tools::choose_signals({telemetry("energy_ledger_j")}, {"energy_observed_j"});
  ASSERT_FALSE(signals);
  EXPECT_THAT(signals.error().message, HasSubstr("its name is energy_ledger_j"));
}

TEST(RenamedSignals, OthersGetTheNearestName) {
  const auto signals = tools::choose_signals({telemetry("energy_observed_j")}, {"energy_obsrved_j"});
  ASSERT_FALSE(signals);
  EXPECT_THAT(signals.error().message, HasSubstr("the nearest name is energy_observed_j"));
}

tools::Signal element(std::uint32_t index, std::size_t recording, std::vector<double> values) {
  tools::Signal out;
  out.topic = "haptic0.telemetry";
  out.field = "force_n";
  out.element = index;
  out.elements = 3;
  out.recording = recording;
  out.value = std::move(values);
  return out;
}

TEST(SilentElements, AreLeftOutWhereTheyAreZeroInEachRecording) {
  std::vector<tools::Signal> signals{element(0, 0, {0, 0}), element(1, 0, {0, 0}), element(2, 0, {0, 1}),
                                     element(0, 1, {0, 0}), element(1, 1, {0, 2}), element(2, 1, {0, 1})};
  tools::leave_out_silent_elements(signals);
  ASSERT_EQ(signals.size(), 4u);
  for (const tools::Signal& signal : signals) EXPECT_NE(signal.element, 0u);
}

TEST(SilentElements, StayWhereTheWholeFieldIsZero) {
  std::vector<tools::Signal> signals{element(0, 0, {0, 0}), element(1, 0, {0, 0})};
  tools::leave_out_silent_elements(signals);
  EXPECT_EQ(signals.size(), 2u) << "that nothing was felt is a result";
}

}  // namespace
