// What the machine has no more of: shared memory, memory, processes, descriptors, disk.
#include <fcntl.h>
#include <sched.h>
#include <signal.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "rtbus/topic_directory.hpp"
#include "tools/evaluation/faults/fault_session.hpp"
#include "tools/evaluation/faults/helpers.hpp"

namespace tools {

namespace {

constexpr const char* kSharedMemory = "/dev/shm";
constexpr const char* kFiller = "/dev/shm/filler";
constexpr double kExhausted_s = 2.0;
/// It asks for more with each doubling of what it keeps.
constexpr double kSupervisorNeeds_s = 5.0;
constexpr int kMostForks = 300;

/// A mount that this process and its children alone see. @returns why not, or "".
std::string mount_for_us(const std::string& folder, const char* options) {
  if (::unshare(CLONE_NEWNS) != 0) return std::string("unshare: ") + std::strerror(errno);
  if (::mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
      ::mount("tmpfs", folder.c_str(), "tmpfs", MS_NOSUID | MS_NODEV, options) != 0) {
    return std::string("mount: ") + std::strerror(errno);
  }
  return {};
}

/// Tried in a process that ends at once: the own one keeps its file systems.
std::string why_no_mounts() {
  const pid_t pid = ::fork();
  if (pid == 0) ::_exit(mount_for_us(kSharedMemory, "size=1m,mode=1777").empty() ? 0 : 1);
  int status = -1;
  (void)::waitpid(pid, &status, 0);
  return status == 0 ? "" : "it needs a mount namespace, which this user may not have (run it as root)";
}

/// Writes until nothing more fits.
void fill(const std::string& file) {
  const int fd = ::open(file.c_str(), O_CREAT | O_WRONLY | O_CLOEXEC, 0600);
  const std::vector<char> block(65536, 'x');
  for (std::size_t size = block.size(); fd >= 0 && size > 0;) {
    if (::write(fd, block.data(), size) <= 0) size /= 2;
  }
  if (fd >= 0) ::close(fd);
}

void mount_small_shared_memory(RunCommand&, const FaultSession&) {
  if (const std::string why = mount_for_us(kSharedMemory, "size=64m,mode=1777"); !why.empty()) {
    throw std::runtime_error(why);
  }
}

void fill_shared_memory(FaultSession& cell) {
  fill(kFiller);
  cell.follow(FaultSession::kHold_s);
  // The successor finds no room for new topics.
  for (const rtbus::TopicInfo& topic : rtbus::list_topics(cell.name())) {
    if (topic.topic.starts_with("physics.")) {
      ::unlink((std::string(kSharedMemory) + "/" + rtbus::segment_name(cell.name(), topic.topic)).c_str());
    }
  }
  fill(std::string(kFiller) + "2");
  cell.mark_fault();
  cell.signal(cell.physics(), SIGKILL);
  cell.follow(FaultSession::kHold_s);
  cell.mark_over(rtbus::monotonic_ns());
  ::unlink(kFiller);
  ::unlink((std::string(kFiller) + "2").c_str());
}

/// Takes a limit of processes down for a while.
class LoweredLimit {
 public:
  LoweredLimit(const std::vector<pid_t>& processes, __rlimit_resource which, rlim_t (*to)(pid_t)) : which_(which) {
    for (const pid_t pid : processes) {
      rlimit before{};
      if (::prlimit(pid, which_, nullptr, &before) != 0) continue;
      const rlimit now{std::min(to(pid), before.rlim_max), before.rlim_max};
      if (::prlimit(pid, which_, &now, nullptr) == 0) lowered_.push_back({pid, before});
    }
  }
  ~LoweredLimit() {
    for (const Lowered& each : lowered_) (void)::prlimit(each.pid, which_, &each.before, nullptr);
  }
  LoweredLimit(const LoweredLimit&) = delete;
  LoweredLimit& operator=(const LoweredLimit&) = delete;
  [[nodiscard]] bool holds() const noexcept { return !lowered_.empty(); }

 private:
  struct Lowered {
    pid_t pid;
    rlimit before;
  };
  __rlimit_resource which_;
  std::vector<Lowered> lowered_;
};

/// What it has mapped now: nothing more is to be had.
rlim_t mapped_bytes(pid_t pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/statm");
  rlim_t pages = 0;
  file >> pages;
  return pages * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE));
}

/// The lowest number that is free: no descriptor more is to be had.
rlim_t descriptors(pid_t pid) {
  rlim_t free = 0;
  while (::access(("/proc/" + std::to_string(pid) + "/fd/" + std::to_string(free)).c_str(), F_OK) == 0 ||
         std::filesystem::is_symlink("/proc/" + std::to_string(pid) + "/fd/" + std::to_string(free))) {
    ++free;
  }
  return free;
}

