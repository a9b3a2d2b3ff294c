// Start, calibration, texts and stop; the callback is in servo_tick.cpp.
#include "drivers/openhaptics/servo_device.hpp"

#include <algorithm>
#include <atomic>
#include <utility>

#include "drivers/openhaptics/set_up.hpp"
#include "rtbus/clock.hpp"

namespace drivers::openhaptics {
namespace {

using rtbus::Failure;

constexpr std::uint64_t kServoPatienceNs = 3 * rtbus::kNsPerS;
constexpr std::uint64_t kSilentAfterNs = 250 * rtbus::kNsPerMs;
constexpr std::uint64_t kRepeatAfterNs = 5 * rtbus::kNsPerS;

/// The library has one scheduler per process, and this driver one device in it.
std::atomic<bool> runtime_taken{false};

}  // namespace

ServoDevice::ServoDevice(Settings settings) : settings_(std::move(settings)), port_(settings_.model.limits) {}

ErrorInfo ServoDevice::drain() noexcept {
  ErrorInfo worst;
  for (int i = 0; i < 64; ++i) {  // newest first; a library that never runs empty must not hold us
    const ErrorInfo error = hd_.hdGetError();
    if (error.code == 0) break;
    if (error.code != 0x0103 && error.code != 0x0102) worst = error;  // both are harmless after the start
  }
  return worst;
}

rtbus::Result<void, DeviceFault> ServoDevice::start(std::uint64_t) {
  stop();
  cancelled_.store(false);
  ending_.store(false);
  ended_.store(false);
  calibrated_.store(false);
  for (auto* counter : {&ticks_, &lost_poses_, &limited_, &force_errors_, &warm_, &losses_, &last_error_}) {
    counter->store(0);
  }
  device_lost_ = told_manual_ = told_stopped_ = false;
  told_error_ = 0;
  force_error_since_ns_ = force_error_ns_ = last_sample_ns_ = seen_ticks_ = ticks_seen_ns_ = 0;
  last_ticks_ = 0;
  port_.reset();
  {
    const std::lock_guard lock(mutex_);
    notice_.clear();
  }
  if (runtime_taken.exchange(true)) {
    return Failure{
        DeviceFault{"this process already drives a device through OpenHaptics; give each device a haptic node "
                    "of its own"}};
  }
  port_.set_state(io::LinkState::kOpening);
  for (auto step : {&ServoDevice::load, &ServoDevice::claim, &ServoDevice::initialise, &ServoDevice::check_model,
                    &ServoDevice::start_servo}) {
    auto done = (this->*step)();
    if (done && cancelled_.load()) done = Failure{DeviceFault{"stopped before the device was ready"}};
    if (!done) {
      release();
      return done;
    }
  }
  calibrate_further();
  // The next whole tick makes it known: who asks for a sample then gets one, or learns that the user must act.
  const std::uint64_t known_at = ticks_.load() + 2;
  const std::uint64_t until_ns = rtbus::monotonic_ns() + kSilentAfterNs;
  while (ticks_.load() < known_at && rtbus::monotonic_ns() < until_ns) {
    rtbus::sleep_until(rtbus::monotonic_ns() + rtbus::kNsPerMs);
  }
  return {};
}

ServoDevice::Started ServoDevice::load() {
  if (loaded_) return {};
  auto hd = load_hd(settings_.library);
  if (!hd) return Failure{DeviceFault{"driver openhaptics: " + hd.error()}};
  hd_ = *hd;
  loaded_ = true;
  return {};
}

ServoDevice::Started ServoDevice::claim() {
  if (settings_.claim.empty()) return {};
  auto taken = vendor::Claim::take(settings_.claim, settings_.owner);
  if (!taken) {
    return Failure{
        DeviceFault{taken.error() + " has the device; end that session, or choose another device by `name:`"}};
  }
  claim_ = std::move(*taken);
  return {};
}

ServoDevice::Started ServoDevice::initialise() {
  if (settings_.prepare) {
    if (const std::string problem = settings_.prepare(); !problem.empty()) return Failure{DeviceFault{problem}};
  }
  handle_ = hd_.hdInitDevice(settings_.name.empty() ? nullptr : settings_.name.c_str());
  const ErrorInfo error = drain();
  // It may fail with an error, and without one.
  if (handle_ != kInvalidHandle && handle_ <= kLastPlausibleHandle && kind_of(error.code) != ErrorKind::kDevice) {
    return {};
  }
  const std::string which = settings_.name.empty() ? "the default device" : "the device \"" + settings_.name + "\"";
  handle_ = kInvalidHandle;
  const ErrorInfo shown = error.code != 0 ? error : ErrorInfo{0x0300, 0, 0};
  std::string names;
  for (const std::string& name : settings_.names.empty() ? devices_set_up() : settings_.names) {
    names += (names.empty() ? "" : ", ") + name;
  }
  return Failure{DeviceFault{which + " cannot be initialised: " + explain(shown) + "; " +
                             (names.empty() ? "none is set up for this user in $GTDD_HOME/config"
                                            : "there is: " + names + "; name one of them by `name:`")}};
}

ServoDevice::Started ServoDevice::check_model() {
  hd_.hdMakeCurrentDevice(handle_);
  const char* const type = hd_.hdGetString(kModelType);
  const std::string said = type == nullptr ? "" : type;
  const auto known = [&](const Model& model) { return !model.model_type.empty() && model.model_type == said; };
  const auto other = std::find_if(models().begin(), models().end(), known);
  if (other != models().end() && other->name != settings_.model.name) {
    return Failure{DeviceFault{"the device is a " + said + ", the device file says model: " +
                               std::string(settings_.model.name) + "; set model: " + std::string(other->name)}};
  }
  if (other == models().end()) {
    tell("the library calls the device \"" + said +
         "\", a name that this driver does not know; its limits are those of "
         "model: " +
         std::string(settings_.model.name));
  }
  double box_mm[6] = {};
  hd_.hdGetDoublev(kUsableWorkspace, box_mm);
  for (int i = 0; i < 3; ++i) origin_mm_[i] = 0.5 * (box_mm[i] + box_mm[i + 3]);
  double force_n = 0.0;
  hd_.hdGetDoublev(kNominalMaxForce, &force_n);
  const bool sane = force_n > 0.0 && force_n < 100.0;
  own_max_force_n_ = sane ? std::min(force_n, info().max_force_n) : info().max_force_n;
  int style = 0;
  hd_.hdGetIntegerv(kCalibrationStyle, &style);
  // Several bits may be set.
  const auto bits = static_cast<std::uint32_t>(style);
  style_ = bits & kStyleAuto ? kStyleAuto : bits & kStyleInkwell ? kStyleInkwell : kStyleEncoderReset;
  hd_.hdEnable(kForceOutput);
  hd_.hdEnable(kMaxForceClamping);
  const ErrorInfo error = drain();
  if (kind_of(error.code) == ErrorKind::kDevice) return Failure{DeviceFault{"the device fails: " + explain(error)}};
  return {};
}

ServoDevice::Started ServoDevice::start_servo() {
  scheduled_ = hd_.hdScheduleAsynchronous(&servo_callback, this, kDefaultPriority);
  servo_runs_ = true;
  hd_.hdStartScheduler();
  const ErrorInfo error = drain();
  if (kind_of(error.code) == ErrorKind::kDevice) {
    return Failure{DeviceFault{"the servo thread does not start: " + explain(error)}};
  }
  const std::uint64_t until_ns = rtbus::monotonic_ns() + kServoPatienceNs;
  while (ticks_.load() < kSettlingTicks && !cancelled_.load()) {
    if (rtbus::monotonic_ns() > until_ns) {
      return Failure{DeviceFault{"the servo thread of OpenHaptics does not run: " + std::to_string(ticks_.load()) +
                                 " ticks in 3 s; unplug USB and power of the device for some seconds"}};
    }
    rtbus::sleep_until(rtbus::monotonic_ns() + 5 * rtbus::kNsPerMs);
  }
  return {};
}

// --- Housekeeping ---------------------------------------------------------------------------------------------------

void ServoDevice::calibrate_further() {
  hd_.hdMakeCurrentDevice(handle_);  // each thread has a current device of its own
  std::uint32_t state = hd_.hdCheckCalibration();
  if (state == kCalibrationNeedsUpdate) {
    hd_.hdUpdateCalibration(style_);
    state = hd_.hdCheckCalibration();
  }
  if (state == kCalibrationOk) {
    if (told_manual_ && !calibrated_.load()) tell("the device is calibrated");
    calibrated_.store(true);
    return;
  }
  calibrated_.store(false);
  if (state == kCalibrationNeedsManualInput && !std::exchange(told_manual_, true)) {
    tell(style_ == kStyleInkwell ? "it is not calibrated: put the stylus into its inkwell; zero force until then"
                                 : "it is not calibrated: hold the arm at its reset position; zero force until then");
  }
}

void ServoDevice::maintain() noexcept {
  const std::lock_guard alive(life_);
  if (!servo_runs_ || handle_ == kInvalidHandle) return;
  calibrate_further();
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  if (const std::uint64_t ticks = ticks_.load(); ticks != seen_ticks_ || ticks_seen_ns_ == 0) {
    if (std::exchange(told_stopped_, false)) tell("the servo thread of OpenHaptics runs again");
    seen_ticks_ = ticks;
    ticks_seen_ns_ = now_ns;
  } else if (now_ns > ticks_seen_ns_ + kSilentAfterNs && !std::exchange(told_stopped_, true)) {
    tell(
        "the servo thread of OpenHaptics has stopped: no force can be sent; take the hand off, replug the device and "
        "start the session again");
  }
  if (const std::uint64_t packed = last_error_.exchange(0); packed != 0) {
    const ErrorInfo error{static_cast<std::uint32_t>(packed >> 32), static_cast<int>(packed & 0xffffffffu), handle_};
    // The library repeats some of them in every tick.
    if (error.code != told_error_ || now_ns > told_error_ns_ + kRepeatAfterNs) tell(explain(error));
    told_error_ = error.code;
    told_error_ns_ = now_ns;
  }
}

void ServoDevice::tell(const std::string& text) {
  const std::lock_guard lock(mutex_);
  if (notice_.find(text) != notice_.npos) return;
  notice_ += (notice_.empty() ? "" : "; then: ") + text;
}

std::string ServoDevice::take_notice() {
  const std::lock_guard lock(mutex_);
  return std::exchange(notice_, {});
}

std::optional<rtbus::LinkStats> ServoDevice::link_stats() const {
  rtbus::LinkStats out = port_.stats();
  out.exchanges = ticks_.load();
  out.bad_frames = lost_poses_.load();
  out.line_errors = force_errors_.load();
  out.limited = limited_.load() + warm_.load();
  out.losses = losses_.load();
  return out;
}

void ServoDevice::stop() noexcept {
  if (handle_ == kInvalidHandle) return;
  release();
}

// The callback sends zero a few times and ends; only then the scheduler stops.
void ServoDevice::release() noexcept {
  const std::lock_guard alive(life_);
  if (servo_runs_) {
    ending_.store(true);
    const std::uint64_t until_ns = rtbus::monotonic_ns() + 100 * rtbus::kNsPerMs;
    while (!ended_.load() && rtbus::monotonic_ns() < until_ns) {
      rtbus::sleep_until(rtbus::monotonic_ns() + rtbus::kNsPerMs);
    }
    hd_.hdStopScheduler();
    hd_.hdUnschedule(scheduled_);
    servo_runs_ = false;
  }
  if (handle_ != kInvalidHandle) hd_.hdDisableDevice(handle_);
  if (loaded_) (void)drain();
  handle_ = kInvalidHandle;
  claim_.release();
  port_.set_state(io::LinkState::kStopped);
  runtime_taken.store(false);
}

}  // namespace drivers::openhaptics
