#pragma once
/// @file follow_session.hpp
/// A session run as real processes for some seconds, every tick of its first haptic node and every step of physics for
/// it shown to the caller as they come.
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/messages.hpp"
#include "rtbus/topic.hpp"
#include "tools/cli/host/bare_loop.hpp"
#include "tools/cli/run/run_plan.hpp"
#include "tools/cli/run/supervisor.hpp"
#include "tools/evaluation/shared/machine_load.hpp"

namespace tools {

struct FollowSetup {
  std::string session_file;
  std::vector<std::string> assignments;
  std::string name;         ///< The session is called so, with this process and a count behind it.
  double duration_s = 6.0;  ///< From the first tick seen.
  bool bare_loop = false;   ///< Beside the haptic loop, to compare with.
};

/// One run. One thread, which must live as long as the object does (Supervisor).
class FollowedSession {
 public:
  /// Reads the session as its nodes will. Throws rtbus::config::Error.
  explicit FollowedSession(const FollowSetup& setup);

  [[nodiscard]] const RunPlan& plan() const noexcept { return plan_; }

  using OnTick = std::function<void(const rtbus::Telemetry&)>;
  using OnStep = std::function<void(const rtbus::Stamped<rtbus::ProxyState>&)>;

  /// Starts the nodes, follows them, ends them. @returns false, with the reason on stderr, when that could not be done
  /// or somebody interrupted.
  [[nodiscard]] bool run(const OnTick& on_tick, const OnStep& on_step = {});

  /// What the loop said of itself last; after run().
  [[nodiscard]] const rtbus::LoopStats& loop() const noexcept { return loop_.value; }
  /// None unless asked for.
  [[nodiscard]] const std::optional<BareLoopFigures>& bare() const noexcept { return bare_figures_; }
  /// What the machine gave meanwhile; after run().
  [[nodiscard]] const MachineLoad& load() const noexcept { return load_; }

 private:
  template <class T>
  using Readers = std::optional<rtbus::Reader<T>>;

  [[nodiscard]] bool start();
  [[nodiscard]] bool alive();
  [[nodiscard]] bool follow(const OnTick& on_tick, const OnStep& on_step);
  void start_bare_loop(std::uint64_t due_ns);
  void judge_load(const LoadMeter& meter);

  FollowSetup setup_;
  RunPlan plan_;
  Readers<rtbus::Telemetry> tick_reader_;
  Readers<rtbus::ProxyState> proxy_reader_;
  Readers<rtbus::LoopStats> loop_reader_;
  Readers<rtbus::NodeInfo> info_reader_;
  rtbus::Stamped<rtbus::LoopStats> loop_;
  std::unique_ptr<BareLoop> bare_;
  std::optional<BareLoopFigures> bare_figures_;
  MachineLoad load_;
  Supervisor supervisor_{[](const std::string&, std::string_view) {}};
};

}  // namespace tools
