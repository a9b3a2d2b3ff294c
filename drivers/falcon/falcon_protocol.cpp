#include "drivers/falcon/falcon_protocol.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "drivers/falcon/serial_line.hpp"
#include "rtbus/eigen.hpp"

namespace drivers::falcon {
namespace {

using usb::ExchangeStatus;
using usb::UsbStatus;

constexpr double kExchangeHz = 1.5e6;  // nearest to the 1456312 that the maker's driver asks for
constexpr std::uint8_t kExchangeLatencyMs = 1;
constexpr double kGravityM_s2 = 9.81;
constexpr double kCarryRampS = 1.0;  // until the weight is carried in full
constexpr double kLetGoS = 0.1;      // until it is let go, once no loop renders
constexpr double kSilentS = 0.020;   // without an answer it is let go at once
constexpr double kCleanS = 0.1;      // two damaged frames within that, and the line must be clean for that
constexpr int kProbeFrames = 2;      // few: asking a Falcon without firmware may spoil the upload
constexpr int kStartFrames = 100;
constexpr double kFrameWaitS = 0.010;  // for an answer while nothing is at stake
constexpr double kBootS = 0.020;       // from the end of the upload to the first frame
constexpr std::uint8_t kAllLights = kGreenLed | kBlueLed | kRedLed;

DeviceFault lost_or_refused(UsbStatus status) {
  if (status == UsbStatus::kStopping) return {};
  if (status == UsbStatus::kLost) return {"the Falcon was unplugged"};
  return {"the Falcon's USB chip refuses the line settings; plug it directly into the computer and try again"};
}

}  // namespace

FalconProtocol::FalconProtocol(FalconSettings settings)
    : settings_(std::move(settings)), kinematics_(settings_.geometry) {
  forget();
}

void FalconProtocol::forget() noexcept {
  finder_.clear();
  unanswered_ = 0;
  sends_since_ = 0;
  homed_ = 0;
  doubted_ = false;
  withheld_ = false;
  carried_ = 0.0;
  position_m_ = settings_.centre_m;
  angles_rad_.setConstant(settings_.geometry.zero_angle_rad);
}

rtbus::Result<void, DeviceFault> FalconProtocol::bring_up(usb::Channel& channel) {
  forget();
  UsbStatus status = set_up_exchange(channel);
  if (status != UsbStatus::kOk) return rtbus::Failure{lost_or_refused(status)};

  bool running = false;
  // A forced upload is for the first start: a Falcon that is plugged in again in mid-run has that firmware.
  if (!settings_.never_probe && (!settings_.force_upload || uploaded_)) {
    status = poll_frames(channel, kProbeFrames, running);
    if (status != UsbStatus::kOk) return rtbus::Failure{lost_or_refused(status)};
  }
  damages_ = damages();  // what was damaged until now was no measurement
  if (running) return {};
  return load(channel);
}

rtbus::Result<void, DeviceFault> FalconProtocol::load(usb::Channel& channel) {
  if (!settings_.firmware) {
    const UploadAttempt attempt = handshake(channel, settings_.patience);
    if (attempt.usb == UsbStatus::kStopping || attempt.usb == UsbStatus::kLost) {
      return rtbus::Failure{lost_or_refused(attempt.usb)};
    }
    if (!attempt.heard) return rtbus::Failure{DeviceFault{no_power_message()}};
    return rtbus::Failure{
        DeviceFault{"the Falcon has no firmware since it was powered up, and the device file names none; set "
                    "firmware: to your copy of the maker's file (docs/devices.md says where to find one)"}};
  }
  const FirmwareImage& image = *settings_.firmware;
  const bool known = !image.known_as.empty();
  if (!known) spdlog::warn("{} is none of the known Falcon firmware files; loading it nevertheless", image.file);
  const auto loaded = load_firmware(channel, image, settings_.patience);
  if (!loaded) return rtbus::Failure{DeviceFault{loaded.error()}};
  upload_ = *loaded;
  uploaded_ = true;

  UsbStatus status = set_up_exchange(channel);
  if (status == UsbStatus::kOk) status = channel.sleep_until(channel.now_ns() + seconds_to_ns(kBootS));
  bool running = false;
  if (status == UsbStatus::kOk) status = poll_frames(channel, kStartFrames, running);
  if (status != UsbStatus::kOk) return rtbus::Failure{lost_or_refused(status)};
  if (!running) {
    std::string text = "the Falcon took its firmware (" + std::to_string(image.bytes.size()) +
                       " bytes, every echo right) but does not run it; ";
    text += known ? "unplug its wall power for ten seconds, plug it in again and restart"
                  : image.file + " is none of the known files: is it the right one?";
    return rtbus::Failure{DeviceFault{text}};
  }
  damages_ = damages();
  spdlog::info("Falcon: firmware loaded in {:.1f} s, attempt {}", upload_.duration_s, upload_.attempts);
  return {};
}

UsbStatus FalconProtocol::set_up_exchange(usb::Channel& channel) noexcept {
  ftdi::Port port(channel);
  UsbStatus status = port.purge();
  if (status == UsbStatus::kOk) status = port.set_format_8n1();
  if (status == UsbStatus::kOk) status = port.set_no_flow_control();
  if (status == UsbStatus::kOk) status = port.set_latency_ms(kExchangeLatencyMs);
  if (status == UsbStatus::kOk) status = port.set_event_character(kFrameEnd, settings_.event_character);
  if (status == UsbStatus::kOk) status = port.set_baud(ftdi::baud(kExchangeHz));
  if (status == UsbStatus::kOk) status = port.purge();
  finder_.clear();
  unanswered_ = 0;
  return status;
}

// Zero-force frames until one is answered by a well-formed frame.
UsbStatus FalconProtocol::poll_frames(usb::Channel& channel, int frames, bool& answered, DeviceFrame* answer) noexcept {
  answered = false;
  for (int i = 0; i < frames; ++i) {
    const std::uint64_t until_ns = channel.now_ns() + seconds_to_ns(kFrameWaitS);
    UsbStatus status = send_frame(channel, {{}, kHoming | kRedLed}, until_ns);
    while (status != UsbStatus::kLost && status != UsbStatus::kStopping) {
      DeviceFrame frame;
      if (newest_frame(frame)) {
        answered = true;
        if (answer != nullptr) *answer = frame;
        return UsbStatus::kOk;
      }
      if (channel.now_ns() >= until_ns) break;
      status = read_into_finder(channel, until_ns);
    }
    if (status == UsbStatus::kLost || status == UsbStatus::kStopping) return status;
  }
  return UsbStatus::kOk;
}

usb::Inspection FalconProtocol::inspect(usb::Channel& channel) {
  usb::Inspection out;
  out.model = "Novint Falcon";
  forget();
  DeviceFrame frame;
  UsbStatus status = set_up_exchange(channel);
  if (status == UsbStatus::kOk) status = poll_frames(channel, kProbeFrames, out.answered, &frame);
  if (status != UsbStatus::kOk) {
    out.remedy = lost_or_refused(status).message;
    return out;
  }
  if (!out.answered) {
    out.firmware = "not running (or no wall power)";
    out.homing = "not homed";
    out.remedy = "connect its wall power; the driver loads the firmware that the device file names (docs/devices.md)";
    return out;
  }
  out.firmware = "runs";
  out.homed = frame.homed == kAllHomed;
  out.homing = out.homed ? "homed" : "not homed";
  out.counters.assign(frame.encoder.begin(), frame.encoder.end());
  homed_ = frame.homed;
  out.remedy = remedy();
  shut_down(channel);  // its lights are those of a Falcon that nobody uses
  return out;
}

UsbStatus FalconProtocol::send_frame(usb::Channel& channel, const HostFrame& frame,
                                     std::uint64_t deadline_ns) noexcept {
  const FrameBytes bytes = encode(frame);
  const UsbStatus status = channel.write(bytes, deadline_ns);
  if (status == UsbStatus::kOk) ++unanswered_;
  return status;
}

UsbStatus FalconProtocol::read_into_finder(usb::Channel& channel, std::uint64_t deadline_ns) noexcept {
  std::size_t got = 0;
  const UsbStatus status = channel.read(transfer_, got, deadline_ns);
  if (status == UsbStatus::kOk) {
    const std::uint64_t errors = ftdi::for_each_payload(
        std::span(transfer_).first(got), [this](std::span<const std::uint8_t> part) { finder_.push(part); });
    counters_.line_errors += errors;
    payload_errors_ += errors;
    counters_.resyncs = finder_.resyncs();
  } else if (status == UsbStatus::kStall || status == UsbStatus::kError) {
    ++counters_.line_errors;
  }
  return status;
}

bool FalconProtocol::newest_frame(DeviceFrame& out) noexcept {
  bool found = false;
  FrameBytes bytes;
  while (finder_.next(bytes)) {
    unanswered_ = std::max(0, unanswered_ - 1);
    if (decode(bytes, out)) {
      found = true;
    } else {
      ++counters_.bad_frames;
    }
  }
  counters_.resyncs = finder_.resyncs();
  return found;
}

// Frames carry no number. After a time-out the missing answer may come late; were it taken for the answer to the next
// command, every later sample would be one exchange old for good.
void FalconProtocol::discard_late_answers(usb::Channel& channel) noexcept {
  constexpr int kMaxTransfers = 8;
  constexpr int kForgetAfterSends = 16;
  for (int i = 0; i < kMaxTransfers && unanswered_ > 0; ++i) {
    if (read_into_finder(channel, channel.now_ns()) != UsbStatus::kOk) break;
    DeviceFrame late;
    (void)newest_frame(late);
  }
  if (unanswered_ == 0) {
    sends_since_ = 0;
  } else if (++sends_since_ > kForgetAfterSends) {  // it is lost, not late
    unanswered_ = 0;
    sends_since_ = 0;
  }
}

UsbStatus FalconProtocol::send(usb::Channel& channel, const Vec3& force_n, double dt_s,
                               std::uint64_t deadline_ns) noexcept {
  discard_late_answers(channel);
  HostFrame frame;
  const bool asked = force_n != Vec3{};
  if (homed_ == kAllHomed) {
    frame.flags = static_cast<std::uint8_t>(kGreenLed | (settings_.keep_homing_flag ? kHoming : 0));
    // The weight is carried only while somebody answers for it: a loop that renders, a device that says where it is.
    if (channel.now_ns() > accepted_ns_ + seconds_to_ns(kSilentS)) {
      carried_ = 0.0;
    } else if (live_) {
      carried_ = std::min(1.0, carried_ + std::max(0.0, dt_s) / kCarryRampS);
    } else {
      carried_ = std::max(0.0, carried_ - std::max(0.0, dt_s) / kLetGoS);
    }
    Eigen::Vector3d force(force_n[0], force_n[1], force_n[2]);
    if (!force.allFinite()) {
      force.setZero();
      ++counters_.clamped;
    }
    force.y() += carried_ * settings_.grip_mass_kg * kGravityM_s2;
    if (const double norm = force.norm(); norm > settings_.max_force_n) {
      force *= settings_.max_force_n / norm;
      ++counters_.clamped;
    }
    const MotorCommands commands =
        commands_for_force(kinematics_, position_m_, angles_rad_, force, settings_.command_gain);
    if (commands.limited) ++counters_.clamped;
    frame.motor = commands.count;
    // Refused as a whole: not finite, or no motor commands make it where the grip is.
    withheld_ = asked && commands.limited && commands.count == std::array<std::int16_t, 3>{};
  } else {
    frame.flags = kHoming | kRedLed;
    carried_ = 0.0;
    withheld_ = asked;
  }
  return send_frame(channel, frame, deadline_ns);
}

ExchangeStatus FalconProtocol::receive(usb::Channel& channel, DeviceSample& out, std::uint64_t deadline_ns) noexcept {
  constexpr int kMaxTransfers = 1000;  // a device that floods the line must not hold the thread
  for (int i = 0; i < kMaxTransfers; ++i) {
    DeviceFrame frame;
    // One command, one answer: behind one that is not believed comes no other.
    const bool found = newest_frame(frame);
    const std::uint64_t now_ns = channel.now_ns();
    note_damage(now_ns);
    if (found) {
      const bool believed = now_ns >= doubted_until_ns_ && accept(frame, now_ns, out);
      return believed ? ExchangeStatus::kSample : ExchangeStatus::kNothing;
    }
    switch (read_into_finder(channel, deadline_ns)) {
      case UsbStatus::kOk:
        break;
      case UsbStatus::kLost:
        return ExchangeStatus::kLost;
      case UsbStatus::kStopping:
        return ExchangeStatus::kStopping;
      case UsbStatus::kTimeout:
        ++counters_.lost_frames;
        return ExchangeStatus::kNothing;
      case UsbStatus::kStall:
      case UsbStatus::kError:
        if (channel.now_ns() < deadline_ns) break;
        ++counters_.lost_frames;
        return ExchangeStatus::kNothing;
    }
  }
  ++counters_.lost_frames;
  return ExchangeStatus::kNothing;
}

void FalconProtocol::note_damage(std::uint64_t now_ns) noexcept {
  const std::uint64_t more = damages() - std::exchange(damages_, damages());
  if (more == 0) return;
  if (more > 1 || now_ns < damaged_ns_ + seconds_to_ns(kCleanS)) doubted_until_ns_ = now_ns + seconds_to_ns(kCleanS);
  damaged_ns_ = now_ns;
}

bool FalconProtocol::accept(const DeviceFrame& frame, std::uint64_t now_ns, DeviceSample& out) noexcept {
  // A wrong bit on the line looks like that once; a Falcon that has lost its homing goes on saying so. The frame's
  // encoders may be of either kind, so it is no measurement.
  const bool lost_homing = homed_ == kAllHomed && frame.homed != kAllHomed;
  if (lost_homing && !std::exchange(doubted_, true)) {
    ++counters_.bad_frames;
    ++damages_;  // no more is made of it than that
    return false;
  }
  doubted_ = false;
  const Counts counts{frame.encoder[0], frame.encoder[1], frame.encoder[2]};
  const Eigen::Vector3d angles_rad = kinematics_.angles_rad(counts);
  const auto position_m = kinematics_.position_m(angles_rad);
  if (position_m) {
    angles_rad_ = angles_rad;
    position_m_ = *position_m;
  } else if (frame.homed == kAllHomed) {
    ++counters_.bad_frames;  // well-formed, but no grip can be there
    return false;
  }
  homed_ = frame.homed;
  accepted_ns_ = now_ns;
  out = DeviceSample{};
  out.position_m = rtbus::array_of(Eigen::Vector3d(position_m_ - settings_.centre_m));
  out.buttons = frame.buttons;
  out.time_ns = now_ns;
  ++counters_.exchanges;
  return true;
}

void FalconProtocol::shut_down(usb::Channel& channel) noexcept {
  // Twice, for one could be lost; then an answer shows that the zero has arrived.
  constexpr double kWaitS = 0.020;
  for (int i = 0; i < 2; ++i) {
    discard_late_answers(channel);
    const std::uint64_t until_ns = channel.now_ns() + seconds_to_ns(kWaitS);
    const std::uint8_t homing = settings_.keep_homing_flag ? kHoming : 0;
    if (send_frame(channel, {{}, static_cast<std::uint8_t>(kAllLights | homing)}, until_ns) != UsbStatus::kOk) return;
    DeviceFrame frame;
    while (!newest_frame(frame) && read_into_finder(channel, until_ns) == UsbStatus::kOk) {
    }
  }
}

std::string FalconProtocol::remedy() const {
  if (homed_ == kAllHomed) return {};
  return "home the Falcon: pull the grip all the way out, then push it straight all the way in; its light turns green";
}

}  // namespace drivers::falcon
