#include "tools/cli/host/ask_kernel.hpp"

#include <sched.h>
#include <sys/resource.h>
#include <sys/statvfs.h>
#include <sys/utsname.h>
#include <unistd.h>

#if defined(__x86_64__)
#include <cpuid.h>
#endif

#include <algorithm>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <utility>

#include "rtbus/clock.hpp"
#include "tools/cli/common/slurp.hpp"

namespace tools {

namespace {

namespace fs = std::filesystem;

std::string first_line(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

std::optional<long> number_in(const std::string& path) {
  std::ifstream file(path);
  long value = 0;
  if (file >> value) return value;
  return std::nullopt;
}

/// "key<blanks>: value" in /proc/cpuinfo and its like: the first value of `key`.
std::string value_of(std::string_view text, std::string_view key) {
  std::istringstream lines{std::string(text)};
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with(key)) continue;
    const std::size_t colon = line.find(':');
    if (colon == std::string::npos || line.find_first_not_of(" \t", key.size()) != colon) continue;
    const std::size_t start = line.find_first_not_of(" \t", colon + 1);
    return start == std::string::npos ? "" : line.substr(start);
  }
  return "";
}

/// Name of the hypervisor by its CPUID signature, which no firmware table can hide; "" on bare metal.
std::string ask_hypervisor() {
#if defined(__x86_64__)
  unsigned eax = 0, ebx = 0, ecx = 0, edx = 0;
  if (__get_cpuid(1, &eax, &ebx, &ecx, &edx) == 0 || (ecx >> 31 & 1) == 0) return "";
  __cpuid(0x40000000, eax, ebx, ecx, edx);
  char signature[13] = {};
  std::memcpy(signature, &ebx, 4);
  std::memcpy(signature + 4, &ecx, 4);
  std::memcpy(signature + 8, &edx, 4);
  constexpr std::pair<std::string_view, const char*> kKnown[] = {{"KVMKVMKVM", "KVM"},
                                                                 {"VMwareVMware", "VMware"},
                                                                 {"VBoxVBoxVBox", "VirtualBox"},
                                                                 {"XenVMMXenVMM", "Xen"},
                                                                 {"Microsoft Hv", "Microsoft Hyper-V"},
                                                                 {"TCGTCGTCGTCG", "QEMU without KVM"}};
  for (const auto& [text, name] : kKnown) {
    if (text == signature) return name;
  }
  return "virtual machine";
#else
  return first_line("/sys/hypervisor/type");
#endif
}

std::string ask_virtualization() {
  if (std::string name = ask_hypervisor(); !name.empty()) return name;
  std::error_code ignored;
  if (fs::exists("/.dockerenv", ignored) || fs::exists("/run/.containerenv", ignored)) return "container";
  return "";
}

std::string ask_governors() {
  std::set<std::string> governors;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator("/sys/devices/system/cpu", error)) {
    const std::string governor = first_line(entry.path().string() + "/cpufreq/scaling_governor");
    if (!governor.empty()) governors.insert(governor);
  }
  std::string joined;
  for (const std::string& each : governors) joined += (joined.empty() ? "" : ",") + each;
  return joined;
}

std::string ask_preemption(const std::string& version) {
  // "#1 SMP PREEMPT_RT …": the build says its model in the version; older realtime kernels only have the flag file.
  if (first_line("/sys/kernel/realtime") == "1" || version.find("PREEMPT_RT") != std::string::npos) return "PREEMPT_RT";
  if (version.find("PREEMPT_DYNAMIC") != std::string::npos) return "PREEMPT_DYNAMIC";
  return version.find("PREEMPT") != std::string::npos ? "PREEMPT" : "none";
}

/// Removes the first blank-separated word of `rest`.
std::string_view take_word(std::string_view& rest) {
  const std::size_t start = std::min(rest.find_first_not_of(" \t"), rest.size());
  const std::size_t end = std::min(rest.find_first_of(" \t", start), rest.size());
  const std::string_view word = rest.substr(start, end - start);
  rest.remove_prefix(end);
  return word;
}

}  // namespace

