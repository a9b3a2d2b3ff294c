#include "tools/evaluation/faults/fault_cell.hpp"

#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstring>
#include <exception>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "rtbus/topic_directory.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/orders/order_socket.hpp"

namespace tools {

namespace {

/// A cell takes some seconds. What has not ended by then hangs.
constexpr double kLimit_s = 100.0;
constexpr std::uint64_t kPollCell_ns = 20 * rtbus::kNsPerMs;
/// What ends by itself has ended by then.
constexpr double kLastBreath_s = 3.0;

std::vector<pid_t> children() {
  std::ifstream file("/proc/thread-self/children");
  return {std::istream_iterator<pid_t>(file), {}};
}

/// Orphans of the session became children of this process. @returns how many did not end by themselves.
int bury_orphans() {
  int killed = 0;
  const std::uint64_t end_ns = rtbus::monotonic_ns() + static_cast<std::uint64_t>(kLastBreath_s * 1e9);
  for (std::vector<pid_t> left = children(); !left.empty(); left = children()) {
    const bool late = rtbus::monotonic_ns() > end_ns;
    for (const pid_t pid : left) {
      if (late && ::kill(pid, SIGKILL) == 0) ++killed;
      (void)::waitpid(pid, nullptr, late ? 0 : WNOHANG);
    }
    rtbus::sleep_until(rtbus::monotonic_ns() + kPollCell_ns);
  }
  return killed;
}

void write_trace(const std::string& file, const FaultOutcome& outcome) {
  std::ofstream out(file);
  out << "time_ms\tforce_n\n";
  for (const Felt& felt : outcome.trace) {
    const double time_s = felt.time_ns >= outcome.fault_ns ? rtbus::seconds_between(outcome.fault_ns, felt.time_ns)
                                                           : -rtbus::seconds_between(felt.time_ns, outcome.fault_ns);
    out << time_s * 1e3 << '\t' << felt.force_n << '\n';
  }
}

}  // namespace

FaultCell::FaultCell(FaultSetup setup, const std::string& trace)
    : setup_(std::move(setup)),
      began_ns_(rtbus::monotonic_ns()),
      limit_ns_(static_cast<std::uint64_t>((kLimit_s + setup_.row->hold_s) * 1e9)) {
  std::remove(outcome_file().c_str());
  std::fflush(nullptr);
  const pid_t parent = ::getpid();
  pid_ = ::fork();
  if (pid_ != 0) return;
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  ::prctl(PR_SET_CHILD_SUBREAPER, 1);
  if (::getppid() != parent) ::_exit(1);
  try {
    FaultOutcome outcome = FaultSession(setup_).run();
    outcome.processes_left = bury_orphans();
    if (!trace.empty()) write_trace(trace, outcome);
    std::ofstream(outcome_file()) << nlohmann::json(outcome).dump(-1, ' ', false,
                                                                  nlohmann::json::error_handler_t::replace);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "faults: %s: %s\n", setup_.row->name.c_str(), error.what());
  }
  ::_exit(0);
}

FaultCell::FaultCell(FaultCell&& other) noexcept
    : setup_(std::move(other.setup_)),
      pid_(std::exchange(other.pid_, 0)),
      began_ns_(other.began_ns_),
      limit_ns_(other.limit_ns_),
      killed_(other.killed_) {}

FaultCell::~FaultCell() {
  if (pid_ <= 0) return;
  ::kill(pid_, SIGKILL);
  (void)::waitpid(pid_, nullptr, 0);
}

FaultOutcome FaultCell::take(int wait_status) {
  pid_ = 0;
  FaultOutcome out;
  std::ifstream file(outcome_file());
  const auto told = nlohmann::json::parse(file, nullptr, false);
  if (told.is_object()) {
    told.get_to(out);
  } else if (killed_) {
    out.problem = "had not ended after " + std::to_string(limit_ns_ / rtbus::kNsPerS) + " s, and was killed";
  } else if (WIFSIGNALED(wait_status)) {
    out.problem = std::string("the process of the cell was killed: ") + ::strsignal(WTERMSIG(wait_status));
  } else {
    out.problem = "the process of the cell told nothing";
  }
  std::remove(outcome_file().c_str());
  // A session whose supervisor was killed leaves what `rtbus clean` removes.
  (void)rtbus::remove_dead(setup_.session);
  (void)remove_dead_order_sockets(setup_.session);
  return out;
}

std::optional<FaultOutcome> FaultCell::poll() {
  if (pid_ < 0) {
    FaultOutcome out;
    out.problem = "no process could be started for the cell";
    return out;
  }
  int status = 0;
  if (::waitpid(pid_, &status, WNOHANG) == pid_) return take(status);
  if (!killed_ && rtbus::monotonic_ns() > began_ns_ + limit_ns_) {
    killed_ = true;
    ::kill(pid_, SIGKILL);
  }
  return std::nullopt;
}

FaultOutcome FaultCell::wait() {
  while (true) {
    if (auto out = poll()) return std::move(*out);
    if (interrupted() && !std::exchange(killed_, true)) ::kill(pid_, SIGKILL);
    rtbus::sleep_until(rtbus::monotonic_ns() + kPollCell_ns);
  }
}

}  // namespace tools
