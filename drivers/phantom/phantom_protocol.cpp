#include "drivers/phantom/phantom_protocol.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "rtbus/clock.hpp"

namespace drivers::phantom {
namespace {

using usb::ExchangeStatus;
using usb::UsbStatus;

// Where two answers may be under way, the newer one is waited for so long.
constexpr std::uint64_t kGraceNs = 1 * rtbus::kNsPerMs;
// A device that stalls each time must not keep the thread busy until its deadline.
constexpr int kMostFailedReads = 8;
// So many answers of another model: the device was exchanged.
constexpr int kWrongModels = 3;

constexpr std::size_t kReadBytes = 4096;

}  // namespace

PhantomProtocol::PhantomProtocol(const PhantomSettings& settings, std::shared_ptr<Homing> homing)
    : settings_(settings), kinematics_(settings.model), protection_(settings.motors), homing_(std::move(homing)) {}

UsbStatus PhantomProtocol::transmit(usb::Channel& channel, const CurrentsMa& currents_ma,
                                    std::uint64_t deadline_ns) noexcept {
  Command command;
  if (!encode(currents_ma, command)) return UsbStatus::kError;  // cannot be: limited before
  const UsbStatus status = channel.write(command.span(), deadline_ns);
  if (status == UsbStatus::kLost) homing_->lost();
  if (status == UsbStatus::kOk) {
    owed_ = true;
    sent_ns_ = channel.now_ns();
    sent_ma_ = currents_ma;
  }
  return status;
}

PhantomProtocol::Got PhantomProtocol::next_reply(usb::Channel& channel, std::uint64_t deadline_ns) noexcept {
  std::array<std::uint8_t, kReadBytes> buffer;
  const std::size_t size = std::min(channel.read_size(), buffer.size());
  bool found = false;
  int failed = 0;
  for (;;) {
    std::size_t got = 0;
    const UsbStatus status = channel.read({buffer.data(), size}, got, deadline_ns);
    if (status == UsbStatus::kLost) {
      homing_->lost();
      return Got::kLost;
    }
    if (status == UsbStatus::kStopping) return Got::kStopping;
    if (status == UsbStatus::kTimeout) break;
    if (status != UsbStatus::kOk) {
      ++counters_.line_errors;
      if (++failed == kMostFailedReads) break;
      continue;
    }
    const std::uint64_t resyncs_before = decoder_.resyncs();
    for (std::size_t i = 0; i < std::min(got, size); ++i) {
      const auto event = decoder_.take(buffer[i], reply_);
      if (event == ReplyDecoder::Event::kBadReply) ++counters_.bad_frames;
      if (event != ReplyDecoder::Event::kReply) continue;
      // The newest of several counts; an answer more than owed is the late one to an abandoned command.
      if (found) abandoned_ = false;
      found = true;
    }
    counters_.resyncs += decoder_.resyncs() - resyncs_before;
    if (!found) continue;
    if (!abandoned_) break;
    deadline_ns = std::min(deadline_ns, channel.now_ns() + kGraceNs);
  }
  if (!found) return Got::kNothing;
  owed_ = false;
  abandoned_ = false;
  return Got::kReply;
}

CurrentsMa PhantomProtocol::currents_for(const Vec3& force_n) noexcept {
  const Eigen::Vector3d force(force_n[0], force_n[1], force_n[2]);
  const Eigen::Vector3d torques_n_m = pose_.jacobian_m.transpose() * force;
  const Eigen::Vector3d weight_n_m = settings_.gravity_share * kinematics_.gravity_torques_n_m(angles_);
  const Eigen::Vector3d base_ma = kinematics_.currents_ma(weight_n_m);
  const Eigen::Vector3d force_ma = kinematics_.currents_ma(torques_n_m);
  bool limited = false;
  const Eigen::Vector3d currents = protection_.limit(base_ma, force_ma, limited);
  if (limited) ++counters_.clamped;
  // Where the arm's weight alone is too much for the motors nothing of the force is left.
  withheld_ = limited && force_n != Vec3{} && (currents - base_ma).dot(force_ma) <= 0.0;
  CurrentsMa out;
  for (std::size_t i = 0; i < 3; ++i) out[i] = static_cast<int>(std::lround(currents[static_cast<int>(i)]));
  return out;
}

UsbStatus PhantomProtocol::send(usb::Channel& channel, const Vec3& force_n, double dt_s,
                                std::uint64_t deadline_ns) noexcept {
  protection_.flowed(
      {static_cast<double>(sent_ma_[0]), static_cast<double>(sent_ma_[1]), static_cast<double>(sent_ma_[2])}, dt_s);
  const std::uint64_t now_ns = channel.now_ns();
  withheld_ = false;
  if (owed_) {
    // Two commands in the device at once would both be dropped, with the old current flowing on.
    if (now_ns < sent_ns_ + kReplyLostNs) return UsbStatus::kOk;
    ++counters_.lost_frames;
    owed_ = false;
    abandoned_ = true;
    decoder_.reset();
  }
  if (calibration_pending_) {
    echo_ma_ = 1 - echo_ma_;
    return transmit(channel, {echo_ma_, 0, 0}, deadline_ns);
  }
  const bool stale = now_ns > answered_ns_ + kStaleNs;
  const bool give = homing_->homed() && !withhold_ && !stale;
  withheld_ = !give && force_n != Vec3{};
  return transmit(channel, give ? currents_for(force_n) : CurrentsMa{}, deadline_ns);
}

ExchangeStatus PhantomProtocol::receive(usb::Channel& channel, DeviceSample& out, std::uint64_t deadline_ns) noexcept {
  switch (next_reply(channel, deadline_ns)) {
    case Got::kLost:
      return ExchangeStatus::kLost;
    case Got::kStopping:
      return ExchangeStatus::kStopping;
    case Got::kNothing:
      return ExchangeStatus::kNothing;
    case Got::kReply:
      break;
  }
  const std::uint64_t now_ns = channel.now_ns();
  if (reply_.model != static_cast<int>(settings_.model.id)) {
    // A bit flip may look like that once: there is no checksum.
    ++counters_.bad_frames;
    withhold_ = true;
    return ++wrong_model_ >= kWrongModels ? ExchangeStatus::kFault : ExchangeStatus::kNothing;
  }
  wrong_model_ = 0;
  if ((reply_.errors & kCommandErrors) != 0) {
    // Dropped command, old counters, old current: zero next.
    ++counters_.line_errors;
    withhold_ = true;
    return ExchangeStatus::kNothing;
  }
  if ((reply_.errors & kGimbalErrors) != 0) ++counters_.line_errors;
  return measure(now_ns, out);
}

ExchangeStatus PhantomProtocol::measure(std::uint64_t now_ns, DeviceSample& out) noexcept {
  if (calibration_pending_) {
    withhold_ = true;
    watch_calibration(now_ns);
  } else {
    const JointAngles angles = kinematics_.angles(reply_.arm);
    ArmPose pose;
    const bool possible = kinematics_.forward(angles, pose);
    const auto verdict = homing_->update(now_ns, reply_.arm, possible);
    withhold_ = !possible || verdict != Homing::Verdict::kHomed;
    // While homed an impossible pose is no measurement; the last one stays.
    if (!possible) ++impossible_poses_;
    if (verdict == Homing::Verdict::kGlitch || (verdict == Homing::Verdict::kHomed && !possible)) {
      ++counters_.bad_frames;
      return ExchangeStatus::kNothing;
    }
    if (possible) {
      angles_ = angles;
      pose_ = pose;
      take_pose();
    }
  }
  answered_ns_ = now_ns;
  ++counters_.exchanges;
  sample_.time_ns = now_ns;
  out = sample_;
  return ExchangeStatus::kSample;
}

void PhantomProtocol::take_pose() noexcept {
  sample_.position_m = {pose_.position_m.x(), pose_.position_m.y(), pose_.position_m.z()};
  // A sensor that does not answer leaves the orientation where it was.
  if (settings_.model.gimbal == GimbalKind::kNone || (reply_.errors & kGimbalErrors) != 0) return;
  std::array<double, 3> gimbal = kinematics_.gimbal_angles(reply_.gimbal);
  for (std::size_t i = 0; i < 3; ++i) gimbal[i] = settings_.gimbal_sign[i] * (gimbal[i] - settings_.gimbal_zero_rad[i]);
  const Quat q = kinematics_.orientation(angles_[0], pose_.elevation_rad, gimbal);
  sample_.orientation_wxyz = continuous(q, sample_.orientation_wxyz);
}

void PhantomProtocol::watch_calibration(std::uint64_t now_ns) noexcept {
  // The firmware echoes the command in e1 until its button was pressed.
  constexpr int kMiss = 4;
  constexpr int kEnough = 6;  // two in a short while; a damaged answer alone is forgotten
  echoes_missed_ = reply_.arm[1] == echo_ma_ ? std::max(0, echoes_missed_ - 1) : echoes_missed_ + kMiss;
  if (echoes_missed_ < kEnough) return;
  calibration_pending_ = false;  // true counters from here on
  homing_->pressed(now_ns, reply_.arm);
}

void PhantomProtocol::shut_down(usb::Channel& channel) noexcept {
  const std::uint64_t begin_ns = channel.now_ns();
  withhold_ = true;
  connected_ = false;
  // An answer may be under way; the zero must not meet its command in the device.
  if (owed_) (void)next_reply(channel, begin_ns + 10 * rtbus::kNsPerMs);
  for (int i = 0; i < 2; ++i) {
    const std::uint64_t now_ns = channel.now_ns();
    if (transmit(channel, {0, 0, 0}, now_ns + 10 * rtbus::kNsPerMs) != UsbStatus::kOk) break;
    if (next_reply(channel, channel.now_ns() + 10 * rtbus::kNsPerMs) == Got::kReply &&
        (reply_.errors & kCommandErrors) == 0)
      break;
  }
  owed_ = false;
  const usb::Setup line_state{0x21, 0x22, 0x0000, 0};
  (void)channel.control_out(line_state, {}, channel.now_ns() + 10 * rtbus::kNsPerMs);
}

usb::Readiness PhantomProtocol::readiness() const noexcept {
  return homing_->homed() && !calibration_pending_ ? usb::Readiness::kReady : usb::Readiness::kNotHomed;
}

std::string PhantomProtocol::remedy() const {
  if (calibration_pending_) {
    return "this firmware shows no counters before it was calibrated: " + homing_->press_at_home();
  }
  return homing_->remedy();
}

std::string PhantomProtocol::fault() const {
  return "the device now answers as model " + std::to_string(reply_.model) + " instead of " +
         std::to_string(static_cast<int>(settings_.model.id)) + " (" + std::string(settings_.model.name) +
         "); check the device and `model` in its file";
}

}  // namespace drivers::phantom
