// What happens to the whole machine: its clock is set, it sleeps, rights are taken away.
#include <sched.h>
#include <signal.h>
#include <unistd.h>

#include <charconv>
#include <filesystem>
#include <fstream>

#include "tools/cli/common/find_config.hpp"
#include "tools/evaluation/faults/fault_session.hpp"
#include "tools/evaluation/faults/wall_clock.hpp"

namespace tools {

namespace {

constexpr double kSuspended_s = 10.0;
constexpr double kHour_s = 3600.0;

std::string clock_library() { return folder_of_this_program() + "/libfault_wall_clock.so"; }

std::string why_no_clock() {
  std::error_code none;
  return std::filesystem::exists(clock_library(), none) ? "" : clock_library() + " is not built";
}

std::string clock_file(const FaultSession& cell) { return cell.scratch() + ".clock"; }

void set_clock(const FaultSession& cell, double offset_s) {
  std::ofstream file(clock_file(cell), std::ios::binary | std::ios::in | std::ios::out);
  file.write(reinterpret_cast<const char*>(&offset_s), sizeof offset_s);
}

void suspend(FaultSession& cell) {
  const std::vector<pid_t> all = cell.processes();
  for (const pid_t pid : all) cell.signal(pid, SIGSTOP);
  cell.follow(kSuspended_s);
  // What was felt before belongs to the hand that pressed: the promise counts from here.
  cell.mark_fault();
  for (const pid_t pid : all) cell.signal(pid, SIGCONT);
}

/// All threads of the haptic node become ordinary ones.
void take_realtime(FaultSession& cell) {
  std::error_code gone;
  int taken = 0;
  for (const auto& task :
       std::filesystem::directory_iterator("/proc/" + std::to_string(cell.haptic()) + "/task", gone)) {
    const std::string number = task.path().filename().string();
    pid_t thread = 0;
    std::from_chars(number.data(), number.data() + number.size(), thread);
    const sched_param ordinary{};
    if (thread > 1 && ::sched_setscheduler(thread, SCHED_OTHER | SCHED_RESET_ON_FORK, &ordinary) == 0) ++taken;
  }
  if (taken == 0) cell.fail("no thread of haptic_node lost its priority");
  cell.follow(FaultSession::kHold_s);
}

}  // namespace

std::vector<FaultRow> machine_faults() {
  std::vector<FaultRow> out;
  out.push_back(
      {.name = "clock_stepped",
       .what = "the wall clock of all processes is set an hour ahead, then an hour back",
       .feels = Feels::kNothing,
       .counts_ticks = true,
       .why_not = &why_no_clock,
       .prepare =
           [](RunCommand& command, const FaultSession& cell) {
             constexpr double kNow = 0.0;
             std::ofstream(clock_file(cell), std::ios::binary).write(reinterpret_cast<const char*>(&kNow), sizeof kNow);
             command.preload = clock_library();
             command.environment.emplace_back(kWallClockVariable, clock_file(cell));
           },
       .happen =
           [](FaultSession& cell) {
             for (const double offset_s : {kHour_s, -kHour_s, 0.0}) {
               set_clock(cell, offset_s);
               cell.follow(FaultSession::kHold_s);
             }
             std::filesystem::remove(clock_file(cell));
           }});
  out.push_back({.name = "all_stopped",
                 .what = "all processes of the session are stopped together for 10 s, as by a suspend",
                 .zero_ms = kDeviceZero_ms,
                 .own_pauses = true,
                 .hold_s = kSuspended_s,
                 .happen = &suspend});
  out.push_back({.name = "realtime_taken",
                 .what = "all threads of haptic_node lose their realtime priority",
                 .feels = Feels::kAnything,
                 .alone = true,
                 .own_wakeups = true,
                 .counts_ticks = true,
                 .happen = &take_realtime});
  return out;
}

}  // namespace tools
