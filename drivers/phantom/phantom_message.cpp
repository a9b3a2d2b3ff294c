#include "drivers/phantom/phantom_message.hpp"

#include <charconv>
#include <cstdlib>
#include <utility>

namespace drivers::phantom {

std::string describe_errors(std::uint32_t errors) {
  constexpr std::pair<std::uint32_t, const char*> kNames[] = {
      {kGimbal0Failed, "gimbal sensor 0 does not answer"},
      {kGimbal1Failed, "gimbal sensor 1 does not answer"},
      {kGimbal2Failed, "gimbal sensor 2 does not answer"},
      {kTrailingCharacters, "trailing characters"},
      {kBufferFull, "line buffer full"},
      {kClosedBeforeOpened, "']' before '['"},
      {kWrongCommaCount, "wrong comma count"},
      {kNumberUnparsable, "number not readable"},
  };
  if (errors == 0) return "none";
  std::string out;
  for (const auto& [bit, name] : kNames) {
    if ((errors & bit) == 0) continue;
    if (!out.empty()) out += ", ";
    out += name;
    errors &= ~bit;
  }
  if (errors != 0) {
    if (!out.empty()) out += ", ";
    out += "unknown bits " + std::to_string(errors);
  }
  return out;
}

bool encode(const CurrentsMa& currents_ma, Command& out) noexcept RTBUS_NONBLOCKING {
  out.length = 0;
  for (const int current : currents_ma) {
    if (current > kFirmwareLimitMa || current < -kFirmwareLimitMa) return false;
  }
  char* at = reinterpret_cast<char*>(out.bytes.data());
  char* const end = at + out.bytes.size();
  char separator = '[';
  for (const int current : currents_ma) {
    *at++ = separator;
    at = std::to_chars(at, end, current).ptr;  // 5 characters at most: it always fits
    separator = ',';
  }
  *at++ = ']';
  *at++ = '\n';
  out.length = static_cast<std::size_t>(at - reinterpret_cast<char*>(out.bytes.data()));
  return true;
}

bool parse_reply(std::span<const char> text, Reply& out) noexcept RTBUS_NONBLOCKING {
  std::array<std::int32_t, 8> numbers{};
  const char* at = text.data();
  const char* const end = at + text.size();
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (i > 0) {
      if (at == end || *at != ',') return false;
      ++at;
    }
    const auto [next, error] = std::from_chars(at, end, numbers[i]);
    if (error != std::errc{}) return false;
    at = next;
  }
  if (at != end || numbers[7] < 0) return false;
  out.model = numbers[0];
  for (std::size_t i = 0; i < 3; ++i) {
    out.arm[i] = numbers[1 + i];
    out.gimbal[i] = numbers[4 + i];
  }
  out.errors = static_cast<std::uint32_t>(numbers[7]);
  return true;
}

ReplyDecoder::Event ReplyDecoder::take(std::uint8_t byte, Reply& out) noexcept RTBUS_NONBLOCKING {
  const char c = static_cast<char>(byte);
  if (c == '[') {
    const bool cut = std::exchange(inside_, true);
    length_ = 0;
    if (cut || std::exchange(in_garbage_, false)) ++resyncs_;
    return cut ? Event::kBadReply : Event::kNone;
  }
  if (!inside_) {
    if (c == '\n' || c == '\r' || c == '\0') return Event::kNone;
    ++garbage_;
    in_garbage_ = true;
    return Event::kNone;
  }
  if (c == ']') {
    inside_ = false;
    return parse_reply({text_.data(), length_}, out) ? Event::kReply : Event::kBadReply;
  }
  const bool possible = (c >= '0' && c <= '9') || c == '-' || c == ',';
  if (!possible || length_ == kLongest) {
    inside_ = false;
    in_garbage_ = true;  // what is left of it
    ++garbage_;
    return Event::kBadReply;
  }
  text_[length_++] = c;
  return Event::kNone;
}

}  // namespace drivers::phantom
