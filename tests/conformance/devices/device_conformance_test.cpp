// One suite for every registered driver: what drivers/device.hpp promises, looked at from the loop's side. A new driver
// needs one row in kRows (a device that opens without hardware), and is tested.
#include <gtest/gtest.h>

#include <Eigen/Core>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <memory>
#include <new>
#include <optional>
#include <ostream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "drivers/registry/registry.hpp"
#include "rtbus/clock.hpp"
#include "tests/conformance/devices/plant_process.hpp"
#include "tests/support/bare_loops.hpp"
#if RTBUS_WITH_HDF5
#include "tests/support/recording.hpp"
#endif

namespace {
thread_local bool counting_allocations = false;
thread_local int allocations = 0;
}  // namespace

// Every allocation of this program passes here. Not inlined, for GCC would see malloc and free through new and delete
// and warn that they do not match.
#define NOINLINE [[gnu::noinline]]
NOINLINE void* operator new(std::size_t bytes) {
  if (counting_allocations) ++allocations;
  if (void* const memory = std::malloc(bytes == 0 ? 1 : bytes)) return memory;
  throw std::bad_alloc();
}
NOINLINE void* operator new(std::size_t bytes, const std::nothrow_t&) noexcept {
  if (counting_allocations) ++allocations;
  return std::malloc(bytes == 0 ? 1 : bytes);
}
NOINLINE void* operator new[](std::size_t bytes) { return ::operator new(bytes); }
NOINLINE void* operator new[](std::size_t bytes, const std::nothrow_t& tag) noexcept {
  return ::operator new(bytes, tag);
}
NOINLINE void operator delete(void* memory) noexcept { std::free(memory); }
NOINLINE void operator delete[](void* memory) noexcept { std::free(memory); }
NOINLINE void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
NOINLINE void operator delete[](void* memory, std::size_t) noexcept { std::free(memory); }
#undef NOINLINE

