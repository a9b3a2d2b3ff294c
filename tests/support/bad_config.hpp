#pragma once
/// @file bad_config.hpp
/// A table of wrong configuration files: each names, in its first line, what the error (in warned/: the warning) has to
/// say. A reader is tested by running it over its folder of tests/data/bad_configs; adding a case is adding a file.
///
///     # expect: physics\.rate_hz = 0 is below 1; choose 1…20000 Hz
///     # set: physics.rate_hz=0          (optional, any number: overrides as of --set)
///     schema: session/1
///     …
///
/// The expectation is a POSIX extended regular expression, searched in the message.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

#include "rtbus/config/document.hpp"

namespace tests {

struct BadConfig {
  std::string file;
  std::string expect;
  std::vector<rtbus::config::Override> overrides;

  /// For the name of the test: "unknown_key".
  [[nodiscard]] std::string name() const { return std::filesystem::path(file).stem().string(); }
};

inline void PrintTo(const BadConfig& bad, std::ostream* out) { *out << bad.file; }

/// All cases of tests/data/bad_configs/<folder>, by name. A file without expectation gets one that nothing matches.
inline std::vector<BadConfig> bad_configs(const std::string& folder) {
  const auto root = std::filesystem::path(RTBUS_SOURCE_DIR) / "tests/data/bad_configs" / folder;
  std::vector<BadConfig> out;
  for (const auto& entry : std::filesystem::directory_iterator(root)) {
    if (entry.path().extension() != ".yaml") {
      continue;  // what a bad file refers to lies in folders of its own
    }
    constexpr std::string_view kExpect = "# expect: ";
    constexpr std::string_view kSet = "# set: ";
    BadConfig bad{entry.path().string(), "this file lacks its first line '# expect: …'", {}};
    std::ifstream stream(entry.path());
    for (std::string line; std::getline(stream, line) && line.starts_with("#");) {
      if (line.starts_with(kExpect)) {
        bad.expect = line.substr(kExpect.size());
      } else if (line.starts_with(kSet)) {
        bad.overrides.push_back(rtbus::config::parse_override(line.substr(kSet.size())));
      }
    }
    out.push_back(std::move(bad));
  }
  std::sort(out.begin(), out.end(), [](const BadConfig& a, const BadConfig& b) { return a.file < b.file; });
  return out;
}

/// Reads a file as its program would; throws rtbus::config::Error.
using Loader = std::function<void(const std::string& file, const std::vector<rtbus::config::Override>& overrides)>;

/// Success when the loader throws an Error whose text matches and is one line that names a file or --set.
inline testing::AssertionResult fails_as_expected(const BadConfig& bad, const Loader& loader) {
  try {
    loader(bad.file, bad.overrides);
  } catch (const rtbus::config::Error& error) {
    const std::string message = error.what();
    if (!testing::Matches(testing::ContainsRegex(bad.expect))(message)) {
      return testing::AssertionFailure() << "expected /" << bad.expect << "/\n     got  " << message;
    }
    if (message.find('\n') != std::string::npos || (!message.starts_with("/") && !message.starts_with("--set "))) {
      return testing::AssertionFailure() << "not one sentence that begins with the place: " << message;
    }
    return testing::AssertionSuccess();
  }
  return testing::AssertionFailure() << "was accepted, expected /" << bad.expect << "/";
}

/// For INSTANTIATE_TEST_SUITE_P.
inline std::string bad_config_name(const testing::TestParamInfo<BadConfig>& info) { return info.param.name(); }

}  // namespace tests
