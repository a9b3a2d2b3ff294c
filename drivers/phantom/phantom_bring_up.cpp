// PhantomProtocol::bring_up(): from a freshly opened serial device to an arm that answers, with a reason at each
// failure.
#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <utility>

#include "drivers/phantom/phantom_protocol.hpp"
#include "rtbus/clock.hpp"

namespace drivers::phantom {
namespace {

using rtbus::Failure;
using usb::UsbStatus;
using Outcome = rtbus::Result<void, DeviceFault>;

constexpr std::uint64_t kAnswerNs = 20 * rtbus::kNsPerMs;
constexpr std::uint64_t kQuietNs = 10 * rtbus::kNsPerMs;
constexpr std::uint64_t kDrainNs = 300 * rtbus::kNsPerMs;
constexpr int kProbes = 6;

Failure<DeviceFault> failed(const std::string& text) { return Failure{DeviceFault{"the device " + text}}; }

Failure<DeviceFault> gone() { return failed("was unplugged while it was being brought up; plug it in again"); }
Failure<DeviceFault> stopped() { return failed("was stopped while it was being brought up"); }

}  // namespace

Outcome PhantomProtocol::bring_up(usb::Channel& channel) {
  // Without a shut-down in between the device was lost, however it showed.
  if (std::exchange(connected_, false)) homing_->lost();
  owed_ = false;
  abandoned_ = false;
  withhold_ = true;
  calibration_pending_ = false;
  echoes_missed_ = 0;
  wrong_model_ = 0;
  decoder_.reset();
  Outcome done = set_line(channel);
  if (done) done = drain(channel);
  if (done) done = probe(channel);
  if (done) done = look_for_calibration(channel);
  if (!done) return done;
  connected_ = true;
  if (!calibration_pending_) homing_->begin(channel.now_ns(), reply_.arm);
  return {};
}

Outcome PhantomProtocol::set_line(usb::Channel& channel) {
  // 115200 8N1. The rate means nothing to the device, except 134, which sends it into its boot loader.
  constexpr std::array<std::uint8_t, 7> kCoding{0x00, 0xC2, 0x01, 0x00, 0x00, 0x00, 0x08};
  const usb::Setup coding{0x21, 0x20, 0x0000, 0};
  const usb::Setup state{0x21, 0x22, 0x0003, 0};  // DTR and RTS
  UsbStatus status = channel.control_out(coding, kCoding, channel.now_ns() + 500 * rtbus::kNsPerMs);
  if (status == UsbStatus::kOk) status = channel.control_out(state, {}, channel.now_ns() + 500 * rtbus::kNsPerMs);
  switch (status) {
    case UsbStatus::kOk:
      return {};
    case UsbStatus::kLost:
      return gone();
    case UsbStatus::kStopping:
      return stopped();
    default:
      return failed(
          "does not take the settings of a serial line; it is no PHANToM-class controller, or hangs: re-plug it");
  }
}

Outcome PhantomProtocol::drain(usb::Channel& channel) {
  std::array<std::uint8_t, 4096> buffer;
  const std::size_t size = std::min(channel.read_size(), buffer.size());
  const std::uint64_t end_ns = channel.now_ns() + kDrainNs;
  std::uint64_t quiet_ns = channel.now_ns() + kQuietNs;  // reached without a byte: drained
  while (channel.now_ns() < end_ns) {
    std::size_t got = 0;
    const UsbStatus status = channel.read({buffer.data(), size}, got, quiet_ns);
    if (status == UsbStatus::kLost) return gone();
    if (status == UsbStatus::kStopping) return stopped();
    if (channel.now_ns() >= quiet_ns) return {};
    if (status == UsbStatus::kOk && got > 0) quiet_ns = channel.now_ns() + kQuietNs;
  }
  return failed("sends without being asked; it is another Teensy program: check `serial` in the device file");
}

PhantomProtocol::Got PhantomProtocol::ask(usb::Channel& channel, const CurrentsMa& currents_ma) {
  const UsbStatus status = transmit(channel, currents_ma, channel.now_ns() + kAnswerNs);
  if (status == UsbStatus::kLost) return Got::kLost;
  if (status == UsbStatus::kStopping) return Got::kStopping;
  const Got got = next_reply(channel, channel.now_ns() + kAnswerNs);
  if (got == Got::kNothing) abandoned_ = true;
  owed_ = false;
  return got;
}

Outcome PhantomProtocol::probe(usb::Channel& channel, bool any_model) {
  // Zero current. The first answers may complain about half a line that a program before us left behind; two good ones
  // in a row are wanted.
  const std::uint64_t garbage_before = decoder_.garbage();
  const std::uint64_t bad_before = counters_.bad_frames;
  int good = 0;
  int model = 0;
  std::uint32_t errors = 0;
  bool answered = false;
  for (int i = 0; i < kProbes && good < 2; ++i) {
    const Got got = ask(channel, {0, 0, 0});
    if (got == Got::kLost) return gone();
    if (got == Got::kStopping) return stopped();
    if (got == Got::kNothing) {
      good = 0;
      continue;
    }
    answered = true;
    errors = reply_.errors;
    const bool fine = find_model(reply_.model) != nullptr && (reply_.errors & kCommandErrors) == 0;
    good = !fine ? 0 : (good > 0 && reply_.model == model ? good + 1 : 1);
    model = reply_.model;
  }
  if (good < 2) {
    if (answered && find_model(model) == nullptr) {
      return failed("answers as model " + std::to_string(model) +
                    ", which this driver does not know (1 Polhem, 2 Vintage PHANToM, 3 WoodenHaptics)");
    }
    if (answered) return failed("refuses the probe command (" + describe_errors(errors) + "); re-plug it");
    if (decoder_.garbage() != garbage_before || counters_.bad_frames != bad_before) {
      return failed(
          "answers, but not in the bracket protocol; every Teensy program has these USB ids: check `serial` in "
          "the device file");
    }
    return failed(
        "does not answer; every Teensy program has these USB ids: check `serial` in the device file, then the "
        "controller's firmware and power");
  }
  if (!any_model && model != static_cast<int>(settings_.model.id)) {
    const Model* const found = find_model(model);
    return failed("is a " + std::string(found->name) + " (model " + std::to_string(model) + "), the device file says " +
                  std::string(settings_.model.key) + "; set model: " + std::string(found->key));
  }
  answered_ns_ = channel.now_ns();
  return {};
}

usb::Inspection PhantomProtocol::inspect(usb::Channel& channel) {
  usb::Inspection out;
  owed_ = false;
  abandoned_ = false;
  decoder_.reset();
  Outcome done = set_line(channel);
  if (done) done = drain(channel);
  if (done) done = probe(channel, true);
  if (!done) {
    out.firmware = "not of this kind";
    out.remedy = done.error().message;
    return out;
  }
  out.answered = true;
  const Model& model = *find_model(reply_.model);
  out.model = model.name;
  out.model_key = model.key;
  out.home = model.home;
  out.firmware = "runs";
  out.counters.assign(reply_.arm.begin(), reply_.arm.end());
  const Kinematics kinematics(model);
  if (model.gimbal != GimbalKind::kNone) {
    const auto angles = kinematics.gimbal_angles(reply_.gimbal);
    out.stylus_angle_rad.assign(angles.begin(), angles.end());
  }
  const Homing home(kinematics, HomingMode::kAtStart, settings_.home_tolerance_rad);
  out.homed = home.near_zero(reply_.arm);
  // Nothing on the wire says whether the counters were zeroed at home.
  out.homing = out.homed ? "counters of the home pose" : "counters away from home";
  if (!out.homed) out.remedy = home.press_at_home();
  shut_down(channel);
  return out;
}

Outcome PhantomProtocol::look_for_calibration(usb::Channel& channel) {
  // A variant of the firmware keeps its amplifiers off until its button was pressed, invents e0 and echoes the command
  // of motor a in e1. One milliampere is 2 mN at the tip.
  const Reply before = reply_;
  int echoes = 0;
  for (const int current : {1, 0, 1}) {
    const Got got = ask(channel, {current, 0, 0});
    if (got == Got::kLost) return gone();
    if (got == Got::kStopping) return stopped();
    if (got == Got::kReply && (reply_.errors & kCommandErrors) == 0 && reply_.arm[1] == current) ++echoes;
  }
  calibration_pending_ = echoes == 3;
  const Got got = ask(channel, {0, 0, 0});
  if (got == Got::kLost) return gone();
  if (got == Got::kStopping) return stopped();
  if (got != Got::kReply || (reply_.errors & kCommandErrors) != 0) reply_ = before;
  return {};
}

}  // namespace drivers::phantom
