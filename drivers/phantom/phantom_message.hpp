#pragma once
/// @file phantom_message.hpp
/// The bracketed text of the open PHANToM-class controllers (Teensy firmware of the WoodenHaptics family, fourth
/// generation): commands `[a,b,c]` LF in milliampere, answers `[model,e0,e1,e2,e3,e4,e5,err]` LF, one per command.
/// There is no checksum, no sequence number and no time stamp: what the brackets and the eight integers do not reveal,
/// nothing does. Source: facts restated from the published firmware `woody_teensy_mini` and the host API `hfabapi`.
///
/// Pure functions of bytes; no thread, no clock, no allocation.
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "rtbus/realtime.hpp"

namespace drivers::phantom {

/// Beyond this the firmware drives **no** current instead of the largest one [mA].
inline constexpr int kFirmwareLimitMa = 6000;

/// Motor currents of base, upper arm and forearm [mA].
using CurrentsMa = std::array<int, 3>;

/// Error bits of an answer, as the firmware sets them.
enum ErrorBit : std::uint32_t {
  kGimbal0Failed = 1,  ///< I²C of a gimbal sensor: the counters of the arm are still true.
  kGimbal1Failed = 2,
  kGimbal2Failed = 4,
  kTrailingCharacters = 8,  ///< Something followed the `]`: two commands met in the device.
  kBufferFull = 128,        ///< 127 bytes without `]`.
  kClosedBeforeOpened = 256,
  kWrongCommaCount = 512,
  kNumberUnparsable = 1024,
};
inline constexpr std::uint32_t kGimbalErrors = kGimbal0Failed | kGimbal1Failed | kGimbal2Failed;
/// With any of these the command was dropped, the motors keep the current they had, the watchdog was not fed, and the
/// counters are repeated from an earlier answer.
inline constexpr std::uint32_t kCommandErrors = ~kGimbalErrors;

/// "trailing characters, wrong comma count"; unknown bits by number; "none" for 0.
[[nodiscard]] std::string describe_errors(std::uint32_t errors);

/// One answer of the device.
struct Reply {
  int model = 0;                         ///< 1 Polhem, 2 Vintage PHANToM, 3 WoodenHaptics.
  std::array<std::int32_t, 3> arm{};     ///< Motor encoder counts (×4), without home offset.
  std::array<std::int32_t, 3> gimbal{};  ///< Sensors of the stylus; all 0 when there are none.
  std::uint32_t errors = 0;              ///< ErrorBit.
};

/// A command ready to be sent; 23 bytes at most.
struct Command {
  std::array<std::uint8_t, 32> bytes{};
  std::size_t length = 0;
  [[nodiscard]] std::span<const std::uint8_t> span() const noexcept { return {bytes.data(), length}; }
};

/// Writes `[a,b,c]` LF. False, and an empty command, when a current is beyond ±6000 mA: the device would silently drop
/// it. @realtime Yes.
[[nodiscard]] bool encode(const CurrentsMa& currents_ma, Command& out) noexcept RTBUS_NONBLOCKING;

/// Reads exactly the text between the brackets: eight decimal integers, separated by commas. False for anything else:
/// blanks, signs without digits, numbers beyond 32 bits, too few or too many of them. @realtime Yes.
[[nodiscard]] bool parse_reply(std::span<const char> text, Reply& out) noexcept RTBUS_NONBLOCKING;

/// Finds answers in a stream that may begin anywhere, be cut anywhere and hold anything. A `[` always begins anew, so a
/// damaged answer costs itself and not its successor.
class ReplyDecoder {
 public:
  enum class Event : std::uint8_t {
    kNone,     ///< Go on.
    kReply,    ///< `out` was filled by this byte.
    kBadReply  ///< An answer ended by this byte and was no answer, or something began that cannot end as one.
  };

  /// Takes one byte. @realtime Yes.
  Event take(std::uint8_t byte, Reply& out) noexcept RTBUS_NONBLOCKING;

  /// Forgets a half answer.
  void reset() noexcept {
    inside_ = false;
    length_ = 0;
  }

  /// Bytes outside of brackets that are no line ends or padding [count].
  [[nodiscard]] std::uint64_t garbage() const noexcept { return garbage_; }
  /// Times an answer had to be looked for anew: after garbage, or a `[` inside an answer [count].
  [[nodiscard]] std::uint64_t resyncs() const noexcept { return resyncs_; }

 private:
  // The longest answer: eight numbers of at most 11 characters and 7 commas.
  static constexpr std::size_t kLongest = 8 * 11 + 7;
  std::array<char, kLongest> text_{};
  std::size_t length_ = 0;
  bool inside_ = false;
  bool in_garbage_ = false;
  std::uint64_t garbage_ = 0;
  std::uint64_t resyncs_ = 0;
};

}  // namespace drivers::phantom
