// `rtbus conformance`: our conformance suite of devices over a driver that was built outside the source tree. The suite
// is a program of its own, with GoogleTest; it stands beside this one.
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>
#include <string>

#include "drivers/registry/registry.hpp"
#include "rtbus/config/document.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/common/find_config.hpp"

namespace tools {

namespace {

struct ConformanceOptions {
  std::string module;
  std::string file;
};

int check(const ConformanceOptions& options) {
  const std::string module = std::filesystem::absolute(options.module).lexically_normal().string();
  try {
    // Here already: what is wrong with the module or the file is said in one sentence.
    auto file = rtbus::config::load(options.file, {{"driver", "{module: " + module + "}"}});
    (void)drivers::parse_device(file);
  } catch (const rtbus::config::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kExitUsage;
  }
  ::setenv("RTBUS_CONFORMANCE_MODULE", module.c_str(), 1);
  ::setenv("RTBUS_CONFORMANCE_DEVICE", std::filesystem::absolute(options.file).c_str(), 1);
  const std::string program = folder_of_this_program() + "/driver_conformance";
  ::execl(program.c_str(), program.c_str(), "--gtest_filter=Drivers/*", nullptr);
  std::fprintf(stderr, "rtbus conformance: %s: %s%s\n", program.c_str(), std::strerror(errno),
               errno == ENOENT ? "; the package librtbus-dev has it; in a source tree build it with\n"
                                 "  tools/build driver_conformance"
                               : "");
  return kExitFailed;
}

}  // namespace

Action add_conformance(rtbus::Command command) {
  auto options = std::make_shared<ConformanceOptions>();
  command.option("module", options->module, "The driver's shared module")
      .required()
      .existing_file()
      .type_name("DRIVER.so");
  command.option("device", options->file, "Device file with the driver's keys; its `driver:` is not looked at")
      .required()
      .existing_file()
      .type_name("DEVICE.yaml");
  command.footer(
      "\nAn engine of physics is checked with `rtbus conformance ENGINE.yaml` (docs/your-own-physics.md).\n"
      "The device must open without hardware, and only the force may move its tip: no weight, no hand.\n"
      "Exit status 0: every test passed. docs/writing-a-driver.md says what is tested.");
  return [options] { return check(*options); };
}

}  // namespace tools
