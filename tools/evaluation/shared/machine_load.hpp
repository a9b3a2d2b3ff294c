#pragma once
/// @file machine_load.hpp
/// Whether this machine could do what an experiment in real time asked of it. A figure that misses its bar while other
/// programs took the CPUs says nothing about this program: such a check is not judged, and the evidence is told.
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace tools {

/// A run in which the machine itself paused for longer says nothing about us.
inline constexpr double kMachinePause_ms = 5.0;

/// What the machine gave while something was measured. All zero, the default: nothing stood in the way.
struct MachineLoad {
  double others_share = 0.0;  ///< CPU time of other programs, as a share of what the usable CPUs had.
  double stolen_share = 0.0;  ///< CPU time that the hypervisor gave to others, likewise.
  /// Share of the time in which some task waited for a CPU (/proc/pressure/cpu); none: the kernel does not tell.
  std::optional<double> waited_share = std::nullopt;
  double bare_lost_share = 0.0;   ///< Periods that the bare loop beside the haptic loop lost.
  double pause_ms = 0.0;          ///< Longest delay of a realtime loop.
  bool loop_hogs_core = false;    ///< The haptic loop itself took half of its period: its delays are no evidence.
  double late_steps_share = 0.0;  ///< Physics steps that took longer than their period.
  double step_p50_ms = 0.0, period_ms = 0.0;  ///< Of those steps; period 0: not asked.

  /// The worse of both, figure by figure.
  void include(const MachineLoad& other);
  /// The same with the steps of physics held against their period.
  [[nodiscard]] MachineLoad with_steps(std::vector<double> steps_ms, double period_ms) const;
};

/// What kept a check from being judged.
enum class Hindrance : std::uint8_t { kNone, kMachineTooBusy, kMachineTooSlow };

struct Hindered {
  Hindrance by = Hindrance::kNone;
  std::string evidence;  ///< Figures, for people; "" when nothing stood in the way.
};

/// Pure. Too busy goes before too slow: a busy machine makes steps long.
[[nodiscard]] Hindered hindered_by(const MachineLoad& load);

/// Sums since boot, of the CPUs that a process may use.
struct CpuTimes {
  double busy_s = 0.0;    ///< All programs and the kernel.
  double stolen_s = 0.0;  ///< By the hypervisor.
};
/// The pure half, for tests: the text of /proc/stat. @param cpus Numbers of the CPUs.
[[nodiscard]] CpuTimes parse_cpu_times(std::string_view text, const std::vector<int>& cpus, long ticks_per_s);
/// Likewise the text of /proc/pressure/cpu: the time in which some task waited [s].
[[nodiscard]] std::optional<double> parse_cpu_waiting(std::string_view text);

/// Measures from its construction on. What this process and its ended children took is not "others": ask after the
/// nodes of a session have ended.
class LoadMeter {
 public:
  LoadMeter();
  [[nodiscard]] MachineLoad read() const;

 private:
  struct Sums {
    CpuTimes cpu;
    double own_s = 0.0;
    std::optional<double> waited_s;
    std::uint64_t time_ns = 0;
  };
  [[nodiscard]] Sums ask() const;

  std::vector<int> cpus_;
  Sums begin_;
};

}  // namespace tools
