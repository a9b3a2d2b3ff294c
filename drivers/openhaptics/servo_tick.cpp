// What runs on the vendor's servo thread: no lock, no allocation, one bounded wait.
#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "drivers/openhaptics/servo_device.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/realtime.hpp"

namespace drivers::openhaptics {
namespace {

constexpr int kZerosAtTheEnd = 5;
/// A force error that repeats for so long does not cure itself.
constexpr std::uint64_t kForceErrorPatienceNs = rtbus::kNsPerS;
/// Without one for so long the library has its force back.
constexpr std::uint64_t kForceErrorOverNs = 100 * rtbus::kNsPerMs;
constexpr double kFarthest_mm = 2000.0;
constexpr std::uint32_t kDockedBit = 1u << 8;

}  // namespace

std::uint32_t ServoDevice::servo_callback(void* self) { return static_cast<ServoDevice*>(self)->tick(); }

void ServoDevice::note_error(const ErrorInfo& error, std::uint64_t now_ns) noexcept {
  const ErrorKind kind = kind_of(error.code);
  if (kind == ErrorKind::kNone) return;
  last_error_.store(std::uint64_t{error.code} << 32 | static_cast<std::uint32_t>(error.internal_code));
  if (kind == ErrorKind::kWarm) io::bump(warm_);
  if (kind == ErrorKind::kDevice && !device_lost_) {
    device_lost_ = true;
    io::bump(losses_);
  }
  if (kind != ErrorKind::kForce) return;
  io::bump(force_errors_);
  port_.withhold();  // the loop's force returns by its ramp
  if (force_error_since_ns_ == 0 || now_ns > force_error_ns_ + kForceErrorOverNs) force_error_since_ns_ = now_ns;
  force_error_ns_ = now_ns;
}

// False: a pose that no arm can have.
bool ServoDevice::measure(DeviceSample& out) noexcept {
  double t[16] = {};
  hd_.hdGetDoublev(kTransform, t);
  int buttons = 0;
  hd_.hdGetIntegerv(kButtons, &buttons);
  double v[3] = {};
  hd_.hdGetDoublev(kVelocity, v);
  unsigned char out_of_inkwell = 1;
  hd_.hdGetBooleanv(kInkwellSwitch, &out_of_inkwell);
  for (std::size_t i = 0; i < 3; ++i) {
    const double mm = t[12 + i];
    if (!std::isfinite(mm) || std::abs(mm) > kFarthest_mm || !std::isfinite(v[i])) return false;
    out.position_m[i] = 1e-3 * (mm - origin_mm_[i]);
    out.velocity_m_s[i] = 1e-3 * v[i];
  }
  Eigen::Matrix3d turn;
  for (int column = 0; column < 3; ++column) {
    for (int row = 0; row < 3; ++row) turn(row, column) = t[4 * column + row];
  }
  if (!turn.allFinite() || std::abs(turn.determinant() - 1.0) > 0.05) return false;
  const Eigen::Quaterniond q = Eigen::Quaterniond(turn).normalized();
  out.orientation_wxyz = {q.w(), q.x(), q.y(), q.z()};
  out.buttons = (static_cast<std::uint32_t>(buttons) & 0xfu) | (out_of_inkwell == 0 ? kDockedBit : 0u);
  return true;
}

std::uint32_t ServoDevice::tick() noexcept {
  const std::uint64_t number = ticks_.load(std::memory_order_relaxed);
  if (number == 0) {
    // Once: the thread is the vendor's, and its priority is not known.
    (void)rtbus::enter_realtime(
        {.priority = settings_.priority, .core = settings_.core, .lock_memory = false, .hold_dma_latency = false});
  }
  // Before the pose is read: one from before a calibration must not count as one after it.
  const bool calibrated = calibrated_.load(std::memory_order_acquire);
  hd_.hdBeginFrame(handle_);
  DeviceSample sample;
  const bool good = measure(sample);
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  sample.time_ns = now_ns;
  for (int i = 0; i < 8; ++i) {
    const ErrorInfo error = hd_.hdGetError();
    if (error.code == 0) break;
    note_error(error, now_ns);
  }
  if (!good) io::bump(lost_poses_);

  const bool ending = ending_.load(std::memory_order_acquire);
  const bool settled = number >= kSettlingTicks;
  // In each tick: the pose is wrong from the one on in which calibration is lost. Housekeeping finds out what to do.
  const bool lost_it = settled && hd_.hdCheckCalibration() != kCalibrationOk;
  if (lost_it) calibrated_.store(false, std::memory_order_release);
  const bool patient = force_error_ns_ == 0 || now_ns > force_error_ns_ + kForceErrorOverNs ||
                       force_error_ns_ < force_error_since_ns_ + kForceErrorPatienceNs;
  const io::LinkState state = ending || device_lost_               ? io::LinkState::kLost
                              : !settled                           ? io::LinkState::kOpening
                              : !calibrated || lost_it || !patient ? io::LinkState::kNotReady
                                                                   : io::LinkState::kRunning;
  if (state != io::LinkState::kRunning) port_.set_state(state);
  if (good && settled && !device_lost_) {
    last_sample_ns_ = now_ns;
    port_.publish(sample);
    if (state == io::LinkState::kRunning) {
      port_.set_state(state);
      if (port_.paced()) {
        (void)port_.await_force(now_ns + static_cast<std::uint64_t>(settings_.max_force_wait_s * 1e9));
      }
    }
  }
  // In every frame, also a zero: a frame in which no force is set sends zero, and says nothing about it.
  Vec3 f = port_.take_force(rtbus::monotonic_ns(), last_sample_ns_).force_n;
  const double norm_n = std::sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
  if (norm_n > own_max_force_n_) {
    for (double& each : f) each *= own_max_force_n_ / norm_n;
    io::bump(limited_);
  }
  hd_.hdSetDoublev(kCurrentForce, f.data());
  hd_.hdEndFrame(handle_);
  port_.sent(rtbus::monotonic_ns());
  ticks_.store(number + 1, std::memory_order_release);
  if (!ending || ++last_ticks_ < kZerosAtTheEnd) return kCallbackContinue;
  ended_.store(true, std::memory_order_release);
  return kCallbackDone;
}

}  // namespace drivers::openhaptics
