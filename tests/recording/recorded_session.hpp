#pragma once
/// @file recorded_session.hpp
/// A live session with `rtbus record` beside it, as processes of this build.
#include <gmock/gmock.h>

#include <cstring>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/recording/reader.hpp"
#include "tests/support/nodes.hpp"
#include "tests/support/temporary_file.hpp"

namespace tests {

class RecordedSession : public Nodes {
 protected:
  void TearDown() override {
    recorder_.reset();
    Nodes::TearDown();
  }

  [[nodiscard]] std::string file(const std::string& name = "r.h5") const { return folder_.path() / name; }
  [[nodiscard]] std::string said() const { return text_of("record.txt"); }
  [[nodiscard]] std::string text_of(const std::string& name) const {
    std::ifstream in(file(name));
    return {std::istreambuf_iterator<char>(in), {}};
  }

  /// Runs a command of the tool to its end. @returns its exit status; what it said is in `output`.
  int tool(std::vector<std::string> words, const std::string& output = "tool.txt") const {
    words.insert(words.begin(), binary("rtbus"));
    Child child(words, file(output));
    const int status = child.wait();
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  /// Returns once the recorder takes in samples.
  void start_recorder(const std::string& path, std::vector<std::string> more = {}) {
    std::vector<std::string> words{binary("rtbus"), "record", path, "-s", bus_.name};
    words.insert(words.end(), more.begin(), more.end());
    recorder_.emplace(words, file("record.txt"));
    ASSERT_TRUE(eventually(20.0, [&] { return tool({"mark", "begin", "-s", bus_.name}) == 0; })) << said();
  }
  /// @returns its exit status.
  int end_recorder() {
    const int status = recorder_->end(SIGINT);
    recorder_.reset();
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  /// Waits until `count` more samples of the telemetry have come, and gives them.
  std::vector<Stamped<Telemetry>> ticks(Reader<Telemetry>& reader, std::size_t count) {
    std::vector<Stamped<Telemetry>> out;
    (void)follow(reader, 30.0, [&](const Stamped<Telemetry>& tick) {
      out.push_back(tick);
      return out.size() >= count;
    });
    return out;
  }

  TemporaryFolder folder_;
  std::optional<Child> recorder_;
};

/// All samples of a recorded topic.
template <class T>
std::vector<T> values(const rtbus::recording::Recording& recording, const std::string& topic) {
  const auto* const found = recording.find(topic);
  if (found == nullptr) return {};
  const auto bytes = recording.samples(*found);
  std::vector<T> out(bytes.size() / sizeof(T));
  if (!out.empty()) std::memcpy(static_cast<void*>(out.data()), bytes.data(), out.size() * sizeof(T));
  return out;
}

}  // namespace tests
