#include "tools/cli/doctor/doctor_checks.hpp"

#include <algorithm>

#include "rtbus/worker_scheduling.hpp"
#include "tools/cli/common/text_table.hpp"

namespace tools {

namespace {

constexpr const char* kLimitsFile =
    "as root: groupadd -f realtime; usermod -aG realtime $USER; printf '@realtime - rtprio 98\\n@realtime - nice "
    "-15\\n@realtime - memlock unlimited\\n' > /etc/security/limits.d/realtime.conf; then log in again. In a "
    "container: --ulimit rtprio=98 --ulimit nice=35 --ulimit memlock=-1 --cap-add SYS_NICE --cap-add IPC_LOCK";

std::string limit_text(std::uint64_t bytes) { return bytes == UINT64_MAX ? "unlimited" : human_bytes(bytes); }

DoctorCheck check_fifo(const DoctorFacts& facts) {
  DoctorCheck check{"sched_fifo", Health::kOk, "SCHED_FIFO granted", "", ""};
  const rtbus::RealtimeGrant& grant = facts.wakeup.grant;
  if (grant.fifo) {
    check.measured = "priority " + std::to_string(grant.priority) + " read back";
    return check;
  }
  check.health = Health::kFail;
  check.measured = "refused: the loop competes with every other process, and an E-stop waits for a CPU";
  check.remedy = kLimitsFile;
  return check;
}

DoctorCheck check_rtprio(const DoctorFacts& facts) {
  DoctorCheck check{"rtprio", Health::kOk, "rtprio limit", "", ""};
  check.measured =
      std::to_string(facts.limits.rtprio) + (facts.limits.cap_sys_nice ? ", not needed with CAP_SYS_NICE" : "");
  constexpr std::uint64_t kPriority = 80;  // what a haptic node asks for unless configured otherwise
  if (facts.limits.cap_sys_nice || facts.limits.rtprio >= kPriority) return check;
  check.health = Health::kWarn;  // the failure itself is check_fifo's
  check.remedy = kLimitsFile;
  return check;
}

DoctorCheck check_nice(const DoctorFacts& facts) {
  DoctorCheck check{"nice", Health::kOk, "nice value of physics", "", ""};
  const bool granted = facts.limits.cap_sys_nice || facts.limits.lowest_nice <= rtbus::kWorkerNice;
  check.measured = granted ? std::to_string(rtbus::kWorkerNice)
                           : "0: many other processes may delay physics that does not rest half of its time";
  if (granted) return check;
  check.health = Health::kWarn;
  check.remedy = kLimitsFile;
  return check;
}

DoctorCheck check_memlock(const DoctorFacts& facts) {
  DoctorCheck check{"memlock", Health::kOk, "memlock limit", limit_text(facts.limits.memlock_bytes), ""};
  if (facts.limits.cap_ipc_lock) check.measured += ", not needed with CAP_IPC_LOCK";
  constexpr std::uint64_t kEnough_bytes = 64u << 20;  // a node with its libraries, stacks and topics
  if (facts.limits.cap_ipc_lock || facts.limits.memlock_bytes >= kEnough_bytes) return check;
  check.health = Health::kWarn;
  check.remedy = kLimitsFile;
  return check;
}

DoctorCheck check_mlockall(const DoctorFacts& facts) {
  DoctorCheck check{"mlockall", Health::kOk, "memory can be locked", "mlockall granted", ""};
  if (facts.wakeup.grant.memory_locked) return check;
  check.health = Health::kFail;
  check.measured = "mlockall refused: a page fault may stop the loop for milliseconds";
  check.remedy = kLimitsFile;
  return check;
}

DoctorCheck check_dma_latency(const DoctorFacts& facts) {
  DoctorCheck check{"cpu_dma_latency", Health::kOk, "/dev/cpu_dma_latency", "held at 0 us while the loop runs", ""};
  if (facts.wakeup.grant.dma_latency_held) return check;
  check.health = Health::kWarn;
  check.measured = "not writable: the CPU may sleep deeply between cycles";
  check.remedy =
      "as root: chgrp realtime /dev/cpu_dma_latency; chmod g+w /dev/cpu_dma_latency (a udev rule keeps it: "
      "KERNEL==\"cpu_dma_latency\", GROUP=\"realtime\", MODE=\"0660\")";
  return check;
}

DoctorCheck check_throttling(const DoctorFacts& facts) {
  DoctorCheck check{"rt_throttling", Health::kOk, "realtime throttling", "", ""};
  if (!facts.limits.rt_runtime_us || !facts.limits.rt_period_us) {
    check.measured = "not reported by this kernel";
    return check;
  }
  const long runtime_us = *facts.limits.rt_runtime_us, period_us = std::max(1L, *facts.limits.rt_period_us);
  if (runtime_us < 0 || runtime_us >= period_us) {
    check.measured = "off";
    return check;
  }
  check.measured = std::to_string(runtime_us) + " of " + std::to_string(period_us) + " us may be realtime on each core";
  // A loop that sleeps uses a few per cent; only busy waiting comes near the default of 95 %.
  if (runtime_us * 2 >= period_us) return check;
  check.health = Health::kWarn;
  check.remedy = "as root: sysctl -w kernel.sched_rt_runtime_us=950000";
  return check;
}

DoctorCheck check_governor(const DoctorFacts& facts) {
  DoctorCheck check{"governor", Health::kOk, "CPU frequency governor", facts.machine.governor, ""};
  if (facts.machine.governor.empty()) check.measured = "no cpufreq here: firmware or host decides";
  if (facts.machine.governor.empty() || facts.machine.governor == "performance") return check;
  check.health = Health::kWarn;
  check.remedy = "as root: cpupower frequency-set -g performance (package linux-cpupower)";
  return check;
}

DoctorCheck check_preemption(const DoctorFacts& facts) {
  DoctorCheck check{"preemption", Health::kOk, "kernel preemption",
                    facts.machine.preemption + " (" + facts.machine.kernel + ")", ""};
  if (facts.machine.preemption == "PREEMPT_RT") return check;
  check.health = Health::kWarn;
  check.remedy = facts.machine.preemption == "PREEMPT_DYNAMIC"
                     ? "best: apt install linux-image-rt-amd64 (Debian) or `pro enable realtime-kernel` (Ubuntu); else "
                       "boot with preempt=full"
                     : "apt install linux-image-rt-amd64 (Debian) or `pro enable realtime-kernel` (Ubuntu)";
  return check;
}

DoctorCheck check_cores(const DoctorFacts& facts) {
  const MachineFacts& machine = facts.machine;
  DoctorCheck check{"cores", Health::kOk, "cores", "", ""};
  check.measured =
      std::to_string(machine.usable_cores) + " usable of " + std::to_string(machine.cores) + ", " + machine.cpu;
  if (machine.usable_cores >= 2) return check;
  check.health = Health::kWarn;
  check.remedy = "physics and haptics share one core: give this machine or container a second one";
  return check;
}

DoctorCheck check_isolation(const DoctorFacts& facts) {
  DoctorCheck check{"isolcpus", Health::kOk, "isolated cores", facts.machine.isolated_cores, ""};
  // Not a defect at 1 kHz, so it is said without a warning.
  if (check.measured.empty()) {
    check.measured = "none; above 2 kHz boot with isolcpus=managed_irq,domain,N nohz_full=N and set realtime.core: N";
  }
  return check;
}

DoctorCheck check_clock(const DoctorFacts& facts) {
  DoctorCheck check{"clocksource", Health::kOk, "clock", "", ""};
  check.measured = facts.machine.clocksource + ", " + fixed(facts.clock_ns, 0) + " ns per reading";
  constexpr double kSystemCall_ns = 150.0;  // the vDSO takes 15 to 60 ns, a system call 200 and more
  if (facts.clock_ns < kSystemCall_ns) return check;
  check.health = Health::kWarn;
  check.measured += ": each reading is a system call";
  check.remedy =
      "boot with clocksource=tsc tsc=reliable (see /sys/devices/system/clocksource/clocksource0/"
      "available_clocksource)";
  return check;
}

DoctorCheck check_shm(const DoctorFacts& facts) {
  DoctorCheck check{"dev_shm", Health::kOk, "/dev/shm", "", ""};
  if (!facts.shm) {
    check.health = Health::kFail;
    check.measured = "not mounted: topics have nowhere to live";
    check.remedy = "as root: mount -t tmpfs -o nosuid,nodev,mode=1777 tmpfs /dev/shm";
    return check;
  }
  check.measured = facts.shm->type + ", " + human_bytes(facts.shm->free_bytes) + " free of " +
                   human_bytes(facts.shm->size_bytes) + ", " + facts.shm->options;
  constexpr std::uint64_t kNeeded_bytes = 16u << 20, kComfortable_bytes = 64u << 20;
  const bool read_only = facts.shm->options == "ro" || facts.shm->options.starts_with("ro,");
  if (read_only || facts.shm->free_bytes < kNeeded_bytes) {
    check.health = Health::kFail;
    check.remedy = "as root: mount -o remount,rw,size=50% /dev/shm; in a container: --shm-size=1g";
  } else if (facts.shm->type != "tmpfs" || facts.shm->free_bytes < kComfortable_bytes) {
    check.health = Health::kWarn;
    check.remedy = facts.shm->type != "tmpfs"
                       ? "mount a tmpfs there: a disk behind it may stop the loop"
                       : "as root: mount -o remount,size=50% /dev/shm; in a container: --shm-size=1g";
  }
  return check;
}

DoctorCheck check_virtual(const DoctorFacts& facts) {
  DoctorCheck check{"virtual_machine", Health::kOk, "hardware", "no hypervisor seen", ""};
  if (facts.machine.virtualization.empty()) return check;
  check.measured = facts.machine.virtualization;
  if (facts.machine.virtualization == "container") return check;  // the host's kernel itself: costs nothing
  check.health = Health::kWarn;
  check.measured += ": the host pauses this machine as it likes";
  check.remedy = "fine for development; put a real device on real hardware, or pin the virtual CPUs on the host";
  return check;
}

DoctorCheck check_wakeup(const DoctorFacts& facts) {
  const WakeupFigures& wakeup = facts.wakeup;
  DoctorCheck check{"wakeup_latency", Health::kOk, "wake-up at 1 kHz", "", ""};
  check.measured = "p50 " + fixed(wakeup.p50_us, 1) + ", p99 " + fixed(wakeup.p99_us, 1) + ", max " +
                   fixed(wakeup.max_us, 1) + " us after the deadline, " + std::to_string(wakeup.overruns) + " of " +
                   std::to_string(wakeup.due) + " cycles skipped, " + wakeup.grant.scheduling();
  const double skipped = wakeup.due > 0 ? static_cast<double>(wakeup.overruns) / static_cast<double>(wakeup.due) : 1.0;
  if (wakeup.served == 0 || wakeup.p99_us >= 1000.0 || skipped > 0.01) {
    check.health = Health::kFail;
    check.remedy =
        "more than one tick in a hundred comes a period late; repair what is marked above, end heavy processes";
  } else if (wakeup.p99_us >= 100.0 || wakeup.max_us >= 1000.0) {
    check.health = Health::kWarn;
    check.remedy = "late ticks can be felt with stiff walls; repair what is marked above, first [fail], then [warn]";
  }
  return check;
}

DoctorCheck check_remove_ipc(const DoctorFacts& facts) {
  const LogindFacts& logind = facts.logind;
  DoctorCheck check{"remove_ipc", Health::kOk, "topics at log-out", "", ""};
  if (!logind.running) {
    check.measured = "kept: no systemd-logind here";
  } else if (!logind.remove_ipc) {
    check.measured = "kept: RemoveIPC=no in " + logind.set_in;
  } else if (logind.system_user) {
    check.measured = "kept: systemd-logind spares root and system users";
  } else if (logind.lingers) {
    check.measured = "kept: this user lingers";
  } else {
    check.health = Health::kWarn;
    check.measured = std::string("deleted by systemd-logind when this user's last session ends (RemoveIPC=yes, ") +
                     (logind.set_in.empty() ? "the default" : logind.set_in) +
                     "); nodes that continue create them again; readers that attach in between find nothing";
    check.remedy =
        "loginctl enable-linger, or as root: mkdir -p /etc/systemd/logind.conf.d && printf '[Login]\\nRemoveIPC=no\\n' "
        "> /etc/systemd/logind.conf.d/rtbus.conf && systemctl restart systemd-logind";
  }
  return check;
}

DoctorCheck check_stale(const DoctorFacts& facts) {
  DoctorCheck check{"stale_segments", Health::kOk, "left-over segments", "none", ""};
  std::size_t dead = 0;
  std::uint64_t bytes = 0;
  for (const rtbus::TopicInfo& info : facts.topics) {
    if (info.writer_alive || !info.problem.empty()) continue;  // what cannot be read may well be alive
    ++dead;
    bytes += info.segment_bytes;
  }
  if (dead == 0) return check;
  check.health = Health::kWarn;
  check.measured = std::to_string(dead) + " of dead processes, " + human_bytes(bytes);
  check.remedy = "rtbus clean";
  return check;
}

/// Most sessions do without it: that it is not there is nothing to warn of.
DoctorCheck check_bridge(const DoctorFacts& facts) {
  DoctorCheck check{"bridge", Health::kOk, "bridge to ROS 2", "installed", ""};
  if (facts.bridge_is_here) return check;
  check.measured = "not installed";
  check.remedy = "only for ROS 2: install the package rtbus-bridge, or build with cyclonedds-dev and cyclonedds-tools";
  return check;
}

}  // namespace

std::vector<DoctorCheck> judge(const DoctorFacts& facts) {
  std::vector<DoctorCheck> out = {check_fifo(facts),       check_rtprio(facts),    check_nice(facts),
                                  check_memlock(facts),    check_mlockall(facts),  check_dma_latency(facts),
                                  check_throttling(facts), check_governor(facts),  check_preemption(facts),
                                  check_cores(facts),      check_isolation(facts), check_clock(facts),
                                  check_shm(facts),        check_virtual(facts),   check_remove_ipc(facts),
                                  check_stale(facts),      check_bridge(facts),    check_wakeup(facts)};
  // No vendor's device is needed for forces at 1 kHz: nothing of theirs makes a machine unfit.
  for (const drivers::Finding& each : facts.vendors) {
    out.push_back({"vendor", each.ok ? Health::kOk : Health::kWarn, each.what, each.state, each.remedy});
  }
  return out;
}

const char* to_string(Health health) noexcept {
  switch (health) {
    case Health::kOk:
      return "ok";
    case Health::kWarn:
      return "warn";
    case Health::kFail:
      return "fail";
  }
  return "?";
}

bool healthy(std::span<const DoctorCheck> checks) noexcept {
  return std::none_of(checks.begin(), checks.end(),
                      [](const DoctorCheck& check) { return check.health == Health::kFail; });
}

}  // namespace tools
