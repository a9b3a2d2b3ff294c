#include "drivers/falcon/falcon_firmware.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <utility>

#include "drivers/falcon/boot_stream.hpp"
#include "drivers/falcon/serial_line.hpp"
#include "drivers/falcon/sha256.hpp"

namespace drivers::falcon {
namespace {

using usb::UsbStatus;

constexpr std::size_t kMaxFileBytes = 64 * 1024;  // the processor's memory is 36 KiB

struct KnownImage {
  const char* name;
  const char* sha256;
};

// Files in circulation, by hash alone; README.md says where a user finds one.
constexpr std::array kKnownImages{
    KnownImage{"nvent_firmware.bin", "1119e39c39fab1f37678ea62dfc715b23dd86ee7f13d78f88f707d9f09b896a1"},
    KnownImage{"test_firmware.bin", "b2700d5cd5ca217e48565fb4de5a502a636c53f6e01ebd0cad193e9f84856c6a"},
    KnownImage{"novint_T0.bin", "ae838730af34b5822c9c3949859b446614af0410730b832cc17a6ad627ea64a4"},
    KnownImage{"novint_T2.bin", "e0ae3598670fa1c8d9277bd6943c99b3152b97c400c46c1c42c60de77ff4e816"},
};

constexpr double kHandshakeHz = 9600.0;
constexpr double kUploadHz = 140000.0;
constexpr std::uint8_t kUploadLatencyMs = 16;
constexpr std::array<std::uint8_t, 3> kQuestion{0x0A, 'C', 0x0D};
constexpr std::array<std::uint8_t, 4> kAnswer{0x0A, 'D', ',', 0x0D};
// The echo of so many bytes fills one IN packet, which then comes at once instead of with the latency timer.
constexpr std::size_t kChunkBytes = ftdi::kPayloadBytes;

double upload_hz(int attempt, const UploadPatience& patience) {
  if (!patience.slower_on_retry || attempt <= 2) return kUploadHz;
  constexpr std::array<double, 3> kRates{115200.0, 57600.0, kUploadHz};
  return kRates[static_cast<std::size_t>(attempt - 3) % kRates.size()];
}

bool ends_everything(UsbStatus status) { return status == UsbStatus::kLost || status == UsbStatus::kStopping; }

// The line as the small processor expects it; the pulse on DTR restarts the signal processor.
UsbStatus set_up_handshake(ftdi::Port& port) {
  UsbStatus status = port.purge();
  const auto next = [&status](UsbStatus step) {
    if (status == UsbStatus::kOk) status = step;
  };
  if (status == UsbStatus::kOk) next(port.set_latency_ms(kUploadLatencyMs));
  if (status == UsbStatus::kOk) next(port.set_baud(ftdi::baud(kHandshakeHz)));
  if (status == UsbStatus::kOk) next(port.set_format_8n1());
  if (status == UsbStatus::kOk) next(port.set_no_flow_control());
  if (status == UsbStatus::kOk) next(port.set_event_character(0, false));
  if (status == UsbStatus::kOk) next(port.set_rts(false));
  if (status == UsbStatus::kOk) next(port.set_dtr(false));
  if (status == UsbStatus::kOk) next(port.set_dtr(true));
  return status;
}

// Asks until the last bytes heard are the answer: a stray 00 may precede it, and it may come in pieces.
void ask(SerialLine& line, const UploadPatience& patience, UploadAttempt& out) {
  const std::uint64_t give_up_ns = line.now_ns() + seconds_to_ns(patience.handshake_s);
  std::vector<std::uint8_t> heard;
  while (line.now_ns() < give_up_ns) {
    out.usb = line.write(kQuestion, line.now_ns() + seconds_to_ns(patience.answer_s));
    if (ends_everything(out.usb)) return;
    const std::uint64_t ask_again_ns = std::min(give_up_ns, line.now_ns() + seconds_to_ns(patience.answer_s));
    while (line.now_ns() < ask_again_ns) {
      out.usb = line.read_some(heard, ask_again_ns);
      if (ends_everything(out.usb)) return;
      out.heard = out.heard || !heard.empty();
      if (heard.size() >= kAnswer.size() && std::equal(kAnswer.rbegin(), kAnswer.rend(), heard.rbegin())) {
        out.stage = UploadStage::kAutoBaud;
        return;
      }
    }
  }
}

// DTR low gives the line to the boot ROM, which measures the baud rate of an 'A' and sends it back.
void lock_baud(SerialLine& line, ftdi::Port& port, double baud_hz, const UploadPatience& patience, UploadAttempt& out) {
  // Questions asked twice are answered twice: what is still under way must not be taken for an echo.
  constexpr double kSettleS = 0.02;
  out.usb = line.sleep(kSettleS);
  std::vector<std::uint8_t> stale;
  if (out.usb == UsbStatus::kOk) out.usb = line.drain(stale);
  if (out.usb == UsbStatus::kOk) out.usb = port.purge();
  if (out.usb == UsbStatus::kOk) out.usb = port.set_dtr(false);
  const ftdi::Baud rate = ftdi::baud(baud_hz);
  out.baud_hz = rate.actual_hz;
  if (out.usb == UsbStatus::kOk) out.usb = port.set_baud(rate);
  constexpr std::array<std::uint8_t, 1> kLock{'A'};
  const std::uint64_t give_up_ns = line.now_ns() + seconds_to_ns(patience.auto_baud_s);
  if (out.usb == UsbStatus::kOk) out.usb = line.write(kLock, give_up_ns);
  std::vector<std::uint8_t> heard;
  while (!ends_everything(out.usb)) {
    // One stray byte from the change of the rate may come first.
    if (!heard.empty() && heard.back() == kLock[0]) {
      out.stage = UploadStage::kEcho;
      return;
    }
    if (line.now_ns() >= give_up_ns) return;
    out.usb = line.read_some(heard, give_up_ns);
  }
}

void send_image(SerialLine& line, const FirmwareImage& image, const UploadPatience& patience, UploadAttempt& out) {
  std::vector<std::uint8_t> echo;
  for (std::size_t at = 0; at < image.bytes.size(); at += kChunkBytes) {
    const auto chunk = std::span(image.bytes).subspan(at, std::min(kChunkBytes, image.bytes.size() - at));
    const std::uint64_t give_up_ns = line.now_ns() + seconds_to_ns(patience.echo_s);
    out.usb = line.write(chunk, give_up_ns);
    echo.clear();
    while (echo.size() < chunk.size()) {
      if (ends_everything(out.usb)) return;
      const auto differs = std::mismatch(echo.begin(), echo.end(), chunk.begin());
      if (differs.first != echo.end()) break;
      if (line.now_ns() >= give_up_ns) break;
      out.usb = line.read_some(echo, give_up_ns);
    }
    const std::size_t length = std::min(echo.size(), chunk.size());
    const auto differs = std::mismatch(echo.begin(), echo.begin() + static_cast<std::ptrdiff_t>(length), chunk.begin());
    const auto right = static_cast<std::size_t>(differs.first - echo.begin());
    out.echoed = at + right;
    if (right < length) {
      out.expected = *differs.second;
      out.got = *differs.first;
    }
    if (right < chunk.size()) return;
  }
  out.usb = UsbStatus::kOk;
  out.stage = UploadStage::kDone;
}

UploadAttempt try_handshake(usb::Channel& channel, const UploadPatience& patience) {
  UploadAttempt out;
  ftdi::Port port(channel);
  SerialLine line(channel);
  out.usb = set_up_handshake(port);
  if (out.usb != UsbStatus::kOk) return out;
  std::vector<std::uint8_t> stale;
  out.usb = line.drain(stale);
  if (out.usb != UsbStatus::kOk) return out;
  out.stage = UploadStage::kHandshake;
  ask(line, patience, out);
  return out;
}

UploadAttempt try_upload(usb::Channel& channel, const FirmwareImage& image, double baud_hz,
                         const UploadPatience& patience) {
  UploadAttempt out = try_handshake(channel, patience);
  if (out.stage != UploadStage::kAutoBaud) return out;
  ftdi::Port port(channel);
  SerialLine line(channel);
  lock_baud(line, port, baud_hz, patience, out);
  if (out.stage != UploadStage::kEcho) return out;
  send_image(line, image, patience, out);
  return out;
}

std::string failure_message(const UploadReport& report, int silent, const UploadPatience& patience) {
  if (silent >= patience.silent_attempts) return no_power_message();
  std::string text = "the Falcon does not take its firmware: after " + std::to_string(report.attempts) +
                     (report.attempts == 1 ? " attempt, " : " attempts, ") + report.last.describe() + "; ";
  switch (report.last.stage) {
    case UploadStage::kLineSetup:
      return text + "plug it directly into the computer, without a hub, and try again";
    case UploadStage::kHandshake:
      return text + "unplug its wall power for ten seconds, plug it in again and restart";
    case UploadStage::kAutoBaud:
      return text + "this happens at times: restart, or unplug its wall power for ten seconds first";
    default:
      return text + "check the USB cable, avoid hubs, unplug the wall power for ten seconds and restart";
  }
}

}  // namespace

rtbus::Result<FirmwareImage, std::string> make_firmware_image(std::vector<std::uint8_t> bytes, std::string file) {
  const auto stream = check_boot_stream(bytes);
  if (!stream) return rtbus::Failure{"is not a Falcon firmware: it " + stream.error()};
  FirmwareImage image;
  image.sha256 = sha256_hex(bytes);
  const auto known = std::find_if(kKnownImages.begin(), kKnownImages.end(),
                                  [&image](const KnownImage& entry) { return image.sha256 == entry.sha256; });
  if (known != kKnownImages.end()) image.known_as = known->name;
  image.bytes = std::move(bytes);
  image.file = std::move(file);
  return image;
}

rtbus::Result<FirmwareImage, std::string> load_firmware_image(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) return rtbus::Failure{std::string("cannot be read; check its permissions")};
  std::vector<std::uint8_t> bytes(kMaxFileBytes + 1);
  stream.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<std::size_t>(stream.gcount()));
  if (bytes.size() > kMaxFileBytes) {
    return rtbus::Failure{
        std::string("is not a Falcon firmware: it is longer than 64 KiB (the known ones have about 8)")};
  }
  return make_firmware_image(std::move(bytes), file);
}

