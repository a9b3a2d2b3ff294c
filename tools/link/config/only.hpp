#pragma once
/// @file only.hpp
/// `--only`: which nodes of a session run on this machine, and which links lead to another one. Knows no DDS.
#include <string>
#include <vector>

#include "rtbus/config/session.hpp"

namespace link_dds {

/// How a session is divided between machines, seen from this one.
struct Split {
  std::vector<std::string> here;     ///< Nodes of this machine; all without --only.
  std::vector<std::string> crossed;  ///< Haptic nodes whose link leads from this machine to another one or comes here.

  [[nodiscard]] bool is_here(const std::string& node) const;
  [[nodiscard]] bool crosses(const std::string& haptic) const;
};

/// Throws rtbus::config::Error: a name that no node has, or a link that cannot lead to another machine.
/// @param only As given; empty: all nodes are here.
[[nodiscard]] Split split_session(rtbus::config::SessionConfig& session, const std::vector<std::string>& only);

}  // namespace link_dds
