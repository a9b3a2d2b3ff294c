#pragma once
/// @file session.hpp
/// A session file, `schema: session/1`: which nodes run on which scene, under which name. The maps of the nodes stay
/// unread here: each node reads its own, so that no program needs to know another's keys.
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/config/document.hpp"
#include "rtbus/config/scene.hpp"
#include "rtbus/segment.hpp"

namespace rtbus::config {

/// One haptic node.
struct HapticEntry {
  std::string name;  ///< "haptic0": its topics and its thread carry this name. [a-z][a-z0-9_]*, at most 15 characters.
  Map map;           ///< The rest of its keys, for haptic_node's own reader, which must end with map.finish().
};

/// What `rtbus run` does when a node crashes. The nodes themselves do not read it.
struct SuperviseConfig {
  bool restart = true;
  double first_delay_s = 0.25;   ///< Longer than any device holds a force, so that a new node begins on a free hand.
  double longest_delay_s = 5.0;  ///< Each crash in a row doubles the delay up to this.
  double good_life_s = 10.0;     ///< A node that lived so long begins with the first delay again.
  int restarts = 5;              ///< More than so many of one node within window_s: given up.
  double window_s = 60.0;
};

/// `network`: where the machines of a session are whose haptic entries have `link: dds`.
struct NetworkConfig {
  int domain = 77;  ///< Of DDS. Not 0, which ROS 2 uses.
  /// Address of the machine that a node runs on, by the node's name. Who is not named is on this machine.
  std::map<std::string, std::string> machines;

  static constexpr const char* kHere = "127.0.0.1";
  [[nodiscard]] std::string machine_of(const std::string& node) const {
    const auto found = machines.find(node);
    return found == machines.end() ? kHere : found->second;
  }
};

/// A session file, read and checked, with its scene.
struct SessionConfig {
  rtbus::Session session;  ///< Name, mode and group of its shared-memory segments.
  SuperviseConfig supervise;
  Scene scene;
  std::optional<Map> physics;       ///< For physics_node's own reader; none: no physics process.
  std::vector<HapticEntry> haptic;  ///< At least one; names are unique.
  NetworkConfig network;
  std::optional<Map> bridge;  ///< For the reader of the bridge to ROS 2; none: no bridge.
  std::string file;           ///< As given by the user.

  /// The node of that name; null when there is none.
  [[nodiscard]] HapticEntry* find_haptic(std::string_view name);
};

/// Reads a session file and its scene. Throws Error.
[[nodiscard]] SessionConfig load_session(const std::string& file, const std::vector<Override>& overrides = {});

}  // namespace rtbus::config
