// subscriber SESSION: prints ten times a second where the hand of a running session is.
#include <cstdio>

#include "rtbus/clock.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/topic.hpp"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: subscriber SESSION\n");
    return 2;
  }
  rtbus::Session session;
  session.name = argv[1];
  // The topic is mapped read-only: a reader cannot disturb the haptic loop.
  auto reader = rtbus::Reader<rtbus::DeviceState>::open(session, "haptic0.device_state");
  if (!reader) {
    std::fprintf(stderr, "haptic0.device_state of session %s: %s\n", argv[1], rtbus::to_string(reader.error()));
    return 1;
  }
  rtbus::Stamped<rtbus::DeviceState> sample;
  for (std::uint64_t wake_ns = rtbus::monotonic_ns(); reader->writer_alive(); wake_ns += 100 * rtbus::kNsPerMs) {
    rtbus::sleep_until(wake_ns);
    if (reader->read_latest(sample) != rtbus::ReadStatus::kFresh) continue;
    const rtbus::Vec3& p = sample.value.position_m;
    std::printf("%llu  %+.4f %+.4f %+.4f m\n", static_cast<unsigned long long>(sample.sequence), p[0], p[1], p[2]);
    std::fflush(stdout);
  }
  std::printf("the haptic node has ended\n");
}
