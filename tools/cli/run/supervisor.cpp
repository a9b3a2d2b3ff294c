#include "tools/cli/run/supervisor.hpp"

#include <fcntl.h>
#include <signal.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <list>
#include <optional>
#include <utility>

#include "rtbus/clock.hpp"
#include "rtbus/parent_death.hpp"

namespace tools {

namespace {

constexpr std::size_t kLastWords = 12;      // lines kept per child
constexpr std::size_t kLongestLine = 4096;  // longer ones are cut in pieces
/// Of the pipe of an engine, which waits while it is full: a hand waits with it. The largest that any user may have.
constexpr int kEnginePipe_bytes = 1 << 20;
constexpr std::uint64_t kPollPeriod_ns = 5 * rtbus::kNsPerMs;

/// A variable of the environment for the children forked while it lives.
class Variable {
 public:
  Variable(std::string name, const std::string& value) : name_(std::move(name)) {
    if (const char* const before = std::getenv(name_.c_str())) before_ = before;
    ::setenv(name_.c_str(), value.c_str(), 1);
  }
  ~Variable() {
    if (before_) ::setenv(name_.c_str(), before_->c_str(), 1);
    if (!before_) ::unsetenv(name_.c_str());
  }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;

 private:
  std::string name_;
  std::optional<std::string> before_;
};

/// LD_PRELOAD with this library in front.
std::string preloaded(const std::string& library) {
  const char* const others = std::getenv("LD_PRELOAD");
  return others == nullptr ? library : library + ":" + others;
}

/// Runs in the child between fork and exec: async-signal-safe calls only.
[[noreturn]] void become(const char* program, char* const* arguments, int output_fd, pid_t parent) {
  ::setpgid(0, 0);
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (::getppid() != parent) ::_exit(127);  // the parent died before the signal was set
  sigset_t none;
  sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  ::signal(SIGINT, SIG_DFL);
  ::signal(SIGTERM, SIG_DFL);
  ::signal(SIGHUP, SIG_DFL);
  ::signal(SIGPIPE, SIG_IGN);  // a node that loses its supervisor must end by its own ladder, not by a failed log line
  const int nothing_fd = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
  if (nothing_fd >= 0) ::dup2(nothing_fd, STDIN_FILENO);
  ::dup2(output_fd, STDOUT_FILENO);
  ::dup2(output_fd, STDERR_FILENO);
  ::execv(program, arguments);
  const char message[] = "cannot be executed\n";
  (void)!::write(STDERR_FILENO, message, sizeof message - 1);
  ::_exit(127);
}

}  // namespace

std::string ChildEnd::how() const {
  if (stuck) return "has not ended, not even by SIGKILL: it hangs inside the kernel";
  if (WIFSIGNALED(wait_status)) {
    const int number = WTERMSIG(wait_status);
    return "was killed by signal " + std::to_string(number) + " (" + ::strsignal(number) + ")" +
           (killed ? ", for it did not end within 2 s of SIGTERM" : "");
  }
  return "ended with status " + std::to_string(WEXITSTATUS(wait_status));
}

rtbus::Result<void, std::string> Supervisor::start(const ChildSpec& spec) {
  const auto failed = [&](const char* what) {
    return rtbus::Failure{spec.name + ": " + what + ": " + ::strerror(errno)};
  };
  if (::access(spec.program.c_str(), X_OK) != 0) return failed(spec.program.c_str());
  int ends[2];
  // Neither end blocks: a child whose supervisor is held up (Ctrl-Z, a debugger) loses log lines, not time.
  if (::pipe2(ends, O_CLOEXEC | O_NONBLOCK) != 0) return failed("pipe");
  if (spec.waits_for_reader) {
    ::fcntl(ends[1], F_SETFL, 0);
    (void)::fcntl(ends[1], F_SETPIPE_SZ, kEnginePipe_bytes);  // a system that grants less lets it wait sooner
  }
  std::vector<char*> arguments{const_cast<char*>(spec.program.c_str())};
  for (const std::string& each : spec.arguments) arguments.push_back(const_cast<char*>(each.c_str()));
  arguments.push_back(nullptr);

  const pid_t parent = ::getpid();
  ::setenv(rtbus::kSupervisorVariable, std::to_string(parent).c_str(), 1);
  std::list<Variable> variables;
  if (!spec.preload.empty()) variables.emplace_back("LD_PRELOAD", preloaded(spec.preload));
  for (const auto& [name, value] : spec.environment) variables.emplace_back(name, value);
  const pid_t pid = ::fork();
  if (pid == 0) become(spec.program.c_str(), arguments.data(), ends[1], parent);
  ::close(ends[1]);
  if (pid < 0) {
    const auto failure = failed("fork");
    ::close(ends[0]);
    return failure;
  }
  ::setpgid(pid, pid);  // here too: whoever comes first, a Ctrl-C from now on does not reach the child
  children_.push_back({spec.name, spec.stage, pid, rtbus::monotonic_ns(), ends[0], {}, {}});
  return {};
}

void Supervisor::take_line(Child& child, std::string line) {
  if (line.empty()) return;
  if (on_line_) on_line_(child.name, line);
  if (child.last_words.size() == kLastWords) child.last_words.erase(child.last_words.begin());
  child.last_words.push_back(std::move(line));
}

void Supervisor::pump(Child& child) {
  char buffer[65536];
  for (ssize_t got = 0; (got = ::read(child.output_fd, buffer, sizeof buffer)) > 0;) {
    child.partial_line.append(buffer, static_cast<std::size_t>(got));
    std::size_t taken = 0;
    for (std::size_t end = 0; (end = child.partial_line.find('\n', taken)) != std::string::npos; taken = end + 1) {
      for (; end - taken > kLongestLine; taken += kLongestLine) {
        take_line(child, child.partial_line.substr(taken, kLongestLine));
      }
      take_line(child, child.partial_line.substr(taken, end - taken));
    }
    for (; child.partial_line.size() - taken > kLongestLine; taken += kLongestLine) {
      take_line(child, child.partial_line.substr(taken, kLongestLine));
    }
    child.partial_line.erase(0, taken);
  }
}

std::optional<ChildEnd> Supervisor::reap(Child& child) {
  pump(child);
  int status = 0;
  rusage used{};
  const pid_t ended = ::wait4(child.pid, &status, WNOHANG, &used);
  if (ended != child.pid && !(ended < 0 && errno == ECHILD)) return std::nullopt;
  pump(child);  // what it wrote between the first look and its end
  take_line(child, std::exchange(child.partial_line, {}));
  ::close(child.output_fd);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_usec) * 1e-6;
  };
  ChildEnd end;
  end.name = child.name;
  end.pid = child.pid;
  end.wait_status = status;
  end.started_ns = child.started_ns;
  end.cpu_s = seconds(used.ru_utime) + seconds(used.ru_stime);
  end.last_words = std::move(child.last_words);
  return end;
}

