#pragma once
/// @file falcon_firmware.hpp
/// The Falcon has no flash: after every power-up the host loads its firmware through a serial boot loader. This file
/// reads and recognises the user's firmware file and does the loading, with a reason for every way it can fail.
///
/// The steps (README.md, "upload"): at 9600 baud a small processor answers "\nC\r" with "\nD,\r"; DTR low hands the
/// line to the signal processor's boot ROM, which locks to the baud rate of an 'A', and echoes everything that follows,
/// the boot stream, byte by byte.
#include <cstdint>
#include <string>
#include <vector>

#include "drivers/falcon/ftdi.hpp"
#include "drivers/usb/channel.hpp"
#include "rtbus/result.hpp"

namespace drivers::falcon {

/// A firmware file, checked to be one boot stream.
struct FirmwareImage {
  std::vector<std::uint8_t> bytes;
  std::string file;
  std::string sha256;
  std::string known_as;  ///< Name under which this file is known; empty: an unknown one.
};

/// Checks bytes from `file`. The error is what is wrong with them: "is not a Falcon firmware: …".
[[nodiscard]] rtbus::Result<FirmwareImage, std::string> make_firmware_image(std::vector<std::uint8_t> bytes,
                                                                            std::string file);
/// Reads a file of at most 64 KiB and checks it.
[[nodiscard]] rtbus::Result<FirmwareImage, std::string> load_firmware_image(const std::string& file);

/// How far an attempt came.
enum class UploadStage : std::uint8_t {
  kLineSetup,  ///< A control request failed.
  kHandshake,  ///< No right answer at 9600 baud.
  kAutoBaud,   ///< The boot ROM did not echo the 'A'.
  kEcho,       ///< The firmware's echo was wrong or stopped.
  kDone
};

/// What one attempt to load the firmware came to.
struct UploadAttempt {
  UploadStage stage = UploadStage::kLineSetup;
  bool heard = false;                        ///< The device has sent at least one byte.
  std::size_t echoed = 0;                    ///< Bytes of the firmware whose echo was right.
  int expected = -1;                         ///< The byte sent where the echo differed; −1: the echo stopped.
  int got = -1;                              ///< What came instead.
  double baud_hz = 0.0;                      ///< Of the boot ROM's line.
  usb::UsbStatus usb = usb::UsbStatus::kOk;  ///< kLost and kStopping end everything.

  [[nodiscard]] std::string describe() const;  ///< "the echo differs at byte 620 (sent 0x41, got 0x40)"
};

/// How often and how patiently.
struct UploadPatience {
  int attempts = 10;
  /// Attempts without a single byte from the device after which it counts as dead.
  int silent_attempts = 3;
  double handshake_s = 1.2;     ///< For the right answer, per attempt [s].
  double answer_s = 0.040;      ///< Per "\nC\r" [s]; the answer takes 7 ms and the latency timer 16.
  double auto_baud_s = 0.5;     ///< For the echo of 'A' [s].
  double echo_s = 0.5;          ///< For the echo of one chunk [s].
  double first_pause_s = 0.05;  ///< Before the second attempt; doubles up to eight times that [s].
  /// Slower lines for the boot ROM after two failures at the usual rate: TI warns of its baud detection above 100 kBd.
  bool slower_on_retry = true;
};

/// Counts for people, over one load_firmware().
struct UploadReport {
  int attempts = 0;
  UploadAttempt last;
  double duration_s = 0.0;
};

/// Loads the firmware, trying again as `patience` says, and leaves the line at the boot ROM's rate. On failure the
/// error is a sentence with the reason and the remedy; empty when the driver is to stop.
[[nodiscard]] rtbus::Result<UploadReport, std::string> load_firmware(usb::Channel& channel, const FirmwareImage& image,
                                                                     const UploadPatience& patience);

/// Asks the processor that answers at 9600 baud whether it is there. For a Falcon without firmware file: tells a dead
/// device from one that only lacks its firmware.
[[nodiscard]] UploadAttempt handshake(usb::Channel& channel, const UploadPatience& patience);

/// What silence means, and the remedy.
[[nodiscard]] std::string no_power_message();

}  // namespace drivers::falcon