MachineFacts ask_machine() {
  MachineFacts facts;
  utsname uts{};
  ::uname(&uts);
  const std::string cpuinfo = slurp("/proc/cpuinfo");
  facts.cpu = value_of(cpuinfo, "model name");
  if (facts.cpu.empty()) facts.cpu = uts.machine;
  facts.cores = static_cast<unsigned>(std::max(0L, ::sysconf(_SC_NPROCESSORS_ONLN)));
  cpu_set_t usable;
  CPU_ZERO(&usable);
  if (::sched_getaffinity(0, sizeof usable, &usable) == 0)
    facts.usable_cores = static_cast<unsigned>(CPU_COUNT(&usable));
  facts.kernel = std::string(uts.sysname) + " " + uts.release;
  facts.preemption = ask_preemption(uts.version);
  facts.virtualization = ask_virtualization();
  facts.clocksource = first_line("/sys/devices/system/clocksource/clocksource0/current_clocksource");
  facts.governor = ask_governors();
  facts.isolated_cores = first_line("/sys/devices/system/cpu/isolated");
  facts.memory_bytes = static_cast<std::uint64_t>(std::max(0L, ::sysconf(_SC_PHYS_PAGES))) *
                       static_cast<std::uint64_t>(std::max(0L, ::sysconf(_SC_PAGESIZE)));
  return facts;
}

RealtimeLimits ask_limits() {
  RealtimeLimits limits;
  rlimit limit{};
  if (::getrlimit(RLIMIT_RTPRIO, &limit) == 0) limits.rtprio = limit.rlim_cur;
  if (::getrlimit(RLIMIT_NICE, &limit) == 0)
    limits.lowest_nice = 20 - static_cast<int>(std::min<rlim_t>(limit.rlim_cur, 40));
  if (::getrlimit(RLIMIT_MEMLOCK, &limit) == 0) {
    limits.memlock_bytes = limit.rlim_cur == RLIM_INFINITY ? UINT64_MAX : limit.rlim_cur;
  }
  // Bits of <linux/capability.h>: CAP_IPC_LOCK 14, CAP_SYS_NICE 23.
  const std::string effective = value_of(slurp("/proc/self/status"), "CapEff");
  std::uint64_t bits = 0;
  std::from_chars(effective.data(), effective.data() + effective.size(), bits, 16);
  limits.cap_ipc_lock = (bits >> 14 & 1) != 0;
  limits.cap_sys_nice = (bits >> 23 & 1) != 0;
  limits.rt_runtime_us = number_in("/proc/sys/kernel/sched_rt_runtime_us");
  limits.rt_period_us = number_in("/proc/sys/kernel/sched_rt_period_us");
  return limits;
}

std::optional<ProcessUsage> parse_process_stat(std::string_view text, long ticks_per_s, long page_bytes) {
  // "PID (name) S ppid …": the name may hold blanks and brackets itself, so its end is the last ')'.
  const std::size_t open = text.find('('), close = text.rfind(')');
  if (open == std::string_view::npos || close == std::string_view::npos || close < open || ticks_per_s <= 0) {
    return std::nullopt;
  }
  ProcessUsage usage;
  usage.name = text.substr(open + 1, close - open - 1);
  std::string_view rest = text.substr(close + 1);
  const std::string_view state = take_word(rest);
  if (state.size() != 1) return std::nullopt;
  usage.state = state[0];
  // Fields as proc(5) numbers them; `state` was the third.
  std::uint64_t ticks = 0;
  for (int field = 4; field <= 24; ++field) {
    const std::string_view word = take_word(rest);
    std::uint64_t value = 0;
    if (field != 14 && field != 15 && field != 20 && field != 24) continue;
    if (std::from_chars(word.data(), word.data() + word.size(), value).ec != std::errc{}) return std::nullopt;
    if (field == 14 || field == 15) ticks += value;
    if (field == 20) usage.threads = static_cast<unsigned>(value);
    if (field == 24) usage.rss_bytes = value * static_cast<std::uint64_t>(page_bytes);
  }
  usage.cpu_s = static_cast<double>(ticks) / static_cast<double>(ticks_per_s);
  return usage;
}

