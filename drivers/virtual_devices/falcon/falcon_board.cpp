#include "drivers/virtual_devices/falcon/falcon_board.hpp"

#include <algorithm>
#include <cmath>

namespace drivers::virtual_usb {
namespace {

constexpr double kLoaderHz = 9600.0;
constexpr double kRunningHz = 1.5e6;
constexpr double kFastestAutoBaudHz = 250e3;
constexpr std::array<std::uint8_t, 3> kQuestion{0x0A, 'C', 0x0D};
constexpr std::array<std::uint8_t, 4> kAnswer{0x0A, 'D', ',', 0x0D};

}  // namespace

bool same_rate(double a_hz, double b_hz) noexcept { return std::abs(a_hz - b_hz) <= 0.03 * b_hz; }

std::uint64_t byte_time_ns(double baud_hz) noexcept {
  return baud_hz > 0.0 ? static_cast<std::uint64_t>(std::llround(1e10 / baud_hz)) : 1'000'000;
}

std::string_view name_of(FalconState state) noexcept {
  switch (state) {
    case FalconState::kLoader:
      return "loader";
    case FalconState::kAutoBaud:
      return "auto-baud";
    case FalconState::kStream:
      return "boot stream";
    case FalconState::kRunning:
      return "running";
    case FalconState::kStuck:
      return "stuck";
  }
  return "?";
}

FalconBoard::FalconBoard(FalconArm& arm, const FalconBoardSettings& settings)
    : arm_(arm), settings_(settings), random_(settings.seed) {}

void FalconBoard::power_up(std::uint64_t now_ns) {
  powered_ns_ = now_ns;
  state_ = FalconState::kLoader;
  dtr_ = false;
  answered_ = false;
  question_ = 0;
  deaf_ = draw(settings_.faults.fail_handshake);
  outgoing_.clear();
  line_free_ns_ = now_ns;
  finder_.clear();
  holding_ = false;
}

// No draw without a share: a device without faults uses no random numbers.
bool FalconBoard::draw(double share) {
  if (share <= 0.0) return false;
  return static_cast<double>(random_() >> 11) * 0x1p-53 < share;
}

void FalconBoard::set_dtr(bool high, std::uint64_t now_ns) {
  const bool rising = high && !dtr_;
  const bool falling = !high && dtr_;
  dtr_ = high;
  if (rising) {
    state_ = FalconState::kLoader;
    answered_ = false;
    question_ = 0;
    deaf_ = draw(settings_.faults.fail_handshake);
    outgoing_.clear();
    line_free_ns_ = now_ns;
    holding_ = false;
    arm_.forget_homing();
  } else if (falling && state_ == FalconState::kLoader && answered_) {
    state_ = FalconState::kAutoBaud;
  }
}

void FalconBoard::send(std::uint8_t byte, double baud_hz, std::uint64_t from_ns, bool ends_reply, bool may_split) {
  line_free_ns_ = std::max(line_free_ns_, from_ns) + byte_time_ns(baud_hz);
  outgoing_.push_back({line_free_ns_, byte, baud_hz, ends_reply, may_split});
}

void FalconBoard::receive(std::uint8_t byte, double baud_hz, std::uint64_t time_ns) {
  if (settings_.faults.mute) return;
  switch (state_) {
    case FalconState::kLoader:
      if (same_rate(baud_hz, kLoaderHz)) hear_question(byte, time_ns);
      return;
    case FalconState::kAutoBaud:
      if ((byte == 'A' || byte == 'a') && baud_hz <= kFastestAutoBaudHz) {
        locked_hz_ = baud_hz;
        stream_ = {};
        state_ = FalconState::kStream;
        send(byte, baud_hz, time_ns);
      }
      return;
    case FalconState::kStream:
      // At another rate the ROM reads something, but not what was sent.
      hear_stream(same_rate(baud_hz, locked_hz_) ? byte : static_cast<std::uint8_t>(byte ^ 0x55), time_ns);
      return;
    case FalconState::kRunning: {
      if (!same_rate(baud_hz, kRunningHz) || time_ns < runs_from_ns_) return;
      finder_.push({&byte, 1});
      falcon::FrameBytes bytes;
      falcon::HostFrame frame;
      while (finder_.next(bytes)) {
        if (decode(bytes, frame)) answer(frame, time_ns);
      }
      return;
    }
    case FalconState::kStuck:
      return;
  }
}

void FalconBoard::hear_question(std::uint8_t byte, std::uint64_t time_ns) {
  question_ = byte == kQuestion[question_] ? question_ + 1 : byte == kQuestion[0] ? 1 : 0;
  if (question_ < kQuestion.size()) return;
  question_ = 0;
  if (deaf_) return;
  answered_ = true;
  for (const std::uint8_t each : kAnswer) send(each, kLoaderHz, time_ns);
}

void FalconBoard::hear_stream(std::uint8_t byte, std::uint64_t time_ns) {
  std::uint8_t echo = byte;
  if (draw(settings_.faults.flip_echo_bit)) echo ^= static_cast<std::uint8_t>(1U << (random_() % 8));
  send(echo, locked_hz_, time_ns);
  switch (stream_.feed(byte)) {
    case falcon::BootStreamReader::State::kReading:
      return;
    case falcon::BootStreamReader::State::kMalformed:
      state_ = FalconState::kStuck;
      return;
    case falcon::BootStreamReader::State::kComplete:
      state_ = FalconState::kRunning;
      runs_from_ns_ = time_ns + settings_.boot_ns;
      finder_.clear();
      ++uploads_;
      return;
  }
}

void FalconBoard::answer(const falcon::HostFrame& frame, std::uint64_t time_ns) {
  const Faults& faults = settings_.faults;
  if (faults.pause_at_s >= 0.0) {
    const double t_s = static_cast<double>(time_ns - powered_ns_) * 1e-9;
    if (t_s >= faults.pause_at_s && t_s < faults.pause_at_s + faults.pause_ms * 1e-3) {
      ++lost_replies_;
      return;
    }
  }
  ++frames_;
  flags_ = frame.flags;
  commands_ = frame.motor;
  arm_.frame_received((frame.flags & falcon::kHoming) != 0, time_ns);
  arm_.set_commands(frame.motor, time_ns);
  if (draw(faults.lose_reply)) {
    ++lost_replies_;
    return;
  }
  falcon::DeviceFrame reply;
  reply.encoder = arm_.encoders();
  reply.homed = arm_.homed();
  reply.buttons = static_cast<std::uint8_t>(arm_.buttons() & 0x0FU);
  falcon::FrameBytes bytes = encode(reply);
  for (std::uint8_t& byte : bytes) {
    if (draw(faults.flip_reply_bit)) byte ^= static_cast<std::uint8_t>(1U << (random_() % 8));
  }
  if (!holding_ && draw(faults.merge_reply)) {
    holding_ = true;
    held_ = bytes;
    return;
  }
  std::uint64_t from_ns = time_ns + settings_.turnaround_ns;
  if (draw(faults.late_reply)) from_ns += static_cast<std::uint64_t>(faults.late_ms * 1e6);
  const bool split = draw(faults.split_reply);
  if (holding_) send_reply(held_, from_ns, false);
  holding_ = false;
  send_reply(bytes, from_ns, split);
}

// A split reply rests after 14 bytes for longer than the latency timer.
void FalconBoard::send_reply(const falcon::FrameBytes& bytes, std::uint64_t from_ns, bool split) {
  constexpr std::size_t kFirstPart = 14;
  constexpr std::uint64_t kRestNs = 1'300'000;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    if (split && i == kFirstPart) line_free_ns_ += kRestNs;
    send(bytes[i], kRunningHz, from_ns, i + 1 == bytes.size(), split && i + 1 == kFirstPart);
  }
}

}  // namespace drivers::virtual_usb
