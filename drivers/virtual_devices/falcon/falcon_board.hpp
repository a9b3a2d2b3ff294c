#pragma once
/// @file falcon_board.hpp
/// What is behind the serial line of a virtual Falcon: the small processor that answers at 9600 baud, the boot ROM that
/// locks to a baud rate and echoes a boot stream, and the firmware that answers frames. Byte by byte, each with the
/// time at which it has passed the line. It accepts any well-formed boot stream and then behaves like the usual
/// firmware.
#include <array>
#include <cstdint>
#include <deque>
#include <random>
#include <string_view>

#include "drivers/falcon/boot_stream.hpp"
#include "drivers/falcon/falcon_frame.hpp"
#include "drivers/falcon/ftdi.hpp"
#include "drivers/virtual_devices/falcon/falcon_arm.hpp"
#include "drivers/virtual_usb/usb_device.hpp"

namespace drivers::virtual_usb {

enum class FalconState : std::uint8_t {
  kLoader,    ///< The small processor listens at 9600 baud.
  kAutoBaud,  ///< The boot ROM waits for 'A'.
  kStream,    ///< The boot ROM reads and echoes.
  kRunning,   ///< The firmware answers frames.
  kStuck,     ///< The boot stream was malformed: until the next pulse on DTR.
};

[[nodiscard]] std::string_view name_of(FalconState state) noexcept;

/// A byte on its way to the USB chip.
struct LineByte {
  std::uint64_t time_ns = 0;  ///< When the chip has it.
  std::uint8_t value = 0;
  double baud_hz = 0.0;    ///< Rate it was sent at.
  bool ends_reply = true;  ///< No more bytes of the same reply follow.
  bool may_split = false;  ///< A packet may end here, by a fault.
};

struct FalconBoardSettings {
  Faults faults;
  std::uint64_t seed = 1;
  std::uint64_t turnaround_ns = 20'000;  ///< From the end of a frame to the begin of its reply; own choice.
  std::uint64_t boot_ns = 5'000'000;     ///< From the end of the stream to the first frame; own choice.
};

class FalconBoard {
 public:
  /// @param arm Outlives the board.
  FalconBoard(FalconArm& arm, const FalconBoardSettings& settings);

  void power_up(std::uint64_t now_ns);
  /// A pulse from low to high restarts the processors; low, after an answer at 9600 baud, begins the boot ROM.
  void set_dtr(bool high, std::uint64_t now_ns);
  /// A byte has arrived completely at `time_ns`, sent at `baud_hz`. Times never go back.
  void receive(std::uint8_t byte, double baud_hz, std::uint64_t time_ns);

  /// In order of time. The chip takes what has arrived.
  [[nodiscard]] std::deque<LineByte>& outgoing() noexcept { return outgoing_; }
  [[nodiscard]] const std::deque<LineByte>& outgoing() const noexcept { return outgoing_; }

  [[nodiscard]] FalconState state() const noexcept { return state_; }
  [[nodiscard]] std::uint8_t flags() const noexcept { return flags_; }  ///< Of the last frame: lights and homing.
  [[nodiscard]] const std::array<std::int16_t, 3>& commands() const noexcept { return commands_; }
  [[nodiscard]] std::uint64_t frames() const noexcept { return frames_; }              ///< Well-formed ones received.
  [[nodiscard]] std::uint64_t lost_replies() const noexcept { return lost_replies_; }  ///< By faults.
  [[nodiscard]] int uploads() const noexcept { return uploads_; }
  /// May be changed at any time.
  [[nodiscard]] Faults& faults() noexcept { return settings_.faults; }
  [[nodiscard]] const Faults& faults() const noexcept { return settings_.faults; }

 private:
  [[nodiscard]] bool draw(double share);
  void send(std::uint8_t byte, double baud_hz, std::uint64_t from_ns, bool ends_reply = true, bool may_split = false);
  void hear_question(std::uint8_t byte, std::uint64_t time_ns);
  void hear_stream(std::uint8_t byte, std::uint64_t time_ns);
  void answer(const falcon::HostFrame& frame, std::uint64_t time_ns);
  void send_reply(const falcon::FrameBytes& bytes, std::uint64_t from_ns, bool split);

  FalconArm& arm_;
  FalconBoardSettings settings_;
  std::mt19937_64 random_;
  FalconState state_ = FalconState::kLoader;
  std::uint64_t powered_ns_ = 0;
  bool dtr_ = false;
  bool deaf_ = false;      ///< This handshake fails, by a fault.
  bool answered_ = false;  ///< The question of the handshake has been answered.
  std::size_t question_ = 0;
  double locked_hz_ = 0.0;
  falcon::BootStreamReader stream_;
  std::uint64_t runs_from_ns_ = 0;
  falcon::FrameFinder finder_;
  std::deque<LineByte> outgoing_;
  std::uint64_t line_free_ns_ = 0;
  bool holding_ = false;
  falcon::FrameBytes held_{};

  std::uint8_t flags_ = 0;
  std::array<std::int16_t, 3> commands_{};
  std::uint64_t frames_ = 0;
  std::uint64_t lost_replies_ = 0;
  int uploads_ = 0;
};

/// Within what a serial receiver tolerates.
[[nodiscard]] bool same_rate(double a_hz, double b_hz) noexcept;
/// Start bit, eight data bits, stop bit.
[[nodiscard]] std::uint64_t byte_time_ns(double baud_hz) noexcept;

}  // namespace drivers::virtual_usb