/// While something asks for more: an observer comes and goes.
void exhaust(FaultSession& cell, const std::vector<pid_t>& of, __rlimit_resource which, rlim_t (*to)(pid_t)) {
  const LoweredLimit limit(of, which, to);
  if (!limit.holds()) return cell.fail("no limit could be lowered");
  cell.mark_fault();
  const pid_t observer =
      cell.start_tool({"echo", "physics.contact_points.haptic0", "--json", "--session", cell.name()});
  cell.follow(kExhausted_s);
  if (!cell.tool_end()) cell.signal(observer, SIGKILL);
}

/// Without the supervisor, which keeps what its report tells.
std::vector<pid_t> nodes_of(FaultSession& cell) {
  std::vector<pid_t> out = cell.processes();
  std::erase(out, cell.supervisor());
  return out;
}

void exhaust_supervisor(FaultSession& cell) {
  const LoweredLimit limit({cell.supervisor()}, RLIMIT_AS, &mapped_bytes);
  if (!limit.holds()) return cell.fail("no limit could be lowered");
  (void)cell.follow_until(kSupervisorNeeds_s, [&] { return cell.supervisor() == 0; });
}

}  // namespace

std::vector<FaultRow> resource_faults() {
  std::vector<FaultRow> out;
  out.push_back({.name = "shm_full",
                 .what = "/dev/shm is full when physics, killed, is started again without its topics (needs root)",
                 .zero_ms = kLossZero_ms,
                 .restarts_least = 1,
                 .restarts_most = 5,
                 .held = true,
                 .why_not = &why_no_mounts,
                 .prepare = &mount_small_shared_memory,
                 .happen = &fill_shared_memory});
  out.push_back({.name = "shm_full_at_start",
                 .what = "/dev/shm is full when the session starts (needs root)",
                 .feels = Feels::kAnything,
                 .ends = Ends::kNeverStarts,
                 .exit_status = FaultRow::kAnyFailure,
                 .why_not = &why_no_mounts,
                 .prepare = [](RunCommand& command, const FaultSession& cell) {
                   mount_small_shared_memory(command, cell);
                   fill(kFiller);
                 }});
  out.push_back({.name = "memory_exhausted",
                 .what = "no node of the session gets any memory more for 2 s (RLIMIT_AS)",
                 .feels = Feels::kNothing,
                 .happen = [](FaultSession& cell) { exhaust(cell, nodes_of(cell), RLIMIT_AS, &mapped_bytes); }});
  out.push_back({.name = "supervisor_memory_exhausted",
                 .what = "`rtbus run` gets no memory more (RLIMIT_AS)",
                 .feels = Feels::kAnything,
                 .ends = Ends::kMayGoOn,  // if it needs none
                 .restarts_least = -1,    // an ended one writes no report
                 .exit_status = FaultRow::kAnyFailure,
                 .hold_s = kSupervisorNeeds_s,
                 .happen = &exhaust_supervisor});
  out.push_back({.name = "memory_exhausted_at_start",
                 .what = "the session is started with 30 MB of address space per process",
                 .feels = Feels::kAnything,
                 .ends = Ends::kNeverStarts,
                 .exit_status = FaultRow::kAnyFailure,
                 .prepare = [](RunCommand& command, const FaultSession&) { command.limits = "ulimit -v 30000"; }});
  out.push_back({.name = "forks_without_end",
                 .what = "300 processes that fork without end, for a second",
                 .feels = Feels::kNothing,
                 .alone = true,
                 .happen = [](FaultSession& cell) {
                   const ForkStorm storm(kMostForks, FaultSession::kHold_s);
                   if (!storm.run()) return cell.fail("no process could be started");
                   cell.follow(FaultSession::kHold_s);
                 }});
  out.push_back({.name = "descriptors_exhausted",
                 .what = "no process of the session gets any descriptor more for 2 s (RLIMIT_NOFILE)",
                 .feels = Feels::kNothing,
                 .happen = [](FaultSession& cell) { exhaust(cell, cell.processes(), RLIMIT_NOFILE, &descriptors); }});
#if RTBUS_WITH_HDF5
  out.push_back({.name = "disk_full",
                 .what = "the disk is full while the session is recorded (needs root)",
                 .feels = Feels::kNothing,
                 .exit_status = FaultRow::kAnyFailure,
                 .why_not = &why_no_mounts,
                 .prepare =
                     [](RunCommand& command, const FaultSession& cell) {
                       std::filesystem::create_directories(cell.scratch());
                       if (const std::string why = mount_for_us(cell.scratch(), "size=16m"); !why.empty()) {
                         throw std::runtime_error(why);
                       }
                       command.arguments.insert(command.arguments.end(), {"--record", cell.scratch() + "/all.h5"});
                     },
                 .happen =
                     [](FaultSession& cell) {
                       fill(cell.scratch() + "/filler");
                       cell.follow(2.0 * FaultSession::kHold_s);
                     }});
#endif
  return out;
}

}  // namespace tools
