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

}  // namespace