namespace drivers::testing {
namespace {

using Eigen::Vector3d;

constexpr std::uint64_t kTickNs = rtbus::kNsPerMs;
// What a speed says is judged where the machine did not pause for longer, at the last of so many tries.
constexpr double kPause_ms = 1.0;
constexpr int kTries = 10;

struct Row {
  const char* driver;
  const char* variant;         // for the name of the test
  const char* device;          // a heavy tip that nobody holds and no weight pulls: what moves it is the force
  double mass_kg;              // of that tip
  bool stepped_clock;          // the device lives in handed-in time alone
  bool own_process;            // needs a plant process
  bool ignores_force = false;  // its motion is what it was
};

void PrintTo(const Row& row, std::ostream* out) { *out << row.driver << " " << row.variant; }

constexpr Row kRows[] = {
    {"simulated", "InTheNode",
     "{schema: device/1, driver: simulated, mechanics: {mass_kg: 1, gravity_m_s2: [0, 0, 0]}}", 1.0, true, false},
    {"simulated", "InItsOwnProcess",
     "{schema: device/1, driver: simulated, process: own, mechanics: {mass_kg: 1, gravity_m_s2: [0, 0, 0]}}", 1.0,
     false, true},
    {"falcon", "Virtual",
     "{schema: device/1, driver: falcon, firmware: synthetic, grip_mass_kg: 0, usb: {virtual: {homing: done, "
     "mechanics: {mass_kg: 4, gravity_m_s2: [0, 0, 0]}}}}",
     4.0, false, false},  // so heavy that a slow machine's ticks do not take it to its end stops
    {"phantom", "Virtual",
     "{schema: device/1, driver: phantom, model: vintage, homing: counters, usb: {virtual: {mechanics: {mass_kg: 1, "
     "viscous_n_s_per_m: 0, coulomb_n: 0}}}}",
     1.0, false, false},
    {"force_dimension", "StandIn",
     "{schema: device/1, driver: force_dimension, model: omega3, virtual: {mechanics: {mass_kg: 1, viscous_n_s_per_m: "
     "0, coulomb_n: 0}}}",
     1.0, false, false},
    {"openhaptics", "StandIn",
     "{schema: device/1, driver: openhaptics, model: touch_x, virtual: {ramp_s: 0, mechanics: {mass_kg: 1, "
     "viscous_n_s_per_m: 0, coulomb_n: 0}}}",
     1.0, false, false},
    {"haply", "StandIn",
     "{schema: device/1, driver: haply, model: inverse3, virtual: {mechanics: {mass_kg: 1, viscous_n_s_per_m: 0, "
     "coulomb_n: 0}}}",
     1.0, false, false},
    {"replay", "OfAHandThatStandsStill", "{schema: device/1, driver: replay, file: RECORDING}", 1.0, true, false, true},
};

// `rtbus conformance MODULE FILE` names a driver from outside the tree; then it is the only row.
const char* foreign_module() { return std::getenv("RTBUS_CONFORMANCE_MODULE"); }
const char* foreign_file() { return std::getenv("RTBUS_CONFORMANCE_DEVICE"); }

// Without the ones whose module was not built.
std::vector<Row> present_rows() {
  std::vector<Row> out;
  if (foreign_module() != nullptr) return {{"module", "", "", 0.0, false, false}};
  for (const Row& row : kRows) {
    for (const DriverEntry& driver : registered_drivers()) {
      if (driver.name == row.driver && driver_present(driver)) out.push_back(row);
    }
  }
  return out;
}

class DeviceConformance : public ::testing::TestWithParam<Row> {
 protected:
  void SetUp() override {
    std::string device = GetParam().device;
#if RTBUS_WITH_HDF5
    if (const auto place = device.find("RECORDING"); place != device.npos) {
      recording_ = std::filesystem::temp_directory_path() / ("rtbus-devtest-" + std::to_string(::getpid()) + ".h5");
      std::filesystem::remove(recording_);
      tests::record_stillness(recording_, 1.0);
      device.replace(place, std::string("RECORDING").size(), recording_);
    }
#endif
    if (foreign_module() != nullptr) {
      device_ = open_foreign();
    } else {
      session_.emplace(device);
      if (GetParam().own_process) plant_.emplace(*session_);
      device_ = session_->open_device();
    }
    ASSERT_NE(device_, nullptr);
    mass_kg_ = foreign_module() != nullptr ? device_->info().apparent_mass_kg : GetParam().mass_kg;
    now_ns_ = rtbus::monotonic_ns();
    housekeeping_ = std::thread([this] {
      while (!done_.load()) {
        if (started_.load()) device_->maintain();
        rtbus::sleep_until(rtbus::monotonic_ns() + 5 * rtbus::kNsPerMs);
      }
    });
  }

  void TearDown() override {
    done_.store(true);
    if (housekeeping_.joinable()) housekeeping_.join();
    device_.reset();
    if (!recording_.empty()) std::filesystem::remove(recording_);
  }

  // Another one of the same kind, at rest.
  void open_anew() {
    TearDown();
    done_.store(false);
    started_.store(false);
    plant_.reset();
    session_.reset();
    SetUp();
  }

  // The device file, with the module as its driver.
  static std::unique_ptr<Device> open_foreign() {
    try {
      auto file = rtbus::config::load(foreign_file(), {{"driver", "{module: " + std::string(foreign_module()) + "}"}});
      const std::unique_ptr<DeviceConfig> config = parse_device(file);
      auto device = config->open({});
      EXPECT_TRUE(device) << device.error().message;
      return device ? std::move(*device) : nullptr;
    } catch (const rtbus::config::Error& error) {
      ADD_FAILURE() << error.what();
      return nullptr;
    }
  }