std::optional<ChildEnd> Supervisor::poll() {
  for (auto child = children_.begin(); child != children_.end(); ++child) {
    if (auto end = reap(*child)) {
      children_.erase(child);
      return end;
    }
  }
  return std::nullopt;
}

bool Supervisor::ask_to_end(const std::string& name) {
  for (const Child& child : children_) {
    if (child.name == name) return ::kill(child.pid, SIGTERM) == 0;
  }
  return false;
}

std::vector<ChildEnd> Supervisor::end_all() {
  std::vector<ChildEnd> bad;
  for (const Stage stage : {Stage::kHaptic, Stage::kPhysics, Stage::kPlant, Stage::kObserver}) {
    for (const Child& child : children_) {
      if (child.stage != stage) continue;
      ::kill(child.pid, SIGTERM);
      ::kill(child.pid, SIGCONT);  // one that was stopped sees the SIGTERM only when it goes on
    }
    const std::uint64_t patience_end_ns = rtbus::monotonic_ns() + static_cast<std::uint64_t>(kPatience_s * 1e9);
    const std::uint64_t give_up_ns = patience_end_ns + static_cast<std::uint64_t>(kKillPatience_s * 1e9);
    bool killing = false;
    const auto in_stage = [stage](const Child& child) { return child.stage == stage; };
    while (std::any_of(children_.begin(), children_.end(), in_stage)) {
      if (!killing && rtbus::monotonic_ns() > patience_end_ns) {
        killing = true;
        for (const Child& child : children_) {
          if (in_stage(child)) ::kill(child.pid, SIGKILL);
        }
      }
      for (auto child = children_.begin(); child != children_.end();) {
        auto end = reap(*child);
        if (!end && in_stage(*child) && rtbus::monotonic_ns() > give_up_ns) {
          ::close(child->output_fd);
          end.emplace();
          end->name = child->name;
          end->pid = child->pid;
          end->wait_status = SIGKILL;
          end->stuck = true;
        }
        if (!end) {
          ++child;
          continue;
        }
        child = children_.erase(child);
        end->killed = killing && WIFSIGNALED(end->wait_status) && WTERMSIG(end->wait_status) == SIGKILL;
        if (end->wait_status != 0) bad.push_back(std::move(*end));
      }
      if (std::any_of(children_.begin(), children_.end(), in_stage)) {
        rtbus::sleep_until(rtbus::monotonic_ns() + kPollPeriod_ns);
      }
    }
  }
  return bad;
}

std::vector<ChildView> Supervisor::running() const {
  std::vector<ChildView> views;
  for (const Child& child : children_) views.push_back({child.name, child.pid});
  return views;
}

}  // namespace tools
