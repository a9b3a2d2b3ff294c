#pragma once
/// @file session_description.hpp
/// What a recording keeps about its session besides the samples.
#include <string>
#include <vector>

#include "rtbus/recording/writer.hpp"

namespace tools {

/// How the nodes of a session are started.
struct SessionStart {
  std::string file;                      ///< Session file.
  std::vector<std::string> assignments;  ///< --set.
};

/// Of a live session: command lines of its nodes, the files they were started with (session file and what it refers
/// to) as they are now, and the names of the bodies.
[[nodiscard]] rtbus::recording::Metadata describe_session(const std::string& session);

/// Of a session whose nodes are still to be started.
[[nodiscard]] rtbus::recording::Metadata describe_session(const std::string& session, const SessionStart& start);

}  // namespace tools
