#include "drivers/virtual_devices/phantom/phantom_firmware.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace drivers::virtual_usb {
namespace {

using phantom::ErrorBit;

constexpr std::size_t kLineBytes = 127;
constexpr std::size_t kQueueBytes = 2048;  // the USB stack stops taking packets beyond; never reached by a driver

bool is_line_end(std::uint8_t c) { return c == '\n' || c == '\r' || c == '\0'; }

// A C decimal integer, blanks before it tolerated, nothing after it.
bool parse_number(std::string_view text, int& out) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  if (text.starts_with('+')) text.remove_prefix(1);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out);
  return error == std::errc{} && end == text.data() + text.size();
}

// Wrap-around arithmetic of the 32-bit counters.
std::int32_t difference(std::int32_t a, std::int32_t b) {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(a) - static_cast<std::uint32_t>(b));
}

}  // namespace

PhantomFirmware::PhantomFirmware(int model, bool magnetic_gimbal, bool calibration_needed)
    : model_(model), magnetic_gimbal_(magnetic_gimbal), calibration_needed_(calibration_needed) {}

void PhantomFirmware::receive(std::span<const std::uint8_t> bytes) {
  const std::size_t room = kQueueBytes - std::min(kQueueBytes, queue_.size());
  const std::size_t taken = std::min(room, bytes.size());
  queue_.insert(queue_.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(taken));
}

std::uint32_t PhantomFirmware::parse_line() {
  const std::size_t open = line_.find('[');
  if (open == std::string::npos) return ErrorBit::kClosedBeforeOpened;
  if (std::count(line_.begin(), line_.end(), ',') != 2) return ErrorBit::kWrongCommaCount;
  std::string_view rest(line_);
  rest = rest.substr(open + 1, rest.size() - open - 2);  // without the brackets
  phantom::CurrentsMa numbers{};
  for (int& number : numbers) {
    const std::size_t comma = rest.find(',');
    if (!parse_number(rest.substr(0, comma), number)) return ErrorBit::kNumberUnparsable;
    rest = comma == std::string_view::npos ? std::string_view{} : rest.substr(comma + 1);
  }
  parsed_ = numbers;
  return 0;
}

std::optional<std::uint32_t> PhantomFirmware::read_line() {
  while (!queue_.empty()) {
    const std::uint8_t byte = queue_.front();
    queue_.pop_front();
    line_ += static_cast<char>(byte);
    if (byte == ']') {
      std::uint32_t errors = 0;
      while (!queue_.empty() && errors == 0) {
        if (!is_line_end(queue_.front())) errors = ErrorBit::kTrailingCharacters;
        queue_.pop_front();
      }
      if (errors == 0) errors = parse_line();
      line_.clear();
      return errors;
    }
    if (line_.size() >= kLineBytes) {
      line_.clear();
      return ErrorBit::kBufferFull;
    }
  }
  return std::nullopt;
}

std::optional<std::string> PhantomFirmware::loop(std::uint64_t now_ns, const std::array<std::int32_t, 3>& arm,
                                                 const std::array<std::int32_t, 3>& gimbal) {
  watchdog(now_ns);
  // One sensor per turn: each is a third as fresh as the arm's counters. Encoders are all read at once.
  if (magnetic_gimbal_) {
    read_gimbal_[next_gimbal_] = gimbal[next_gimbal_];
    next_gimbal_ = (next_gimbal_ + 1) % 3;
  } else {
    read_gimbal_ = gimbal;
  }
  const std::optional<std::uint32_t> errors = read_line();
  if (!errors) return std::nullopt;
  if (*errors != 0) {
    ++rejected_;
    return answer(*errors);
  }
  ++accepted_;
  fed_ns_ = now_ns;
  amplifiers_on_ = !calibration_needed_;
  for (std::size_t i = 0; i < 3; ++i) {
    commanded_ma_[i] = std::abs(static_cast<long>(parsed_[i])) > phantom::kFirmwareLimitMa ? 0 : parsed_[i];
    shown_arm_[i] = difference(arm[i], arm_zero_[i]);
    shown_gimbal_[i] = difference(read_gimbal_[i], gimbal_zero_[i]);
    if (magnetic_gimbal_) shown_gimbal_[i] &= 1023;
  }
  if (calibration_needed_) {
    ++answers_;
    shown_arm_ = {static_cast<std::int32_t>(8000.0 + 4000.0 * std::sin(0.0002 * static_cast<double>(answers_))),
                  commanded_ma_[0], 0};
  }
  return answer(gimbal_errors_);
}

std::string PhantomFirmware::answer(std::uint32_t errors) {
  std::string out = "[" + std::to_string(model_);
  for (const std::int32_t count : shown_arm_) out += "," + std::to_string(count);
  for (const std::int32_t count : shown_gimbal_) out += "," + std::to_string(count);
  return out + "," + std::to_string(errors) + "]\n";
}

void PhantomFirmware::watchdog(std::uint64_t now_ns) noexcept {
  if (!amplifiers_on_ || now_ns < fed_ns_ + kWatchdogNs) return;
  amplifiers_on_ = false;
  ++watchdog_trips_;
}

void PhantomFirmware::zero(const std::array<std::int32_t, 3>& arm, const std::array<std::int32_t, 3>& gimbal) noexcept {
  arm_zero_ = arm;
  gimbal_zero_ = gimbal;
}

void PhantomFirmware::button(std::uint64_t now_ns, bool pressed, const std::array<std::int32_t, 3>& arm,
                             const std::array<std::int32_t, 3>& gimbal) noexcept {
  if (!pressed) {
    pressed_ = false;
    return;
  }
  if (!pressed_) {
    pressed_ = true;
    pressed_since_ns_ = now_ns;
  }
  if (now_ns < pressed_since_ns_ + kDebounceNs) return;
  zero(arm, gimbal);
  calibration_needed_ = false;
}

void PhantomFirmware::power_up(const std::array<std::int32_t, 3>& arm,
                               const std::array<std::int32_t, 3>& gimbal) noexcept {
  zero(arm, gimbal);
  queue_.clear();
  line_.clear();
  commanded_ma_ = {};
  shown_arm_ = {};
  shown_gimbal_ = {};
  amplifiers_on_ = false;
}

std::array<double, 3> PhantomFirmware::currents_ma() const noexcept {
  std::array<double, 3> out{};
  if (!amplifiers_on_) return out;
  // Duty 0.5 + 0.4·mA/6000 of 8191 steps.
  constexpr double kStepMa = 6000.0 / (0.4 * 8191.0);
  for (std::size_t i = 0; i < 3; ++i) out[i] = std::round(commanded_ma_[i] / kStepMa) * kStepMa;
  return out;
}

}  // namespace drivers::virtual_usb