  void start() {
    now_ns_ = GetParam().stepped_clock ? now_ns_ : rtbus::monotonic_ns();
    const std::uint64_t before_ns = rtbus::monotonic_ns();
    const auto started = device_->start(now_ns_);
    ASSERT_TRUE(started) << started.error().message;
    const std::uint64_t took_ns = GetParam().stepped_clock ? 0 : rtbus::monotonic_ns() - before_ns;
    quickest_start_ns_ = std::min(quickest_start_ns_, took_ns);
    // start() itself may do what maintain() does; the node's housekeeping begins after it.
    started_.store(true);
  }

  void stop() {
    started_.store(false);
    device_->stop();
  }

  // The next cycle begins.
  std::uint64_t tick() {
    now_ns_ += kTickNs;
    if (!GetParam().stepped_clock) {
      rtbus::sleep_until(now_ns_);
      now_ns_ = rtbus::monotonic_ns();
    }
    return now_ns_;
  }

  // Reads this cycle's sample. A process that a busy machine kept waiting is lost for a while, and rightly says so:
  // what lives in real time may try again for two seconds.
  IoStatus read(DeviceSample& sample) {
    IoStatus status = device_->read(now_ns_, sample);
    for (int i = 0; i < 2000 && status == IoStatus::kLost && !GetParam().stepped_clock; ++i) {
      tick();
      status = device_->read(now_ns_, sample);
    }
    return status;
  }

  // Position at the newest sample; fails the test when the device is lost.
  Vector3d position(DeviceSample& sample) {
    const IoStatus status = read(sample);
    EXPECT_TRUE(status == IoStatus::kOk || status == IoStatus::kStale);
    return {sample.position_m[0], sample.position_m[1], sample.position_m[2]};
  }

  // Velocity over the next `ticks` cycles without a write: the median of those over half of them (H. Theil, 1950). An
  // answer that a busy machine fetched late bears too late a time, and would spoil a mean.
  Vector3d coasting_velocity_m_s(int ticks) {
    std::vector<DeviceSample> samples;
    for (int i = 0; i <= ticks; ++i) {
      tick();
      DeviceSample sample;
      position(sample);
      if (samples.empty() || sample.time_ns > samples.back().time_ns) samples.push_back(sample);
    }
    const std::size_t half = samples.size() / 2;
    Vector3d median_m_s = Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());  // fails whatever is asked
    for (int axis = 0; axis < 3 && half > 0; ++axis) {
      std::vector<double> slopes_m_s;
      for (std::size_t i = 0; i + half < samples.size(); ++i) {
        const DeviceSample& from = samples[i];
        const DeviceSample& to = samples[i + half];
        slopes_m_s.push_back((to.position_m[axis] - from.position_m[axis]) /
                             rtbus::seconds_between(from.time_ns, to.time_ns));
      }
      const auto middle = slopes_m_s.begin() + static_cast<std::ptrdiff_t>(slopes_m_s.size() / 2);
      std::nth_element(slopes_m_s.begin(), middle, slopes_m_s.end());
      median_m_s[axis] = *middle;
    }
    return median_m_s;
  }

  // Where a busy machine made the device silent for a while, the force before did not act, and the write says so. As in
  // the loop, each further try is a cycle with a read: what a device in another process does is known by what it tells.
  IoStatus write(const Vec3& force_n) {
    IoStatus status = device_->write(now_ns_, {force_n});
    for (int i = 0; i < 2000 && status == IoStatus::kLost && !GetParam().stepped_clock; ++i) {
      tick();
      DeviceSample sample;
      (void)device_->read(now_ns_, sample);
      status = device_->write(now_ns_, {force_n});
    }
    return status;
  }

  void write_for(int ticks, const Vec3& force_n) {
    for (int i = 0; i < ticks; ++i) {
      tick();
      ASSERT_EQ(write(force_n), IoStatus::kOk);
    }
  }

  // So large that an arm of this mass gets 2 m/s², as 2 N give to 1 kg.
  [[nodiscard]] double gentle_n() const { return std::min(2.0, 2.0 * mass_kg_); }