std::string no_power_message() {
  return "the Falcon is on the USB bus but does not answer at all: is its wall power connected? (its USB chip runs "
         "without); check the power supply and its lamp, then restart";
}

std::string UploadAttempt::describe() const {
  std::array<char, 160> text{};
  if (usb == UsbStatus::kLost) return "it was unplugged";
  switch (stage) {
    case UploadStage::kLineSetup:
      return "the USB chip refused the line settings";
    case UploadStage::kHandshake:
      return heard ? "it answers at 9600 baud, but not with what its loader says" : "it does not answer at 9600 baud";
    case UploadStage::kAutoBaud:
      std::snprintf(text.data(), text.size(), "its boot loader does not lock to %.0f baud", baud_hz);
      return text.data();
    case UploadStage::kEcho:
      if (expected < 0) {
        std::snprintf(text.data(), text.size(), "the echo stops after %zu bytes at %.0f baud", echoed, baud_hz);
      } else {
        std::snprintf(text.data(), text.size(), "the echo of byte %zu differs (sent 0x%02x, got 0x%02x) at %.0f baud",
                      echoed, static_cast<unsigned>(expected), static_cast<unsigned>(got), baud_hz);
      }
      return text.data();
    case UploadStage::kDone:
      break;
  }
  return "it took everything";
}

