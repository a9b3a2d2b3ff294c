// Any bytes through both ends of the bracket protocol: the driver's decoder and the virtual controller's parser. What
// the decoder takes must give a finite pose or none, and no input may keep the next answer from being read.
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string_view>

#include "drivers/phantom/phantom_kinematics.hpp"
#include "drivers/phantom/phantom_message.hpp"
#include "drivers/virtual_devices/phantom/phantom_firmware.hpp"

namespace {

using namespace drivers::phantom;

void require(bool holds) {
  if (!holds) std::abort();
}

void decode(std::span<const std::uint8_t> bytes) {
  ReplyDecoder decoder;
  for (const std::uint8_t byte : bytes) {
    Reply reply;
    if (decoder.take(byte, reply) != ReplyDecoder::Event::kReply) continue;
    for (const Model& model : models()) {
      const Kinematics arm(model);
      const JointAngles q = arm.angles(reply.arm);
      ArmPose pose;
      if (arm.forward(q, pose)) require(pose.position_m.allFinite() && pose.jacobian_m.allFinite());
      for (const double c : arm.orientation(q[0], pose.elevation_rad, arm.gimbal_angles(reply.gimbal))) {
        require(std::isfinite(c));
      }
    }
  }
  constexpr std::string_view kGood = "[2,1,-2,3,4,5,6,0]\n";
  int found = 0;
  Reply reply;
  for (const char c : kGood) {
    found += decoder.take(static_cast<std::uint8_t>(c), reply) == ReplyDecoder::Event::kReply;
  }
  require(found == 1 && reply.arm[1] == -2 && reply.gimbal[2] == 6);
}

void obey(std::span<const std::uint8_t> bytes) {
  drivers::virtual_usb::PhantomFirmware firmware(2, false, false);
  firmware.receive(bytes);
  std::uint64_t now_ns = 0;
  while (firmware.has_input()) {
    now_ns += 50'000;
    const auto answer = firmware.loop(now_ns, {1, 2, 3}, {4, 5, 6});
    if (!answer) continue;
    // Whatever it was asked, it answers in the protocol.
    require(answer->front() == '[' && answer->back() == '\n');
    Reply reply;
    require(parse_reply({answer->data() + 1, answer->size() - 3}, reply));
    for (const double ma : firmware.currents_ma()) require(std::abs(ma) <= 6001.0);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::span<const std::uint8_t> bytes(data, size);
  decode(bytes);
  obey(bytes);
  return 0;
}
