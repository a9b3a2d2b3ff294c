#include "tools/evaluation/shared/machine_load.hpp"

#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <sstream>
#include <utility>

#include "rtbus/clock.hpp"
#include "tools/cli/common/slurp.hpp"
#include "tools/evaluation/shared/median.hpp"

namespace tools {

namespace {

// Less than these was seen to change no figure of an experiment.
constexpr double kStolen = 0.01;
constexpr double kOthers = 0.10, kWaited = 0.05;
constexpr double kBareLost = 0.001;
constexpr double kLateSteps = 0.02;

double cpu_s(int who) {
  rusage used{};
  ::getrusage(who, &used);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(used.ru_utime) + seconds(used.ru_stime);
}

std::vector<int> usable_cpus() {
  std::vector<int> out;
  cpu_set_t set;
  if (::sched_getaffinity(0, sizeof set, &set) != 0) return out;
  for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
    if (CPU_ISSET(cpu, &set)) out.push_back(cpu);
  }
  return out;
}

}  // namespace

void MachineLoad::include(const MachineLoad& other) {
  others_share = std::max(others_share, other.others_share);
  stolen_share = std::max(stolen_share, other.stolen_share);
  if (other.waited_share) waited_share = std::max(waited_share.value_or(0.0), *other.waited_share);
  bare_lost_share = std::max(bare_lost_share, other.bare_lost_share);
  pause_ms = std::max(pause_ms, other.pause_ms);
  loop_hogs_core = loop_hogs_core || other.loop_hogs_core;
  if (other.late_steps_share < late_steps_share) return;
  late_steps_share = other.late_steps_share;
  step_p50_ms = other.step_p50_ms;
  period_ms = other.period_ms;
}

MachineLoad MachineLoad::with_steps(std::vector<double> steps_ms, double period) const {
  MachineLoad out = *this;
  if (steps_ms.empty() || period <= 0.0) return out;
  const auto late = std::count_if(steps_ms.begin(), steps_ms.end(), [period](double ms) { return ms > period; });
  out.late_steps_share = static_cast<double>(late) / static_cast<double>(steps_ms.size());
  out.step_p50_ms = median(std::move(steps_ms));
  out.period_ms = period;
  return out;
}

Hindered hindered_by(const MachineLoad& load) {
  Hindered out;
  char text[160];
  const auto add = [&](Hindrance by) {
    if (out.by == Hindrance::kNone) out.by = by;
    out.evidence += (out.evidence.empty() ? "" : "; ") + std::string(text);
  };
  if (load.others_share > kOthers && load.waited_share.value_or(1.0) > kWaited) {
    std::snprintf(text, sizeof text, "other programs took %.0f %% of the CPU time", 100.0 * load.others_share);
    add(Hindrance::kMachineTooBusy);
    if (load.waited_share) {
      std::snprintf(text, sizeof text, "tasks waited for a CPU during %.0f %% of the time", 100.0 * *load.waited_share);
      add(Hindrance::kMachineTooBusy);
    }
  }
  if (load.stolen_share > kStolen) {
    std::snprintf(text, sizeof text, "the hypervisor took %.1f %% of the CPU time", 100.0 * load.stolen_share);
    add(Hindrance::kMachineTooBusy);
  }
  if (load.bare_lost_share > kBareLost && !load.loop_hogs_core) {
    std::snprintf(text, sizeof text, "an empty loop lost %.1f %% of its periods", 100.0 * load.bare_lost_share);
    add(Hindrance::kMachineTooBusy);
  }
  if (load.pause_ms > kMachinePause_ms && !load.loop_hogs_core) {
    std::snprintf(text, sizeof text, "the machine paused for %.1f ms", load.pause_ms);
    add(Hindrance::kMachineTooBusy);
  }
  if (load.late_steps_share > kLateSteps) {
    std::snprintf(text, sizeof text,
                  "%.0f %% of the physics steps took longer than their period of %.1f ms, median %.1f ms",
                  100.0 * load.late_steps_share, load.period_ms, load.step_p50_ms);
    add(Hindrance::kMachineTooSlow);
  }
  return out;
}

CpuTimes parse_cpu_times(std::string_view text, const std::vector<int>& cpus, long ticks_per_s) {
  CpuTimes out;
  std::istringstream lines{std::string(text)};
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string name;
    words >> name;
    const bool usable =
        std::any_of(cpus.begin(), cpus.end(), [&](int cpu) { return name == "cpu" + std::to_string(cpu); });
    if (!usable) continue;
    // man 5 proc; guests are counted in user and nice already.
    double user = 0, nice = 0, system = 0, idle = 0, iowait = 0, irq = 0, softirq = 0, steal = 0;
    words >> user >> nice >> system >> idle >> iowait >> irq >> softirq >> steal;
    out.busy_s += (user + nice + system + irq + softirq) / static_cast<double>(ticks_per_s);
    out.stolen_s += steal / static_cast<double>(ticks_per_s);
  }
  return out;
}

std::optional<double> parse_cpu_waiting(std::string_view text) {
  if (!text.starts_with("some ")) return std::nullopt;
  const std::string_view key = "total=";
  const std::size_t at = text.find(key);
  double total_us = 0.0;
  if (at == text.npos || !(std::istringstream(std::string(text.substr(at + key.size()))) >> total_us)) {
    return std::nullopt;
  }
  return 1e-6 * total_us;
}

LoadMeter::LoadMeter() : cpus_(usable_cpus()), begin_(ask()) {}

LoadMeter::Sums LoadMeter::ask() const {
  Sums out;
  out.cpu = parse_cpu_times(slurp("/proc/stat"), cpus_, ::sysconf(_SC_CLK_TCK));
  out.own_s = cpu_s(RUSAGE_SELF) + cpu_s(RUSAGE_CHILDREN);
  out.waited_s = parse_cpu_waiting(slurp("/proc/pressure/cpu"));
  out.time_ns = rtbus::monotonic_ns();
  return out;
}

MachineLoad LoadMeter::read() const {
  MachineLoad out;
  const Sums now = ask();
  const double time_s = rtbus::seconds_between(begin_.time_ns, now.time_ns);
  const double had_s = time_s * static_cast<double>(cpus_.size());
  if (had_s <= 0.0) return out;
  const double others_s = (now.cpu.busy_s - begin_.cpu.busy_s) - (now.own_s - begin_.own_s);
  out.others_share = std::clamp(others_s / had_s, 0.0, 1.0);
  out.stolen_share = std::clamp((now.cpu.stolen_s - begin_.cpu.stolen_s) / had_s, 0.0, 1.0);
  if (now.waited_s && begin_.waited_s) {
    out.waited_share = std::clamp((*now.waited_s - *begin_.waited_s) / time_s, 0.0, 1.0);
  }
  return out;
}

}  // namespace tools
