// What a Falcon, or whatever pretends to be one, may send: transfers of the USB chip, frames, encoder values; and what
// a user may give as its firmware. The first byte says how the rest is cut into transfers.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "drivers/falcon/boot_stream.hpp"
#include "drivers/falcon/falcon_frame.hpp"
#include "drivers/falcon/falcon_kinematics.hpp"
#include "drivers/falcon/ftdi.hpp"
#include "drivers/falcon/motor_commands.hpp"

namespace {

using namespace drivers::falcon;

void require(bool condition) {
  if (!condition) std::abort();
}

void take(const FrameBytes& bytes) {
  require(bytes.front() == kFrameBegin && bytes.back() == kFrameEnd);
  DeviceFrame frame;
  if (!decode(bytes, frame)) return;
  FrameBytes again = encode(frame);
  again[14] = bytes[14];  // the unused byte is not kept
  require(again == bytes);

  static const Kinematics kinematics(geometries()[0]);
  const auto angles_rad = kinematics.angles_rad({frame.encoder[0], frame.encoder[1], frame.encoder[2]});
  const auto position_m = kinematics.position_m(angles_rad);
  if (!position_m) return;
  require(position_m->allFinite() && position_m->norm() < 0.3);
  const MotorCommands commands =
      commands_for_force(kinematics, *position_m, angles_rad, {1.0, -2.0, 3.0}, kGainMartinHillier);
  for (const auto count : commands.count) require(std::abs(count) <= kMaxCommand);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::size_t cut = static_cast<std::size_t>(data[0]) + 1;
  const auto rest = std::span(data + 1, size - 1);

  FrameFinder finder;
  FrameBytes bytes;
  std::size_t pushed = 0;
  std::size_t framed = 0;
  for (std::size_t at = 0; at < rest.size(); at += cut) {
    const auto transfer = rest.subspan(at, std::min(cut, rest.size() - at));
    (void)ftdi::for_each_payload(transfer, [&](std::span<const std::uint8_t> part) {
      require(part.size() <= ftdi::kPayloadBytes);
      pushed += part.size();
      finder.push(part);
    });
    while (finder.next(bytes)) {
      framed += kFrameBytes;
      take(bytes);
    }
  }
  require(framed + finder.skipped_bytes() <= pushed);
  require(pushed - framed - finder.skipped_bytes() < kFrameBytes);  // what waits for its end
  // Whatever came before, a whole frame behind it is found.
  const FrameBytes good = encode(DeviceFrame{{1, -2, 3}, 0x5, 0x7});
  finder.push(good);
  bool found = false;
  while (finder.next(bytes)) found = bytes == good;
  require(found);

  if (const auto stream = check_boot_stream(rest)) {
    require(stream->bytes() == rest.size() && stream->blocks() > 0 && rest.size() % 2 == 0);
  }
  return 0;
}
