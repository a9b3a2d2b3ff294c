#include "drivers/virtual_devices/phantom/virtual_phantom.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>
#include <utility>

namespace drivers::virtual_usb {
namespace {

constexpr std::uint64_t kUs = 1'000;
constexpr std::uint64_t kMs = 1'000'000;
constexpr std::uint64_t kParseNs = 20 * kUs;  // own estimate: until the main loop looks at its queue
constexpr std::uint64_t kLoopNs = 50 * kUs;   // own estimate: one turn of it
constexpr std::uint64_t kFlushNs = 75 * kUs;  // the core's, for a packet that is not full
constexpr std::uint64_t kUnreadNs = 120 * kMs;
constexpr std::uint64_t kArmStepNs = 1 * kMs;
constexpr std::uint32_t kBootLoaderBaud = 134;
constexpr std::uint8_t kSetLineCoding = 0x20, kGetLineCoding = 0x21, kSetLineState = 0x22, kSendBreak = 0x23;

std::u16string wide(std::string_view text) { return {text.begin(), text.end()}; }

Descriptors make_descriptors(bool high_speed, const std::string& serial) {
  const std::uint8_t low = high_speed ? 0x00 : 0x40;  // 512 or 64 byte packets
  const std::uint8_t high = high_speed ? 0x02 : 0x00;
  Descriptors d;
  d.high_speed = high_speed;
  d.strings = {wide("Teensyduino"), wide("USB Serial"), wide(serial)};
  d.device = {18, 1, 0x00, 0x02, 0xEF, 0x02, 0x01, 64, 0xC0, 0x16, 0x83, 0x04, 0x79, 0x02, 1, 2, 3, 1};
  d.configuration = {
      9, 2,    75,   0,    2,    1,    0,    0xC0, 50,  // configuration: two interfaces, self-powered, 100 mA
      8, 11,   0,    2,    0x02, 0x02, 0x01, 0,         // the two belong together
      9, 4,    0,    0,    1,    0x02, 0x02, 0x01, 0,   // interface 0: CDC, abstract control
      5, 0x24, 0x00, 0x10, 0x01,                        // header 1.10
      5, 0x24, 0x01, 0x01, 1,                           // call management, over interface 1
      4, 0x24, 0x02, 0x06,                              // abstract control: line coding, break
      5, 0x24, 0x06, 0,    1,                           // union 0 → 1
      7, 5,    0x82, 3,    16,   0,    5,               // notifications
      9, 4,    1,    0,    2,    0x0A, 0x00, 0x00, 0,   // interface 1: data
      7, 5,    0x03, 2,    low,  high, 0,               // bulk OUT
      7, 5,    0x84, 2,    low,  high, 0,               // bulk IN
  };
  d.configuration[2] = static_cast<std::uint8_t>(d.configuration.size());
  return d;
}

}  // namespace

simulated::MechanicsParameters mechanics_of(const phantom::Model& model) {
  simulated::MechanicsParameters m;
  m.mass_kg = model.limits.apparent_mass_kg;
  m.viscous_n_s_per_m = model.limits.viscous_damping_n_s_per_m / 0.8;  // the limits promise less than there is
  m.coulomb_n = model.limits.coulomb_friction_n / 0.8;
  m.gravity_m_s2.setZero();
  m.start_position_m.setZero();
  return m;
}

VirtualPhantom::VirtualPhantom(VirtualPhantomSettings settings)
    : settings_(std::move(settings)),
      descriptors_(make_descriptors(settings_.high_speed, settings_.serial)),
      arm_(settings_.model, settings_.mechanics, settings_.hand),
      firmware_(static_cast<int>(settings_.model.id), settings_.model.gimbal == phantom::GimbalKind::kMagnetic,
                settings_.calibration_needed),
      packet_bytes_(settings_.high_speed ? 512 : 64),
      dice_(settings_.seed) {}

void VirtualPhantom::begin(std::uint64_t now_ns) {
  if (std::exchange(begun_, true)) return;
  power_up_ns_ = moved_to_ns_ = next_loop_ns_ = now_ns;
  arm_.reset(now_ns);
  if (settings_.zeroed_at_home) {
    firmware_.power_up({}, {});
  } else {
    firmware_.power_up(arm_.counts(), gimbal_counts());
  }
}

void VirtualPhantom::power_cycle(std::uint64_t now_ns) {
  begin(now_ns);
  move_arm(now_ns);
  firmware_.power_up(arm_.counts(), gimbal_counts());
  transmit_.clear();
  held_back_.clear();
  in_boot_loader_ = false;
}

double VirtualPhantom::since_power_up_s(std::uint64_t now_ns) const noexcept {
  return static_cast<double>(now_ns - power_up_ns_) * 1e-9;
}

bool VirtualPhantom::paused(std::uint64_t now_ns) const noexcept {
  const Faults& f = settings_.faults;
  if (f.pause_at_s < 0.0) return false;
  const double t_s = since_power_up_s(now_ns);
  return t_s >= f.pause_at_s && t_s < f.pause_at_s + f.pause_ms * 1e-3;
}

bool VirtualPhantom::strikes(double share) noexcept {
  if (share <= 0.0) return false;
  // SplitMix64, as in the mechanics: runs repeat bit by bit.
  dice_ += 0x9e3779b97f4a7c15ULL;
  std::uint64_t z = dice_;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  z ^= z >> 31;
  return static_cast<double>(z >> 11) * 0x1p-53 < share;
}

std::array<std::int32_t, 3> VirtualPhantom::gimbal_counts() const {
  std::array<std::int32_t, 3> out{};
  const phantom::Model& m = settings_.model;
  if (m.gimbal == phantom::GimbalKind::kNone) return out;
  for (std::size_t i = 0; i < 3; ++i) {
    out[i] = static_cast<std::int32_t>(
                 std::lround(settings_.gimbal_rad[i] / (2.0 * std::numbers::pi) * m.gimbal_counts_per_turn)) -
             m.gimbal_home_counts[i];
  }
  return out;
}

void VirtualPhantom::move_arm(std::uint64_t now_ns) {
  while (moved_to_ns_ < now_ns) {
    moved_to_ns_ = std::min(now_ns, moved_to_ns_ + kArmStepNs);
    firmware_.watchdog(moved_to_ns_);
    arm_.advance_to(moved_to_ns_, in_boot_loader_ ? std::array<double, 3>{} : firmware_.currents_ma());
    const Faults& f = settings_.faults;
    const double t_s = since_power_up_s(moved_to_ns_);
    if (settings_.forgets_when_unplugged && f.unplug_at_s >= 0.0 && t_s >= f.unplug_at_s &&
        !std::exchange(forgot_, true)) {
      firmware_.power_up(arm_.counts(), gimbal_counts());
    }
    bool pressed = button_held_;
    if (settings_.button_at_s >= 0.0 && script_begun_) {
      const double script_s = static_cast<double>(moved_to_ns_ - script_ns_) * 1e-9;
      pressed = pressed || (script_s >= settings_.button_at_s && script_s < settings_.button_at_s + 0.05);
    }
    firmware_.button(moved_to_ns_, pressed, arm_.counts(), gimbal_counts());
  }
}

void VirtualPhantom::work_until(std::uint64_t now_ns) {
  while (firmware_.has_input() && next_loop_ns_ <= now_ns && !in_boot_loader_) {
    const std::uint64_t t_ns = next_loop_ns_;
    if (paused(t_ns)) {
      const double end_s = settings_.faults.pause_at_s + settings_.faults.pause_ms * 1e-3;
      next_loop_ns_ = power_up_ns_ + static_cast<std::uint64_t>(end_s * 1e9) + kUs;
      continue;
    }
    move_arm(t_ns);
    next_loop_ns_ = t_ns + kLoopNs;
    auto reply = firmware_.loop(t_ns, arm_.counts(), gimbal_counts());
    if (!reply) continue;
    if (!script_begun_) {
      // Nobody takes a device in hand before its software runs.
      script_begun_ = true;
      script_ns_ = t_ns;
      arm_.begin_script(t_ns);
    }
    write(std::move(*reply), t_ns);
  }
  move_arm(now_ns);
}

void VirtualPhantom::damage(std::string& bytes) {
  for (char& byte : bytes) {
    if (strikes(settings_.faults.flip_reply_bit)) byte = static_cast<char>(byte ^ 0x04);
  }
}

void VirtualPhantom::write(std::string reply, std::uint64_t now_ns) {
  const Faults& f = settings_.faults;
  if (f.mute || strikes(f.lose_reply)) return;
  if (!transmit_.empty() && now_ns >= unread_since_ns_ + kUnreadNs) {
    ++dropped_unread_;
    return;
  }
  damage(reply);
  if (strikes(f.merge_reply)) {
    held_back_ += reply;
    return;
  }
  reply = std::exchange(held_back_, {}) + reply;
  std::uint64_t ready_ns = now_ns + kFlushNs;
  if (strikes(f.late_reply)) ready_ns += static_cast<std::uint64_t>(f.late_ms * 1e6);
  if (transmit_.empty()) unread_since_ns_ = now_ns;
  if (strikes(f.split_reply)) {
    const std::size_t half = reply.size() / 2;
    transmit_.push_back({reply.substr(0, half), ready_ns, true});
    transmit_.push_back({reply.substr(half), ready_ns + kFlushNs, true});
    return;
  }
  // Written on before it was flushed: one packet, flushed later.
  if (!transmit_.empty() && !transmit_.back().alone && transmit_.back().ready_ns > now_ns &&
      transmit_.back().bytes.size() + reply.size() <= packet_bytes_) {
    transmit_.back().bytes += reply;
    transmit_.back().ready_ns = std::max(transmit_.back().ready_ns, ready_ns);
    return;
  }
  transmit_.push_back({std::move(reply), ready_ns, false});
}

PacketReply VirtualPhantom::control(const usb::Setup& setup, std::span<const std::uint8_t> data, std::uint16_t length,
                                    std::uint64_t now_ns) {
  begin(now_ns);
  work_until(now_ns);
  PacketReply out;
  if (setup.request_type == 0x21 && setup.request == kSetLineCoding && data.size() == line_coding_.size()) {
    std::copy(data.begin(), data.end(), line_coding_.begin());
    const std::uint32_t baud = data[0] | data[1] << 8 | data[2] << 16 | static_cast<std::uint32_t>(data[3]) << 24;
    if (baud == kBootLoaderBaud) {
      in_boot_loader_ = true;
      transmit_.clear();
    }
    return out;
  }
  if (setup.request_type == 0x21 && (setup.request == kSetLineState || setup.request == kSendBreak)) return out;
  if (setup.request_type == 0xA1 && setup.request == kGetLineCoding) {
    out.bytes.assign(line_coding_.begin(), line_coding_.end());
    if (out.bytes.size() > length) out.bytes.resize(length);
    return out;
  }
  out.reply = Reply::kStall;
  return out;
}

PacketReply VirtualPhantom::out_packet(std::uint8_t endpoint, std::span<const std::uint8_t> bytes,
                                       std::uint64_t now_ns) {
  begin(now_ns);
  work_until(now_ns);
  PacketReply out;
  if (endpoint != kOutEndpoint || in_boot_loader_) {
    out.reply = endpoint == kOutEndpoint ? Reply::kNak : Reply::kStall;
    return out;
  }
  if (!firmware_.has_input()) next_loop_ns_ = std::max(next_loop_ns_, now_ns + kParseNs);
  // An overrun line loses the rest of a packet now and then.
  constexpr std::uint64_t kOverrunEvery = 20;
  const bool overrun = settings_.faults.overrun && ++commands_seen_ % kOverrunEvery == 0;
  firmware_.receive(overrun ? bytes.first(bytes.size() / 2) : bytes);
  return out;
}

PacketReply VirtualPhantom::in_packet(std::uint8_t endpoint, std::uint64_t now_ns) {
  begin(now_ns);
  work_until(now_ns);
  PacketReply out;
  out.reply = Reply::kNak;
  if (endpoint == kNotifyEndpoint || in_boot_loader_) return out;
  if (endpoint != kInEndpoint) {
    out.reply = Reply::kStall;
    return out;
  }
  if (transmit_.empty() || transmit_.front().ready_ns > now_ns) {
    if (settings_.faults.status_flood) {
      out.reply = Reply::kAck;  // an empty packet, as fast as asked for
      return out;
    }
    if (!transmit_.empty()) out.retry_ns = transmit_.front().ready_ns;
    if (firmware_.has_input()) {
      out.retry_ns = out.retry_ns == 0 ? next_loop_ns_ : std::min(out.retry_ns, next_loop_ns_);
    }
    return out;
  }
  if (strikes(settings_.faults.stall_in)) {
    out.reply = Reply::kStall;
    return out;
  }
  out.reply = Reply::kAck;
  std::string& bytes = transmit_.front().bytes;
  const std::size_t count = std::min(packet_bytes_, bytes.size());
  out.bytes.assign(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count));
  bytes.erase(0, count);
  if (bytes.empty()) transmit_.pop_front();
  unread_since_ns_ = now_ns;
  return out;
}

void VirtualPhantom::bus_reset(std::uint64_t now_ns) {
  begin(now_ns);
  work_until(now_ns);
  transmit_.clear();
}

void VirtualPhantom::advance_to(std::uint64_t now_ns) {
  begin(now_ns);
  work_until(now_ns);
}

}  // namespace drivers::virtual_usb
