#include "tools/cli/run/run_recording.hpp"

#include <unistd.h>

#include <algorithm>
#include <utility>

#include "tools/cli/common/find_config.hpp"
#include "tools/cli/common/utc_now.hpp"

namespace tools {

RunRecording::RunRecording(Supervisor& supervisor, const RunPlan& plan, std::string file,
                           std::vector<std::string> assignments)
    : supervisor_(supervisor), plan_(plan), file_(std::move(file)), assignments_(std::move(assignments)) {}

rtbus::Result<void, std::string> RunRecording::start(const std::string& path, const std::vector<std::string>& with) {
  if (!RTBUS_WITH_HDF5) {
    return rtbus::Failure{std::string("this build cannot record; build it with HDF5 (libhdf5-dev)")};
  }
  if (!path_.empty()) return rtbus::Failure{"the session is being recorded into " + path_ + " already"};
  if (::access(path.c_str(), F_OK) == 0) {
    return rtbus::Failure{path + " exists already; choose another name, or remove it first"};
  }
  ChildSpec spec{kName, Stage::kObserver, folder_of_this_program() + "/rtbus", {}};
  spec.arguments = {"record", path, "--session", plan_.session.name, "--wait", "--config", file_};
  for (const std::string& text : assignments_) spec.arguments.insert(spec.arguments.end(), {"--set", text});
  for (const std::string& each : with) spec.arguments.insert(spec.arguments.end(), {"--with", each});
  if (auto started = supervisor_.start(spec); !started) return started;
  path_ = path;
  files_.push_back(path);
  stopping_ = false;
  return {};
}

bool RunRecording::stop() {
  stopping_ = true;
  return !path_.empty() && supervisor_.ask_to_end(kName);
}

std::string RunRecording::on_end(const ChildEnd& end) {
  const std::string path = std::exchange(path_, {});
  said_ = end.last_words.empty() ? "" : end.last_words.back();
  if (end.wait_status == 0 && stopping_) return "";
  return "the recorder of " + path + " " + end.how() + (said_.empty() ? "" : ": " + said_);
}

std::string RunRecording::free_name() const {
  std::string when = utc_now();
  std::erase(when, 'Z');
  std::replace(when.begin(), when.end(), ':', '-');
  const std::string stem = plan_.session.name + "-" + when;
  std::string name = stem + ".h5";
  for (int i = 2; ::access(name.c_str(), F_OK) == 0; ++i) name = stem + "_" + std::to_string(i) + ".h5";
  return name;
}

}  // namespace tools
