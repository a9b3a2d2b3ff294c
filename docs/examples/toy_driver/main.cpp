// toy_driver DEVICE_FILE: opens the device of the file and pushes it for a second of simulated time.
#include <cstdio>

#include "toy_device.hpp"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: toy_driver DEVICE_FILE\n");
    return 2;
  }
  std::unique_ptr<drivers::DeviceConfig> config;
  try {
    rtbus::config::Map file = rtbus::config::load(argv[1]);
    (void)file.choice("schema", {"device/1"});
    (void)file.choice("driver", {"toy"});
    config = toy::parse(file);
    file.finish();  // complains about keys that nobody asked for
  } catch (const rtbus::config::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
  auto device = config->open({});
  if (!device) {
    std::fprintf(stderr, "%s\n", device.error().message.c_str());
    return 1;
  }
  std::uint64_t now_ns = 0;
  if (auto started = (*device)->start(now_ns); !started) {
    std::fprintf(stderr, "%s\n", started.error().message.c_str());
    return 1;
  }
  drivers::DeviceSample sample;
  for (int tick = 0; tick < 1000; ++tick) {
    now_ns += 1'000'000;
    if ((*device)->read(now_ns, sample) == drivers::IoStatus::kLost) return 1;
    if ((*device)->write(now_ns, {{0.02, 0.0, 0.0}}) != drivers::IoStatus::kOk) return 1;
  }
  (*device)->stop();
  std::printf("%s moved by %.4f m in 1 s\n", config->info().model.c_str(), sample.position_m[0]);
}