std::optional<ProcessUsage> ask_process(pid_t pid) {
  const std::string text = slurp("/proc/" + std::to_string(pid) + "/stat");
  return parse_process_stat(text, ::sysconf(_SC_CLK_TCK), ::sysconf(_SC_PAGESIZE));
}

std::vector<std::string> parse_mapped_libraries(std::string_view text) {
  std::set<std::string> libraries;
  std::istringstream lines{std::string(text)};
  for (std::string line; std::getline(lines, line);) {
    const std::size_t slash = line.find('/');
    if (slash == std::string::npos) continue;
    std::string path = line.substr(slash);
    const std::string_view file = std::string_view(path).substr(path.rfind('/') + 1);
    // "libfoo.so" or "libfoo.so.1.2": not every mapped file with "so" in its name.
    if (file.ends_with(".so") || file.find(".so.") != std::string_view::npos) libraries.insert(std::move(path));
  }
  return {libraries.begin(), libraries.end()};
}

std::vector<std::string> mapped_libraries(pid_t pid) {
  return parse_mapped_libraries(slurp("/proc/" + std::to_string(pid) + "/maps"));
}

std::vector<std::string> thread_names(pid_t pid) {
  std::vector<std::string> names;
  std::error_code gone;  // threads end, processes too
  for (const auto& task : fs::directory_iterator("/proc/" + std::to_string(pid) + "/task", gone)) {
    std::string name = slurp(task.path() / "comm");
    if (!name.empty() && name.back() == '\n') name.pop_back();
    if (!name.empty()) names.push_back(std::move(name));
  }
  return names;
}

std::optional<MountFacts> parse_mount(std::string_view text, std::string_view path) {
  std::optional<MountFacts> found;
  std::istringstream lines{std::string(text)};
  for (std::string line; std::getline(lines, line);) {
    std::string_view rest = line;
    take_word(rest);  // what is mounted
    if (take_word(rest) != path) continue;
    MountFacts mount;
    mount.type = take_word(rest);
    mount.options = take_word(rest);
    found = std::move(mount);
  }
  return found;
}

std::optional<MountFacts> ask_mount(std::string_view path) {
  std::optional<MountFacts> mount = parse_mount(slurp("/proc/self/mounts"), path);
  struct statvfs space {};
  if (!mount || ::statvfs(std::string(path).c_str(), &space) != 0) return mount;
  mount->size_bytes = static_cast<std::uint64_t>(space.f_blocks) * space.f_frsize;
  mount->free_bytes = static_cast<std::uint64_t>(space.f_bavail) * space.f_frsize;
  return mount;
}

double measure_clock_ns() {
  constexpr int kBatch = 1000;
  constexpr std::uint64_t kLongest_ns = 20 * rtbus::kNsPerMs;
  // The fastest batch, so that a pause of the machine does not count.
  double best_ns = 0.0;
  const std::uint64_t begin_ns = rtbus::monotonic_ns();
  for (int round = 0; round < 50 && rtbus::monotonic_ns() - begin_ns < kLongest_ns; ++round) {
    const std::uint64_t from_ns = rtbus::monotonic_ns();
    std::uint64_t to_ns = from_ns;
    for (int i = 0; i < kBatch; ++i) to_ns = rtbus::monotonic_ns();
    const double each_ns = static_cast<double>(to_ns - from_ns) / kBatch;
    if (round == 0 || each_ns < best_ns) best_ns = each_ns;
  }
  return best_ns;
}

}  // namespace tools
