#pragma once
/// @file link_node.hpp
/// One machine's end of a link: local topics that the other machine needs go out, what comes from there becomes local
/// topics of the same names. Stamps are local. What echoes a hand's own stamp and number comes back unchanged.
///
/// Threads: `link_out` looks at the local topics, `link_in` takes packets, the caller of serve() greets peers, attaches
/// topics and publishes statistics. None is realtime, none is on the core of a haptic loop.
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "rtbus/config/session.hpp"
#include "rtbus/result.hpp"
#include "rtbus/segment.hpp"

namespace link_dds {

/// A haptic node with `link: dds`.
struct LinkedHand {
  std::string name;
  double round_trip_s = 0.0;
  bool wants_contacts = false;
};

struct LinkPlan {
  rtbus::Session session;
  rtbus::config::NetworkConfig network;
  std::vector<std::string> nodes;   ///< Of the session, on all machines.
  std::vector<std::string> here;    ///< Nodes on this machine.
  std::vector<LinkedHand> hands;    ///< All that have `link: dds` and whose physics is on the other side of it.
  std::vector<std::string> bodies;  ///< Names, in the scene's order; empty: orders move none of them.
  [[nodiscard]] bool is_here(const std::string& node) const;
};

class LinkNode {
 public:
  /// Creates the local topics. The error is a sentence for the user.
  [[nodiscard]] static rtbus::Result<std::unique_ptr<LinkNode>, std::string> open(LinkPlan plan);
  ~LinkNode();

  /// Begins to speak. The threads of DDS inherit the CPUs of the caller.
  [[nodiscard]] rtbus::Result<void, std::string> connect();
  /// Until `ended()`. @param tell Gets sentences for the user.
  void serve(const std::function<bool()>& ended, const std::function<void(const std::string&)>& tell);

 private:
  struct Impl;
  explicit LinkNode(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace link_dds
