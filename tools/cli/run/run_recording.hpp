#pragma once
/// @file run_recording.hpp
/// The recorder of a session: a child of `rtbus run`, wanted from the first tick (--record) or by an order.
#include <string>
#include <vector>

#include "rtbus/result.hpp"
#include "tools/cli/run/run_plan.hpp"
#include "tools/cli/run/supervisor.hpp"

namespace tools {

/// One thread, that of the supervisor.
class RunRecording {
 public:
  static constexpr const char* kName = "recorder";

  /// Both outlive it. @param file Session file. @param assignments As given with --set.
  RunRecording(Supervisor& supervisor, const RunPlan& plan, std::string file, std::vector<std::string> assignments);

  /// @param path File to make. @param with "bodies", "contacts". The error is a sentence for the user.
  [[nodiscard]] rtbus::Result<void, std::string> start(const std::string& path, const std::vector<std::string>& with);
  /// Ends it in order; the file is whole some milliseconds later. @returns false when none runs.
  bool stop();

  /// The recorder's process has ended. @returns what went wrong, or "".
  [[nodiscard]] std::string on_end(const ChildEnd& end);

  /// The file that is being written; "": none.
  [[nodiscard]] const std::string& path() const noexcept { return path_; }
  /// Last line of the recorder that has ended last: figures, or what went wrong; "": none has.
  [[nodiscard]] const std::string& said() const noexcept { return said_; }
  /// All files of this run, in order.
  [[nodiscard]] const std::vector<std::string>& files() const noexcept { return files_; }

  /// A name that does not exist yet: SESSION-2026-11-22T18-55-00.h5, in the folder where `rtbus run` was started.
  [[nodiscard]] std::string free_name() const;

 private:
  Supervisor& supervisor_;
  const RunPlan& plan_;
  std::string file_;
  std::vector<std::string> assignments_;
  std::string path_, said_;
  std::vector<std::string> files_;
  bool stopping_ = false;
};

}  // namespace tools
