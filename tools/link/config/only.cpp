#include "tools/link/config/only.hpp"

#include <algorithm>

#include "rtbus/config/shared_keys.hpp"

namespace link_dds {

namespace {

bool holds(const std::vector<std::string>& list, const std::string& word) {
  return std::find(list.begin(), list.end(), word) != list.end();
}

}  // namespace

bool Split::is_here(const std::string& node) const { return holds(here, node); }
bool Split::crosses(const std::string& haptic) const { return holds(crossed, haptic); }

Split split_session(rtbus::config::SessionConfig& session, const std::vector<std::string>& only) {
  std::vector<std::string> all;
  if (session.physics) all.emplace_back("physics");
  for (const rtbus::config::HapticEntry& entry : session.haptic) all.push_back(entry.name);

  Split out;
  if (only.empty()) {
    out.here = all;
    return out;
  }
  for (const std::string& name : only) {
    if (holds(all, name)) {
      if (!holds(out.here, name)) out.here.push_back(name);
      continue;
    }
    std::string names;
    for (const std::string& each : all) names += (names.empty() ? "" : ", ") + each;
    throw rtbus::config::Error(session.file + ": --only " + name + " names no node of the session; it has " + names);
  }
  const bool physics_here = out.is_here("physics");
  for (rtbus::config::HapticEntry& entry : session.haptic) {
    const bool here = out.is_here(entry.name);
    if (!session.physics || here == physics_here) continue;  // both here, or both elsewhere
    if (!rtbus::config::read_link_config(entry.map).dds) {
      entry.map.fail("link", "does not lead to another machine, and --only divides " + entry.name +
                                 " from physics; write link: dds");
    }
    out.crossed.push_back(entry.name);
  }
  for (const std::string& node : out.here) {
    if (session.network.machine_of(node) == session.network.machine_of(out.here.front())) continue;
    throw rtbus::config::Error(session.file + ": network.machines gives " + node + " and " + out.here.front() +
                               " different addresses, and --only has both on this machine; name one of them");
  }
  return out;
}

}  // namespace link_dds
