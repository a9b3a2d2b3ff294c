#pragma once
/// @file supervisor.hpp
/// The child processes of `rtbus run`: started with the parent-death signal, watched, and ended in a fixed order.
///
/// A child gets SIGTERM from the kernel when the supervisor dies, however that happens, and a process group of its own,
/// so that Ctrl-C in the terminal reaches only the supervisor, which then ends the children one stage after the other.
/// Whether one that ended by itself is started again is the caller's business (restart_policy.hpp).
#include <sys/types.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "rtbus/result.hpp"

namespace tools {

/// Children are ended in this order: the force goes to zero first, and the plant feels it; recorder and bridge see it
/// all.
enum class Stage : std::uint8_t { kHaptic, kPhysics, kPlant, kObserver };

struct ChildSpec {
  std::string name;  ///< For people: "haptic0", "physics", "haptic0 plant".
  Stage stage = Stage::kHaptic;
  std::string program;                 ///< Path of the binary.
  std::vector<std::string> arguments;  ///< Without the program's name.
  std::string preload = {};            ///< Library that comes first in its LD_PRELOAD; empty: none.
  /// It waits while nobody reads what it writes, instead of losing it: a stranger's program may not expect EAGAIN.
  bool waits_for_reader = false;
  /// Variables that it gets besides ours.
  std::vector<std::pair<std::string, std::string>> environment = {};
};

/// How a child ended.
struct ChildEnd {
  std::string name;
  pid_t pid = 0;
  int wait_status = 0;                  ///< As waitpid() gives it.
  std::uint64_t started_ns = 0;         ///< CLOCK_MONOTONIC.
  double cpu_s = 0.0;                   ///< User plus system time over its life.
  bool killed = false;                  ///< It did not end in time and got SIGKILL from us.
  bool stuck = false;                   ///< Not even that ended it in time: it hangs inside the kernel.
  std::vector<std::string> last_words;  ///< The last lines it wrote.

  /// "ended with status 1", "was killed by signal 9 (Killed)".
  [[nodiscard]] std::string how() const;
};

/// What was running, for questions to the kernel.
struct ChildView {
  std::string name;
  pid_t pid = 0;
};

/// One thread: the one that starts a child must live as long as the child, since the parent-death signal is tied to
/// that thread.
class Supervisor {
 public:
  /// How long a child may take from SIGTERM to its end, and from SIGKILL to its burial. Only a child that hangs inside
  /// the kernel outlasts both; it is named and left behind.
  static constexpr double kPatience_s = 2.0;
  static constexpr double kKillPatience_s = 1.0;

  /// @param on_line Called for each line that a child writes to stdout or stderr, from within the calls below.
  using OnLine = std::function<void(const std::string& child, std::string_view line)>;
  explicit Supervisor(OnLine on_line) : on_line_(std::move(on_line)) {}
  ~Supervisor() { end_all(); }
  Supervisor(const Supervisor&) = delete;
  Supervisor& operator=(const Supervisor&) = delete;

  /// Starts a child. The error is one sentence.
  [[nodiscard]] rtbus::Result<void, std::string> start(const ChildSpec& spec);

  /// Passes on what the children wrote and looks whether one has ended by itself. Call it every 20 ms or so.
  /// @returns the first that ended; the others go on. start() it again, or end_all().
  [[nodiscard]] std::optional<ChildEnd> poll();

  /// Asks one child to end, by SIGTERM. poll() returns it when it has. @returns false when none runs of that name.
  bool ask_to_end(const std::string& name);

  /// Ends all that still run: SIGTERM stage by stage, SIGKILL after kPatience_s. Takes at most four stages of
  /// kPatience_s + kKillPatience_s. @returns those that did not end well: killed, or with a status other than zero.
  std::vector<ChildEnd> end_all();

  [[nodiscard]] std::vector<ChildView> running() const;

 private:
  struct Child {
    std::string name;
    Stage stage;
    pid_t pid;
    std::uint64_t started_ns;
    int output_fd;
    std::string partial_line;
    std::vector<std::string> last_words;
  };
  void pump(Child& child);
  void take_line(Child& child, std::string line);
  [[nodiscard]] std::optional<ChildEnd> reap(Child& child);

  OnLine on_line_;
  std::vector<Child> children_;
};

}  // namespace tools