  // Difference of speed that a measurement over half of 20 ms cannot tell from none; a device without steps leaves
  // rounding.
  [[nodiscard]] double speed_noise_m_s() const { return device_->info().position_quantum_m / 0.010 + 1e-9; }

  /// Of a tip that a gentle force has pushed for 30 ms: it goes at least so fast.
  [[nodiscard]] double acted_m_s() const { return 0.01 * gentle_n() / mass_kg_; }
  /// From one measurement of the speed to the next, a gentle force would have added some 0.04 m/s.
  [[nodiscard]] bool pushed_on(const Vector3d& soon_m_s, const Vector3d& later_m_s) const {
    return !(later_m_s.x() <= soon_m_s.x() + 0.03 * std::abs(soon_m_s.x()) + speed_noise_m_s());
  }

  std::string recording_;  ///< Written for the row that replays one.
  std::optional<SessionFile> session_;
  std::optional<PlantProcess> plant_;
  std::unique_ptr<Device> device_;
  double mass_kg_ = 0.0;  ///< Of its tip.
  std::uint64_t now_ns_ = 0;
  /// How long start() takes where the machine does not pause: none in a process, 0.3 s with a vendor's library.
  std::uint64_t quickest_start_ns_ = std::numeric_limits<std::uint64_t>::max();

