// `rtbus doctor`: is this machine fit for a force every millisecond, and if not, what to do.
#include <pwd.h>
#include <unistd.h>

#include <cstdio>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tools/cli/common/command.hpp"
#include "tools/cli/common/find_config.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/devices/vendor_devices.hpp"
#include "tools/cli/doctor/doctor_checks.hpp"
#include "tools/cli/host/ask_kernel.hpp"
#include "tools/cli/host/wakeup_probe.hpp"

namespace tools {

namespace {

struct DoctorOptions {
  double duration_s = 2.0;
  bool json = false;
  bool vendors = false;
};

/// On standard error, so that it never gets into what a script reads.
void draw_progress(double done) {
  constexpr int kWidth = 30;
  const int filled = static_cast<int>(done * kWidth);
  std::string bar(static_cast<std::size_t>(filled), '#');
  bar.resize(kWidth, '.');
  std::fprintf(stderr, "\rmeasuring wake-ups at 1 kHz [%s] %3.0f %%", bar.c_str(), done * 100.0);
  std::fflush(stderr);
}

DoctorFacts gather(const DoctorOptions& options) {
  DoctorFacts facts;
  facts.machine = ask_machine();
  facts.limits = ask_limits();
  facts.shm = ask_mount("/dev/shm");
  const passwd* const user = ::getpwuid(::geteuid());
  facts.logind = ask_logind(::geteuid(), user != nullptr ? user->pw_name : "");
  facts.clock_ns = measure_clock_ns();
  facts.topics = rtbus::list_topics();
  facts.bridge_is_here = ::access((folder_of_this_program() + "/rtbus_bridge").c_str(), X_OK) == 0;
  if (options.vendors) facts.vendors = vendor_findings();
  const bool terminal = ::isatty(STDERR_FILENO) == 1;
  facts.wakeup = probe_wakeup({.duration_s = options.duration_s}, terminal ? draw_progress : nullptr);
  if (terminal) std::fprintf(stderr, "\r%60s\r", "");
  return facts;
}

void print(const std::vector<DoctorCheck>& checks) {
  // A remedy that mends several things is said once, at the first.
  std::map<std::string, std::string> said;
  int warnings = 0, failures = 0;
  for (const DoctorCheck& check : checks) {
    warnings += check.health == Health::kWarn;
    failures += check.health == Health::kFail;
    const std::string mark = std::string("[") + to_string(check.health) + "]";
    std::printf("%-6s %-24s %s\n", mark.c_str(), check.what.c_str(), check.measured.c_str());
    if (check.remedy.empty()) continue;
    const auto [earlier, fresh] = said.emplace(check.remedy, check.what);
    std::printf("%31s %s\n", "->", fresh ? check.remedy.c_str() : ("as for: " + earlier->second).c_str());
  }
  std::printf("%zu checks: %d failed, %d with warnings\n", checks.size(), failures, warnings);
}

nlohmann::ordered_json to_json(const DoctorFacts& facts, const std::vector<DoctorCheck>& checks) {
  nlohmann::ordered_json report = {{"schema", "rtbus-doctor/1"}, {"healthy", healthy(checks)}};
  const MachineFacts& machine = facts.machine;
  report["machine"] = {{"cpu", machine.cpu},
                       {"cores", machine.cores},
                       {"kernel", machine.kernel},
                       {"preemption", machine.preemption},
                       {"virtualization", machine.virtualization},
                       {"realtime", facts.wakeup.grant.summary()}};
  const WakeupFigures& wakeup = facts.wakeup;
  report["wakeup_latency_us"] = {
      {"p50", wakeup.p50_us}, {"p99", wakeup.p99_us}, {"p999", wakeup.p999_us}, {"max", wakeup.max_us}};
  report["cycles"] = {{"due", wakeup.due}, {"served", wakeup.served}, {"overruns", wakeup.overruns}};
  report["clock_ns"] = facts.clock_ns;
  report["checks"] = nlohmann::ordered_json::array();
  for (const DoctorCheck& check : checks) {
    report["checks"].push_back({{"id", check.id},
                                {"status", to_string(check.health)},
                                {"what", check.what},
                                {"measured", check.measured},
                                {"remedy", check.remedy}});
  }
  return report;
}

int doctor(const DoctorOptions& options) {
  const DoctorFacts facts = gather(options);
  if (interrupted()) return kExitFailed;  // half a measurement would only mislead
  const std::vector<DoctorCheck> checks = judge(facts);
  if (options.json) {
    std::cout << to_json(facts, checks).dump(2) << '\n';
  } else {
    print(checks);
  }
  return healthy(checks) ? kExitFine : kExitFailed;
}

}  // namespace

Action add_doctor(rtbus::Command command) {
  auto options = std::make_shared<DoctorOptions>();
  command.option("-d,--duration", options->duration_s, "Length of the wake-up measurement [s]")
      .range(0.1, 3600.0)
      .show_default();
  command.flag("--json", options->json, "As JSON, schema rtbus-doctor/1");
  command.flag("--vendors", options->vendors, "Also the libraries and services of devices' makers; maps them");
  return [options] { return doctor(*options); };
}

}  // namespace tools
