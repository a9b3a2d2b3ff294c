#include "drivers/virtual_vendor/stand_in.hpp"

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include <gtest/gtest.h>

#include "rtbus/clock.hpp"

namespace drivers::virtual_vendor {
namespace {

constexpr std::uint64_t kMs = rtbus::kNsPerMs;

/// A unit whose faults follow a file, and the time as this test lets it pass.
class UnitWithTrigger : public ::testing::Test {
 protected:
  UnitSettings settings_with(UnitSettings settings) {
    settings.mechanics.mass_kg = 0.1;
    settings.trigger = trigger_.string();
    return settings;
  }
  ~UnitWithTrigger() override { std::filesystem::remove(trigger_); }
  void pull() { std::ofstream(trigger_).flush(); }
  void put_back() { std::filesystem::remove(trigger_); }

  const std::filesystem::path trigger_ =
      std::filesystem::path(::testing::TempDir()) / ("trigger" + std::to_string(::getpid()));
  std::uint64_t now_ns_ = 1000 * kMs;
};

TEST_F(UnitWithTrigger, FailsEachTimeItComesAndIsWellBetween) {
  UnitSettings settings;
  settings.unplug_at_s = 0.0;
  Unit unit(settings_with(settings));
  const auto plugged_in = [&] {
    unit.advance_to(now_ns_ += kMs);
    return unit.plugged_in(now_ns_);
  };
  unit.begin(now_ns_);
  EXPECT_TRUE(plugged_in());
  for (int again = 0; again < 3; ++again) {
    pull();
    EXPECT_FALSE(plugged_in());
    EXPECT_FALSE(plugged_in());
    put_back();
    EXPECT_TRUE(plugged_in());
  }
}

TEST_F(UnitWithTrigger, IsLateAndWrongForAsLongAsSaid) {
  UnitSettings settings;
  settings.late_reply = settings.garbage = 1.0;
  settings.late_ms = 7.0;
  settings.for_s = 0.010;
  Unit unit(settings_with(settings));
  const auto wrong = [&] {
    double position[3] = {0.01, 0.02, 0.03};
    unit.spoil(position, now_ns_, 1.0);
    int out = 0;
    for (int i = 0; i < 3; ++i) out += !(std::abs(position[i] - 0.01 * (i + 1)) < 1e-9);
    return out;
  };
  unit.advance_to(now_ns_);
  EXPECT_EQ(unit.late_us(now_ns_), 0.0);
  EXPECT_EQ(wrong(), 0);
  pull();
  unit.advance_to(now_ns_ += kMs);
  EXPECT_EQ(unit.late_us(now_ns_), 7000.0);
  for (int i = 0; i < 9; ++i) EXPECT_EQ(wrong(), 1) << "one coordinate of sample " << i;
  unit.advance_to(now_ns_ += 11 * kMs);
  EXPECT_EQ(unit.late_us(now_ns_), 0.0);
  EXPECT_EQ(wrong(), 0);
}

}  // namespace
}  // namespace drivers::virtual_vendor