 private:
  std::atomic<bool> started_{false};
  std::atomic<bool> done_{false};
  std::thread housekeeping_;
};

TEST_P(DeviceConformance, InfoHasSaneLimits) {
  const DeviceInfo& info = device_->info();
  EXPECT_FALSE(info.model.empty());
  EXPECT_TRUE(info.dof_sensed == 3 || info.dof_sensed == 6);
  EXPECT_EQ(info.dof_actuated, 3);
  EXPECT_GT(info.max_force_n, 0.0);
  EXPECT_LE(info.max_force_n, 100.0);
  EXPECT_GT(info.continuous_force_n, 0.0);
  EXPECT_LE(info.continuous_force_n, info.max_force_n);
  EXPECT_GT(info.thermal_time_constant_s, 0.0);
  EXPECT_GT(info.max_stiffness_n_per_m, 0.0);
  EXPECT_GE(info.max_slew_n_per_ms, 2.0 * info.max_stiffness_n_per_m * 0.6 * 1e-3);
  EXPECT_GE(info.position_quantum_m, 0.0);
  EXPECT_GT(info.apparent_mass_kg, 0.0);
  // Larger than it is, it would allow gains that the device does not bear.
  EXPECT_LE(info.apparent_mass_kg, 1.25 * mass_kg_);
  EXPECT_GE(info.viscous_damping_n_s_per_m, 0.0);
  EXPECT_GE(info.coulomb_friction_n, 0.0);
  EXPECT_GT(info.max_speed_m_s, 0.0);
  EXPECT_GT(info.force_timeout_s, 0.0);
  EXPECT_LE(info.force_timeout_s, 0.1);
  for (std::size_t axis = 0; axis < 3; ++axis) EXPECT_LT(info.workspace_min_m[axis], info.workspace_max_m[axis]);
}

TEST_P(DeviceConformance, IsLostBeforeStartAndAfterStop) {
  DeviceSample sample;
  EXPECT_EQ(device_->read(now_ns_, sample), IoStatus::kLost);
  EXPECT_EQ(device_->write(now_ns_, {}), IoStatus::kLost);
  ASSERT_NO_FATAL_FAILURE(start());
  tick();
  position(sample);
  stop();
  EXPECT_EQ(device_->read(now_ns_, sample), IoStatus::kLost);
  EXPECT_EQ(device_->write(now_ns_, {}), IoStatus::kLost);
}

TEST_P(DeviceConformance, SamplesAreFiniteStampedAndNeverFromTheFuture) {
  ASSERT_NO_FATAL_FAILURE(start());
  std::uint64_t last_ns = 0;
  int fresh = 0;
  for (int i = 0; i < 100; ++i) {
    tick();
    DeviceSample sample;
    const IoStatus status = read(sample);
    ASSERT_TRUE(status == IoStatus::kOk || status == IoStatus::kStale) << "after start() there is a sample";
    fresh += status == IoStatus::kOk;
    for (const double p : sample.position_m) ASSERT_TRUE(std::isfinite(p));
    double norm = 0.0;
    for (const double q : sample.orientation_wxyz) norm += q * q;
    ASSERT_NEAR(norm, 1.0, 1e-6) << "orientation_wxyz is no unit quaternion";
    ASSERT_LE(sample.time_ns, now_ns_) << "measured in the future";
    ASSERT_GT(sample.time_ns + 100 * rtbus::kNsPerMs, now_ns_)
        << "measured 100 ms ago or never: start() returns when there is a first sample, and none from before it is "
           "left";
    ASSERT_GE(sample.time_ns, last_ns) << "older than the sample before";
    last_ns = sample.time_ns;
    ASSERT_EQ(write({}), IoStatus::kOk);
  }
  EXPECT_GT(fresh, 0) << "read() never said kOk";
  EXPECT_EQ(device_->clamped(), 0u);
}

TEST_P(DeviceConformance, ClampsTheForceKeepsItsDirectionAndCounts) {
  ASSERT_NO_FATAL_FAILURE(start());
  DeviceSample before;
  tick();
  const Vector3d from = position(before);
  const double limit_n = device_->info().max_force_n;
  const std::uint64_t first_write_ns = now_ns_;
  // A slow machine's ticks are longer: it must not push so long that the tip meets its end stops. 30 mm from rest.
  const double longest_s = std::min(0.060, std::sqrt(2.0 * 0.030 * mass_kg_ / limit_n));
  std::uint64_t writes = 0;
  for (; writes < 60 && now_ns_ < first_write_ns + rtbus::ns_of(longest_s); ++writes) {
    ASSERT_NO_FATAL_FAILURE(write_for(1, {0.6 * 1000.0 * limit_n, -0.8 * 1000.0 * limit_n, 0.0}));
  }
  EXPECT_EQ(device_->clamped(), writes);
  if (GetParam().ignores_force) return;
  DeviceSample after;
  tick();
  const Vector3d way = position(after) - from;
  EXPECT_NEAR(way.normalized().dot(Vector3d(0.6, -0.8, 0.0)), 1.0, 1e-3);
  const double time_s = rtbus::seconds_between(first_write_ns, after.time_ns);
  EXPECT_LE(way.norm(), 1.02 * 0.5 * limit_n / mass_kg_ * time_s * time_s + 4 * device_->info().position_quantum_m);
}

TEST_P(DeviceConformance, AcceptsTheLimitItselfUncounted) {
  ASSERT_NO_FATAL_FAILURE(start());
  const double limit_n = device_->info().max_force_n;
  write_for(3, {limit_n / std::sqrt(3.0), -limit_n / std::sqrt(3.0), limit_n / std::sqrt(3.0)});
  EXPECT_EQ(device_->clamped(), 0u);
}

TEST_P(DeviceConformance, TakesANonFiniteForceAsZeroAndCounts) {
  ASSERT_NO_FATAL_FAILURE(start());
  DeviceSample sample;
  tick();
  const Vector3d from = position(sample);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  write_for(10, {nan, 5.0, 5.0});
  write_for(10, {0.0, nan, 0.0});  // where std::hypot of three gives 0
  write_for(20, {5.0, std::numeric_limits<double>::infinity(), 5.0});
  EXPECT_EQ(device_->clamped(), 40u);
  tick();
  EXPECT_LE((position(sample) - from).norm(), 2 * device_->info().position_quantum_m);
}

TEST_P(DeviceConformance, ForceEndsByItselfWhenWritesStop) {
  if (GetParam().ignores_force) GTEST_SKIP() << "no force of this device acts on anything";
  Vector3d soon = Vector3d::Zero(), later = Vector3d::Zero();
  std::string machine;
  auto judged = tests::Judged::kPaused;
  for (int i = 0; i < kTries && judged == tests::Judged::kPaused; ++i) {
    if (i > 0) open_anew();
    ASSERT_NO_FATAL_FAILURE(start());
    judged = tests::judge_when_quiet(tests::BareScheduling::kOrdinary, kPause_ms, 1, machine, [&] {
      write_for(30, {gentle_n(), 0.0, 0.0});
      const int timeout_ticks = static_cast<int>(device_->info().force_timeout_s * 1e3) + 2;
      for (int tick_number = 0; tick_number < timeout_ticks && !HasFailure(); ++tick_number) {
        tick();
        DeviceSample sample;
        position(sample);
      }
      soon = coasting_velocity_m_s(20);
      later = coasting_velocity_m_s(20);
      return (soon.x() > acted_m_s() && !pushed_on(soon, later)) || HasFailure();
    });
  }
  if (judged == tests::Judged::kPaused) GTEST_SKIP() << soon.x() << " m/s, then " << later.x() << "; " << machine;
  EXPECT_GT(soon.x(), acted_m_s());
  EXPECT_FALSE(pushed_on(soon, later)) << soon.x() << " m/s, then " << later.x()
                                       << ": a force acts for longer than force_timeout_s";
}

TEST_P(DeviceConformance, StopIsIdempotentAndLeavesNoForce) {
  ASSERT_NO_FATAL_FAILURE(start());
  write_for(1, {std::numeric_limits<double>::quiet_NaN(), 0.0, 0.0});
  EXPECT_EQ(device_->clamped(), 1u);
  // A force that ends by its time-out is seen in the first 30 ms alone; the mechanics' own damping hides it later.
  constexpr double kSeenS = 0.030;
  Vector3d soon = Vector3d::Zero(), later = Vector3d::Zero();
  std::string machine;
  const auto judged = tests::judge_when_quiet(tests::BareScheduling::kOrdinary, kPause_ms, kTries, machine, [&] {
    write_for(30, {gentle_n(), 0.0, 0.0});
    stop();
    stop();
    start();  // and it may be started again
    if (HasFailure()) return true;
    EXPECT_EQ(device_->clamped(), 0u) << "clamped() counts since start()";
    const std::uint64_t started_ns =
        now_ns_ + quickest_start_ns_;  // a pause within start() counts as time of the force
    soon = coasting_velocity_m_s(20);
    const double soon_s = rtbus::seconds_between(started_ns, now_ns_);
    later = coasting_velocity_m_s(20);
    const double later_s = rtbus::seconds_between(started_ns, now_ns_);
    return (soon_s <= kSeenS && later_s <= 2.0 * kSeenS && !pushed_on(soon, later)) || HasFailure();
  });
  if (judged == tests::Judged::kPaused) GTEST_SKIP() << soon.x() << " m/s, then " << later.x() << "; " << machine;
  EXPECT_FALSE(pushed_on(soon, later)) << soon.x() << " m/s, then " << later.x()
                                       << ": a force, or a sample, from before stop() was still there after start()";
}

TEST_P(DeviceConformance, ReadAndWriteDoNotAllocate) {
  // A device that does not answer for 20 ms is lost. One thread or two may have waited for that.
  constexpr double kLate_ms = 10.0;
  const tests::BareLoops machine(tests::BareScheduling::kOrdinary, kLate_ms);
  ASSERT_NO_FATAL_FAILURE(start());
  int bad = 0;
  allocations = 0;
  counting_allocations = true;
  ::operator delete(::operator new(8));  // shows that the counter counts; a new-expression could be optimised away
  for (int i = 0; i < 200 && bad == 0; ++i) {
    tick();
    DeviceSample sample;
    bad += read(sample) == IoStatus::kLost;
    bad += write({0.1, 1e9, 0.0}) != IoStatus::kOk;
  }
  counting_allocations = false;
  EXPECT_EQ(allocations, 1);
  // A paused machine loses a device whose other end is a thread or a process beside.
  if (bad > 0 && machine.pauses() > 0 && !GetParam().stepped_clock && !HasFailure()) GTEST_SKIP() << machine.text();
  EXPECT_EQ(bad, 0);
}

// Half of the calls, so that a busy machine does not count: the loop has a millisecond for everything.
TEST_P(DeviceConformance, ReadAndWriteAreQuick) {
  ASSERT_NO_FATAL_FAILURE(start());
  std::vector<std::uint64_t> took_ns;
  for (int i = 0; i < 101; ++i) {
    tick();
    DeviceSample sample;
    const std::uint64_t before_ns = rtbus::monotonic_ns();
    (void)device_->read(now_ns_, sample);
    (void)device_->write(now_ns_, {});
    took_ns.push_back(rtbus::monotonic_ns() - before_ns);
  }
  std::nth_element(took_ns.begin(), took_ns.begin() + 50, took_ns.end());
  EXPECT_LT(took_ns[50], 300'000u) << "ns for one read and one write: they wait or compute for too long";
}

// Of five, the quickest: a wait that sleeps beyond its deadline does so each time.
TEST_P(DeviceConformance, WaitEndsAtItsDeadline) {
  if (!device_->info().can_pace_loop) GTEST_SKIP() << "clock: device is not possible with this driver";
  ASSERT_NO_FATAL_FAILURE(start());
  std::uint64_t late_ns = ~std::uint64_t{0};
  for (int i = 0; i < 5; ++i) {
    const std::uint64_t deadline_ns = rtbus::monotonic_ns() + 200'000;
    (void)device_->wait_sample(deadline_ns);
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    late_ns = std::min(late_ns, now_ns > deadline_ns ? now_ns - deadline_ns : 0);
  }
  EXPECT_LT(late_ns, 5 * rtbus::kNsPerMs) << "wait_sample() sleeps beyond its deadline";
}

TEST_P(DeviceConformance, WaitBringsAFreshSampleOrEndsAtItsDeadline) {
  if (!device_->info().can_pace_loop) GTEST_SKIP() << "clock: device is not possible with this driver";
  EXPECT_EQ(device_->wait_sample(rtbus::monotonic_ns()), IoStatus::kLost);
  now_ns_ = rtbus::monotonic_ns();
  ASSERT_NO_FATAL_FAILURE(start());
  std::uint64_t last_ns = 0;
  for (int i = 0; i < 20; ++i) {
    ASSERT_EQ(device_->wait_sample(rtbus::monotonic_ns() + rtbus::kNsPerS), IoStatus::kOk);
    DeviceSample sample;
    ASSERT_EQ(device_->read(rtbus::monotonic_ns(), sample), IoStatus::kOk);
    ASSERT_GT(sample.time_ns, last_ns);
    last_ns = sample.time_ns;
  }
  // A deadline that has passed: at once, with the sample that may have come meanwhile or without.
  const IoStatus status = device_->wait_sample(rtbus::monotonic_ns() - rtbus::kNsPerS);
  EXPECT_TRUE(status == IoStatus::kTimeout || status == IoStatus::kOk);
}

INSTANTIATE_TEST_SUITE_P(Drivers, DeviceConformance, ::testing::ValuesIn(present_rows()),
                         [](const ::testing::TestParamInfo<Row>& row) {
                           return std::string(row.param.driver) + row.param.variant;
                         });

TEST(Registry, EveryDriverIsInThisSuite) {
  for (const DriverEntry& driver : registered_drivers()) {
    if (!driver_present(driver)) continue;  // its module was not built
    EXPECT_TRUE(
        std::any_of(std::begin(kRows), std::end(kRows), [&](const Row& row) { return driver.name == row.driver; }))
        << driver.name << " has no row in kRows";
    EXPECT_FALSE(driver.description.empty());
  }
}

}  // namespace
}  // namespace drivers::testing
