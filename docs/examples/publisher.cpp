// publisher SESSION SECONDS: publishes the readings of a made-up force sensor at 100 Hz on the topic sensor.force.
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "force_reading.hpp"
#include "rtbus/clock.hpp"
#include "rtbus/topic.hpp"

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: publisher SESSION SECONDS\n");
    return 2;
  }
  rtbus::Session session;
  session.name = argv[1];
  auto writer = rtbus::Writer<ForceReading>::create(session, "sensor.force");
  if (!writer) {
    std::fprintf(stderr, "sensor.force: %s\n", rtbus::to_string(writer.error()));
    return 1;
  }
  const std::uint64_t begin_ns = rtbus::monotonic_ns();
  const double seconds = std::atof(argv[2]);
  ForceReading reading;
  for (std::uint64_t wake_ns = begin_ns; rtbus::seconds_between(begin_ns, wake_ns) < seconds;) {
    reading.sample_time_ns = rtbus::monotonic_ns();
    reading.force_n[1] = std::sin(rtbus::seconds_between(begin_ns, reading.sample_time_ns));
    writer->publish(reading, reading.sample_time_ns);  // one copy: no lock, no system call
    rtbus::sleep_until(wake_ns += 10 * rtbus::kNsPerMs);
  }
}