UploadAttempt handshake(usb::Channel& channel, const UploadPatience& patience) {
  UploadAttempt out;
  for (int attempt = 0; attempt < patience.silent_attempts; ++attempt) {
    out = try_handshake(channel, patience);
    if (out.stage == UploadStage::kAutoBaud || ends_everything(out.usb)) break;
  }
  return out;
}

rtbus::Result<UploadReport, std::string> load_firmware(usb::Channel& channel, const FirmwareImage& image,
                                                       const UploadPatience& patience) {
  const std::uint64_t start_ns = channel.now_ns();
  UploadReport report;
  int silent = 0;  // attempts in a row
  double pause_s = patience.first_pause_s;
  while (report.attempts < patience.attempts && silent < patience.silent_attempts) {
    if (report.attempts > 0 && silent == 0) {  // a device that says nothing needs no rest
      if (channel.sleep_until(channel.now_ns() + seconds_to_ns(pause_s)) == UsbStatus::kStopping) {
        return rtbus::Failure{std::string()};
      }
      pause_s = std::min(2.0 * pause_s, 8.0 * patience.first_pause_s);
    }
    ++report.attempts;
    report.last = try_upload(channel, image, upload_hz(report.attempts, patience), patience);
    if (report.last.usb == UsbStatus::kStopping) return rtbus::Failure{std::string()};
    if (report.last.usb == UsbStatus::kLost) return rtbus::Failure{std::string("the Falcon was unplugged")};
    if (report.last.stage == UploadStage::kDone) {
      report.duration_s = static_cast<double>(channel.now_ns() - start_ns) * 1e-9;
      return report;
    }
    const bool was_silent = report.last.stage == UploadStage::kHandshake && !report.last.heard;
    silent = was_silent ? silent + 1 : 0;
  }
  return rtbus::Failure{failure_message(report, silent, patience)};
}

}  // namespace drivers::falcon
