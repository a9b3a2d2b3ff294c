#include "drivers/force_dimension/line.hpp"

#include <algorithm>
#include <cmath>

#include "drivers/force_dimension/frame.hpp"
#include "rtbus/clock.hpp"

namespace drivers::force_dimension {
namespace {

using io::ExchangeStatus;
using io::SendStatus;
using rtbus::Failure;

/// Status and buttons are asked for at 50 Hz each, a gripper at 100 Hz: every call costs up to a millisecond.
constexpr std::uint64_t kPollEvery = 20;
/// Bringing it up is not done in real time: its watchdog may have ended the forces before the first exchange.
constexpr std::uint64_t kFirstLook = 2;
/// A force that the device's own watchdog ended comes back after so long: this computer had been late, nobody else.
constexpr std::uint64_t kWatchdogPauseNs = 250 * rtbus::kNsPerMs;
constexpr double kWatchdogStep_s = 125e-6;
constexpr double kFarthest_m = 1.0;  ///< No tip can be farther from its base's origin.

std::string force_off_remedy(int cause) {
  switch (cause) {
    case 1:
      return "its force button turned the forces off; press it again";
    case 2:
      return "it moved too fast and put its brakes on; hold the handle and press its force button";
    case 3:
      return "its watchdog turned the forces off, since this computer was late; they come back by themselves";
    case 5:
      return "it lost its USB connection for a moment; press its force button";
    case 6:
      return "nobody holds it; hold the handle and press its force button";
    default:
      return "its forces are off; press its force button";
  }
}

}  // namespace

rtbus::Result<void, DeviceFault> FdLine::failed(const std::string& what) const {
  return Failure{DeviceFault{what + ": " + sdk_.last_error()}};
}

FdLine::Opened FdLine::claim() {
  if (settings_.claim.empty()) return {};
  auto taken = vendor::Claim::take(settings_.claim, settings_.owner);
  if (!taken) {
    return Failure{
        DeviceFault{taken.error() + " has the device; end that session, or choose another device by `serial:`"}};
  }
  claim_ = std::move(*taken);
  return {};
}

FdLine::Opened FdLine::load() {
  if (loaded_) return {};
  auto sdk = load_sdk(settings_.library);
  if (!sdk) return Failure{DeviceFault{"driver force_dimension: " + sdk.error()}};
  sdk_ = *sdk;
  if (settings_.read_velocity && sdk_.dhdGetLinearVelocity == nullptr) {
    return Failure{DeviceFault{sdk_.file + " has no function dhdGetLinearVelocity; install a newer SDK, or leave out "
                                           "read_velocity"}};
  }
  if (settings_.prepare) {
    if (const std::string problem = settings_.prepare(); !problem.empty()) return Failure{DeviceFault{problem}};
  }
  loaded_ = true;
  return {};
}

// What is plugged in, for the message that the wanted one is not: each is opened for its serial number, and closed.
std::string FdLine::others() const {
  std::string out;
  const int count = std::max(0, sdk_.dhdGetDeviceCount());
  for (int i = 0; i < count; ++i) {
    out += out.empty() ? "" : ", ";
    const int opened = sdk_.dhdOpenID(static_cast<char>(i));
    if (opened < 0) {
      out += "one that does not open: " + sdk_.last_error();
      continue;
    }
    const auto id = static_cast<char>(opened);
    unsigned short serial = 0;
    const bool known = sdk_.dhdGetSerialNumber(&serial, id) >= 0;
    out += product_of(sdk_.dhdGetSystemType(id)) + (known ? " with serial " + std::to_string(serial) : "");
    (void)sdk_.dhdClose(id);
  }
  return out;
}

// No device but the wanted one is opened, unless that is not there.
FdLine::Opened FdLine::open() {
  const int count = sdk_.dhdGetDeviceCount();
  if (count <= 0) {
    return Failure{
        DeviceFault{"no Force Dimension device is plugged in and permitted; check cable and power, and that "
                    "the rules file 70-rtbus-haptics.rules is installed (docs/devices.md)"}};
  }
  int id = -1;
  if (settings_.serial != 0) {
    id = sdk_.dhdOpenSerial(settings_.serial);
  } else if (count > 1) {
    return Failure{DeviceFault{std::to_string(count) + " Force Dimension devices are plugged in; name one by `serial:` "
                                                       "(rtbus devices --all asks them for theirs)"}};
  } else {
    id = sdk_.has_drd() ? sdk_.drdOpenID(0) : sdk_.dhdOpenID(0);
  }
  if (id < 0) {
    const int error = sdk_.dhdErrorGetLast();
    if (error == kErrorInUse) {
      const std::string owner = vendor::other_owner("force_dimension ");  // the SDK does not say whose it is
      return Failure{DeviceFault{(owner.empty() ? "another program" : owner) +
                                 " has the device; close it (a device serves one program at a time)"}};
    }
    if (settings_.serial != 0) {
      const std::string why = sdk_.last_error();
      return Failure{DeviceFault{"no device with serial number " + std::to_string(settings_.serial) + " opens: " + why +
                                 "; there is: " + others() + "; correct `serial:`"}};
    }
    return failed("the device cannot be opened");
  }
  id_ = static_cast<char>(id);
  open_ = true;
  return {};
}

FdLine::Opened FdLine::identify() {
  const int type = sdk_.dhdGetSystemType(id_);
  if (type < 0) return failed("the device does not say what it is");
  const Model& model = settings_.model;
  if (type == model.types[0] || type == model.types[1]) return {};
  const std::string product = product_of(type);
  const char* const article = product.starts_with("omega") ? "an " : "a ";
  return Failure{DeviceFault{"the device is " + (article + product) + ", the device file says model: " +
                             std::string(model.name) + "; its limits differ, so use the file of that device"}};
}

FdLine::Opened FdLine::calibrate() {
  int status[kStatusRoom] = {};
  if (sdk_.dhdGetStatus(status, id_) < 0) return failed("the device does not tell its state");
  const bool known = sdk_.has_drd() ? sdk_.drdIsInitialized(id_) : status[kStatusReset] == 0;
  if (!known) {
    const bool by_itself = settings_.model.calibrates_itself && sdk_.has_drd();
    if (connected_before_) {
      return Failure{
          DeviceFault{"it lost its calibration; end the session, calibrate it with "
                      "`rtbus calibrate`, and start again"}};
    }
    if (!by_itself) {
      return Failure{DeviceFault{std::string("it is not calibrated; ") +
                                 (settings_.model.types[0] == 60
                                      ? "move the grip out and in until its light changes, then start again"
                                      : "move each axis through its whole range, or hold its force button for 2 s, "
                                        "then start again")}};
    }
    if (!settings_.auto_init) {
      return Failure{
          DeviceFault{"it is not calibrated, and does that by moving its arm: take your hands off and run "
                      "`rtbus calibrate` with this device file, or set auto_init: true"}};
    }
    if (sdk_.drdAutoInit(id_) < 0) return failed("it could not calibrate itself");
  }
  // Calibration leaves the SDK's own regulation on: until it is stopped, forces are taken without effect.
  if (sdk_.has_drd() && (!known || (sdk_.drdIsRunning != nullptr && sdk_.drdIsRunning(id_)))) {
    if (sdk_.drdStop(true, id_) < 0) return failed("its regulation cannot be stopped");
  }
  return {};
}

FdLine::Opened FdLine::prepare_forces() {
  // Expert mode is the whole process's: on for these calls alone.
  if (sdk_.dhdEnableExpertMode() < 0) return failed("expert mode cannot be enabled");
  const bool guard_off = sdk_.dhdSetTimeGuard(0, id_) >= 0;
  const int steps = std::clamp(static_cast<int>(settings_.watchdog_s / kWatchdogStep_s), 1, 255);
  const bool watched =
      sdk_.dhdSetWatchdog != nullptr && sdk_.dhdSetWatchdog(static_cast<unsigned char>(steps), id_) >= 0;
  if (sdk_.dhdDisableExpertMode() < 0) return failed("expert mode cannot be left");
  if (!guard_off) news_ = "its time guard stays on: some samples come a period late; ";
  if (!watched) {
    news_ += "its controller has no watchdog: when this computer stops, only its speed limit ends the force; ";
  }
  if (sdk_.dhdSetMaxForce != nullptr && sdk_.dhdSetMaxForce(settings_.model.limits.max_force_n, id_) < 0) {
    return failed("its largest force cannot be set");
  }
  if (sdk_.dhdSetGravityCompensation(settings_.gravity_compensation ? 1 : 0, id_) < 0) {
    return failed("its gravity compensation cannot be set");
  }
  if (sdk_.dhdSetBrakes(0, id_) < 0) return failed("its brakes cannot be released");
  if (sdk_.dhdEnableForce(1, id_) < 0) return failed("its forces cannot be enabled");
  readiness_ = io::Readiness::kReady;
  force_off_since_ns_ = 0;
  if (send({}, 0.001, false, 0) != SendStatus::kSent) return failed("it takes no force");
  look_at_status(rtbus::monotonic_ns());
  return {};
}

rtbus::Result<void, DeviceFault> FdLine::connect(io::StopFlag& stop) {
  using Step = Opened (FdLine::*)();
  for (const Step step :
       {&FdLine::load, &FdLine::claim, &FdLine::open, &FdLine::identify, &FdLine::calibrate, &FdLine::prepare_forces}) {
    if (auto done = (this->*step)(); !done) {
      disconnect(true);
      return done;
    }
    if (stop.raised()) {
      disconnect(true);
      return Failure{DeviceFault{"stopped before the device was ready"}};
    }
  }
  connected_before_ = true;
  exchanges_ = 0;
  velocity_m_s_ = {};
  return {};
}

void FdLine::disconnect(bool reachable) noexcept {
  if (!open_) {
    claim_.release();
    return;
  }
  if (reachable) {
    (void)send({}, 0.001, false, 0);
    (void)sdk_.dhdEnableForce(0, id_);
  }
  (void)(sdk_.has_drd() ? sdk_.drdClose(id_) : sdk_.dhdClose(id_));  // also when the device is gone
  open_ = false;
  claim_.release();
}

// --- Exchanges ------------------------------------------------------------------------------------------------------

SendStatus FdLine::after_error() noexcept {
  ++counters_.line_errors;
  switch (sdk_.dhdErrorGetLast()) {
    case kErrorTimeout:
      return SendStatus::kNothing;
    case kErrorNotReady:
    case kErrorNotEnabled:
      look_at_status(rtbus::monotonic_ns());
      return fault_.empty() ? SendStatus::kNothing : SendStatus::kFault;
    default:
      return SendStatus::kLost;
  }
}

SendStatus FdLine::send(const Vec3& asked_n, double, bool, std::uint64_t) noexcept {
  const bool ready = readiness_ == io::Readiness::kReady;
  withheld_ = !ready && asked_n != Vec3{};
  const Vec3 f = to_maker(ready ? asked_n : Vec3{});
  // A wrist or gripper with motors gets a torque of zero with every force.
  const int status = settings_.model.active_wrist
                         ? sdk_.dhdSetForceAndTorqueAndGripperForce(f[0], f[1], f[2], 0, 0, 0, 0, id_)
                         : sdk_.dhdSetForce(f[0], f[1], f[2], id_);
  if (status == kMotorSaturated) ++counters_.clamped;
  if (status >= 0) return SendStatus::kSent;
  withheld_ = asked_n != Vec3{};
  return after_error();
}

ExchangeStatus FdLine::receive(DeviceSample& out, std::uint64_t) noexcept {
  const auto ended = [](SendStatus status) {
    return status == SendStatus::kLost    ? ExchangeStatus::kLost
           : status == SendStatus::kFault ? ExchangeStatus::kFault
                                          : ExchangeStatus::kNothing;
  };
  Vec3 p{};
  double frame[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const int status = settings_.model.wrist ? sdk_.dhdGetPositionAndOrientationFrame(&p[0], &p[1], &p[2], frame, id_)
                                           : sdk_.dhdGetPosition(&p[0], &p[1], &p[2], id_);
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  if (status < 0) return ended(after_error());
  if (status == kTimeGuard) {  // the position of the call before
    ++counters_.lost_frames;
    return ExchangeStatus::kNothing;
  }
  const auto possible = [](double v) { return std::isfinite(v) && std::abs(v) < kFarthest_m; };
  if (!std::all_of(p.begin(), p.end(), possible)) {
    ++counters_.bad_frames;
    return ExchangeStatus::kNothing;
  }
  const std::uint64_t turn = ++exchanges_ % kPollEvery;
  if (turn == 0 || exchanges_ == kFirstLook) look_at_status(now_ns);
  if (!fault_.empty()) return ExchangeStatus::kFault;
  if (turn == kPollEvery / 2) {
    buttons_ = sdk_.dhdGetButtonMask != nullptr ? sdk_.dhdGetButtonMask(id_)
                                                : static_cast<std::uint32_t>(sdk_.dhdGetButton(0, id_) == 1);
  }
  if (settings_.read_velocity) read_velocity();
  if (settings_.model.gripper && turn % (kPollEvery / 2) == kPollEvery / 4) read_gripper();
  for (std::size_t i = 0; i < 3; ++i) p[i] -= settings_.origin_m[i];
  out.position_m = from_maker(p);
  out.velocity_m_s = from_maker(velocity_m_s_);
  out.gripper_m = gripper_m_;
  out.orientation_wxyz = settings_.model.wrist ? from_maker(frame) : Quat{1, 0, 0, 0};
  out.buttons = buttons_;
  out.time_ns = now_ns;
  ++counters_.exchanges;
  return ExchangeStatus::kSample;
}

// It needs two positions in its window and says TIMEOUT until then: the last velocity holds.
void FdLine::read_velocity() noexcept {
  Vec3 v{};
  const bool got = sdk_.dhdGetLinearVelocity(&v[0], &v[1], &v[2], id_) >= 0;
  if (got && std::all_of(v.begin(), v.end(), [](double each) { return std::isfinite(each); })) velocity_m_s_ = v;
}

// A gap, since its sign does not depend on the hand that the device is made for, as that of the angle does.
void FdLine::read_gripper() noexcept {
  double gap_m = 0.0;
  if (sdk_.dhdGetGripperGap == nullptr || sdk_.dhdGetGripperGap(&gap_m, id_) < 0) return;
  if (std::isfinite(gap_m) && std::abs(gap_m) < kFarthest_m) gripper_m_ = gap_m;
}

// Forces that are off do not make dhdSetForce() fail: the state has to be asked for.
void FdLine::look_at_status(std::uint64_t now_ns) {
  fault_.clear();
  int status[kStatusRoom] = {};
  if (sdk_.dhdGetStatus(status, id_) < 0) return;  // the next exchange finds out why
  if (status[kStatusReset] != 0) {
    fault_ = "it lost its calibration";
    return;
  }
  if (status[kStatusForce] != 0 && status[kStatusBrake] == 0) {
    readiness_ = io::Readiness::kReady;
    force_off_since_ns_ = 0;
    return;
  }
  const int cause = status[kStatusForceOffCause];
  readiness_ = io::Readiness::kNotHomed;
  remedy_ = force_off_remedy(cause);
  if (force_off_since_ns_ == 0) force_off_since_ns_ = now_ns;
  const bool by_watchdog = cause == 3 && (exchanges_ <= kFirstLook || now_ns > force_off_since_ns_ + kWatchdogPauseNs);
  if (by_watchdog) (void)sdk_.dhdEnableForce(1, id_);
}

}  // namespace drivers::force_dimension
