#pragma once
/// @file ask_kernel.hpp
/// Facts about this machine and its processes, read from /proc, /sys and system calls. Nothing here is cached, nothing
/// changes anything. What the kernel does not tell is empty, zero or nullopt: never guessed.
#include <sys/types.h>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace tools {

/// The machine, as reports and `rtbus doctor` name it.
struct MachineFacts {
  std::string cpu;             ///< "AMD EPYC 9R14"; the architecture where the kernel names no model.
  unsigned cores = 0;          ///< Cores online.
  unsigned usable_cores = 0;   ///< Cores this process may run on.
  std::string kernel;          ///< "Linux 6.1.0-28-rt-amd64".
  std::string preemption;      ///< "PREEMPT_RT", "PREEMPT_DYNAMIC", "PREEMPT" or "none".
  std::string virtualization;  ///< "" on bare metal as far as the kernel tells, else "KVM", "VMware", "container", …
  std::string clocksource;     ///< "tsc".
  std::string governor;        ///< cpufreq governors, distinct, comma-separated; "" where there is no cpufreq.
  std::string isolated_cores;  ///< As the kernel prints it ("2-3"); "" when none.
  std::uint64_t memory_bytes = 0;
};
[[nodiscard]] MachineFacts ask_machine();

/// What realtime threads of this user may do, before anybody tries.
struct RealtimeLimits {
  std::uint64_t rtprio = 0;           ///< RLIMIT_RTPRIO, soft: highest SCHED_FIFO priority without a capability.
  int lowest_nice = 20;               ///< By RLIMIT_NICE, soft: the lowest nice value without a capability.
  std::uint64_t memlock_bytes = 0;    ///< RLIMIT_MEMLOCK, soft; UINT64_MAX: unlimited.
  bool cap_sys_nice = false;          ///< Effective CAP_SYS_NICE: any priority whatever the limit says.
  bool cap_ipc_lock = false;          ///< Effective CAP_IPC_LOCK: any amount of locked memory.
  std::optional<long> rt_runtime_us;  ///< kernel.sched_rt_runtime_us; −1: no throttling. nullopt: not told.
  std::optional<long> rt_period_us;   ///< kernel.sched_rt_period_us.
};
[[nodiscard]] RealtimeLimits ask_limits();

/// What one process uses now.
struct ProcessUsage {
  std::string name;             ///< As `ps` shows it, at most 15 bytes.
  char state = '?';             ///< R, S, D, T (stopped), Z (zombie), …
  double cpu_s = 0.0;           ///< User plus system time since it started [s], to 1/sysconf(_SC_CLK_TCK).
  std::uint64_t rss_bytes = 0;  ///< Resident memory.
  unsigned threads = 0;
};
/// nullopt when there is no such process, or it may not be seen.
[[nodiscard]] std::optional<ProcessUsage> ask_process(pid_t pid);

/// Shared libraries that `pid` has mapped, full paths, sorted, each once; empty also when it may not be asked.
[[nodiscard]] std::vector<std::string> mapped_libraries(pid_t pid);

/// The names of its threads, one for each, in no order; empty when there is no such process.
[[nodiscard]] std::vector<std::string> thread_names(pid_t pid);

/// A mounted file system that files go to.
struct MountFacts {
  std::string type;     ///< "tmpfs".
  std::string options;  ///< "rw,nosuid,nodev".
  std::uint64_t size_bytes = 0;
  std::uint64_t free_bytes = 0;  ///< For this user.
};
/// The file system mounted on exactly `path`; nullopt when none is.
[[nodiscard]] std::optional<MountFacts> ask_mount(std::string_view path);

/// Mean cost of one clock_gettime(CLOCK_MONOTONIC) [ns], measured over about 20 ms at most. Tens: served by the vDSO;
/// hundreds: each one is a system call.
[[nodiscard]] double measure_clock_ns();

/// The pure half of ask_process(), for tests: the text of /proc/PID/stat.
/// @param ticks_per_s,page_bytes sysconf(_SC_CLK_TCK) and sysconf(_SC_PAGESIZE).
[[nodiscard]] std::optional<ProcessUsage> parse_process_stat(std::string_view text, long ticks_per_s, long page_bytes);

/// The pure half of mapped_libraries(): the text of /proc/PID/maps.
[[nodiscard]] std::vector<std::string> parse_mapped_libraries(std::string_view text);

/// The pure half of ask_mount(): the line for `path` in the text of /proc/self/mounts; the sizes stay zero. The last
/// line wins, as the last mount hides those below it.
[[nodiscard]] std::optional<MountFacts> parse_mount(std::string_view text, std::string_view path);

}  // namespace tools
