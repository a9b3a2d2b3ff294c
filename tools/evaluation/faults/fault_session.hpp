#pragma once
/// @file fault_session.hpp
/// One cell: a session runs as `rtbus run` starts it, and a row of the table goes wrong while the hand presses on the
/// wall. What the hand felt is read from the plant, which lives in a process of its own, or from the stand-in for the
/// device. `rtbus evaluate faults` and tests/faults run the same cells.
#include <sys/types.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/clock.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/subscription.hpp"
#include "tools/cli/host/bare_loop.hpp"
#include "tools/cli/run/supervisor.hpp"
#include "tools/evaluation/faults/fault_outcome.hpp"
#include "tools/evaluation/faults/fault_row.hpp"

namespace tools {

struct FaultSetup {
  const FaultRow* row = nullptr;
  std::string method = {};        ///< "local_contact"; empty: the session's own.
  std::string program = {};       ///< The `rtbus` program; the nodes lie beside it.
  std::string session_file = {};  ///< One device and a hand that pushes: `process: own`, or a stand-in.
  std::string session = {};       ///< Name for this run; must be free.
  std::string report = {};        ///< Where `rtbus run` writes its report.
};

/// What a row may do and ask while it happens. One thread.
class FaultSession {
 public:
  explicit FaultSession(const FaultSetup& setup);
  ~FaultSession();
  FaultSession(const FaultSession&) = delete;
  FaultSession& operator=(const FaultSession&) = delete;

  /// From `rtbus run` to its end. Call it once.
  [[nodiscard]] FaultOutcome run();

  // For the rows.
  static constexpr double kHold_s = 1.0;  ///< How long most faults last.
  static constexpr double kZeroPatience_s = 2.0;

  /// Looks at the session until `condition` holds. @returns whether it did in time.
  bool follow_until(double timeout_s, const std::function<bool()>& condition);
  void follow(double seconds);
  /// Waits until the force is zero; a problem when it does not get there.
  void await_zero();
  /// The fault begins now: what the promises count from. The first call is made for the row.
  void mark_fault() { out_.fault_ns = rtbus::monotonic_ns(); }
  void mark_fault_at(std::uint64_t time_ns) { out_.fault_ns = time_ns; }
  /// The fault is over: what the return counts from. Without it: when the row is done.
  void mark_over(std::uint64_t time_ns) { over_ns_ = time_ns; }
  /// There should be no force from one time to the other, but for the time that zero may take. Without it, of a row
  /// that is held: while the fault lasts.
  void expect_no_force(std::uint64_t from_ns, std::uint64_t to_ns) { without_force_.push_back({from_ns, to_ns}); }
  /// The cell could not be run as meant. The first one counts.
  void fail(std::string problem);

  /// Of the processes that beat now; 1 when there is none: no signal goes anywhere, and the cell has a problem.
  [[nodiscard]] pid_t haptic();
  [[nodiscard]] pid_t physics();
  [[nodiscard]] pid_t plant();
  [[nodiscard]] pid_t supervisor() const noexcept { return run_pid_; }
  /// Supervisor, nodes and plant, those that run.
  [[nodiscard]] std::vector<pid_t> processes();
  void signal(pid_t process, int number);
  /// SIGSTOP, and SIGCONT some time later.
  void stop_for(pid_t process, double seconds);

  /// Starts another command of `rtbus`. @returns its process; 0: it could not be started, which is a problem.
  pid_t start_tool(const std::vector<std::string>& arguments, bool any_program = false);
  /// How the last tool ended; nothing: it runs.
  [[nodiscard]] const std::optional<ChildEnd>& tool_end() const noexcept { return tool_end_; }

  [[nodiscard]] double force_n() const noexcept { return out_.trace.empty() ? 0.0 : out_.trace.back().force_n; }
  [[nodiscard]] const rtbus::Session& session() const noexcept { return session_; }
  [[nodiscard]] const std::string& name() const noexcept { return setup_.session; }
  [[nodiscard]] const FaultSetup& setup() const noexcept { return setup_; }
  [[nodiscard]] std::string trigger() const { return setup_.report + ".fault"; }  ///< A file that makes devices fail.
  [[nodiscard]] std::string scratch() const { return setup_.report + ".scratch"; }
  [[nodiscard]] const rtbus::Heartbeat& physics_beat() const noexcept { return physics_beat_now_.value; }
  [[nodiscard]] const rtbus::ProxyState& proxy() const noexcept { return proxy_now_.value; }
  [[nodiscard]] int haptic_core() const noexcept { return static_cast<int>(info_now_.value.core); }
  FaultOutcome& outcome() noexcept { return out_; }

 private:
  void look();
  void forget_the_past();
  void take_end(const ChildEnd& ended);
  [[nodiscard]] bool start();
  [[nodiscard]] bool back() const;
  void await_what_comes();
  void take_pauses(BareLoop& witness);
  void end();
  [[nodiscard]] bool session_may_end() const noexcept {
    return setup_.row->ends == Ends::kWithSession || setup_.row->ends == Ends::kMayGoOn ||
           setup_.row->ends == Ends::kNeverStarts;
  }

  const FaultSetup& setup_;
  rtbus::Session session_;
  FaultOutcome out_;
  std::uint64_t over_ns_ = 0;
  double worst_wakeup_ms_ = 0.0;
  std::vector<Span> without_force_;
  rtbus::Stamped<rtbus::LoopStats> stats_before_;
  pid_t run_pid_ = 0;
  bool happens_ = false, ending_ = false;
  std::string tool_;
  int tools_ = 0;
  std::optional<ChildEnd> tool_end_;
  struct Topics;
  std::unique_ptr<Topics> topics_;
  rtbus::Stamped<rtbus::LoopStats> stats_now_;
  rtbus::Stamped<rtbus::Heartbeat> haptic_beat_now_, physics_beat_now_;
  rtbus::Stamped<rtbus::ProxyState> proxy_now_;
  rtbus::Stamped<rtbus::NodeInfo> info_now_;
  Supervisor supervisor_;
};

}  // namespace tools
