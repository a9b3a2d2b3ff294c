#include "rtbus/config/link.hpp"

namespace rtbus::config {

LinkConfig read_link_config(Map& entry) {
  LinkConfig out;
  out.paper = entry.choice("form", {"improved", "paper"}, "improved") == "paper";
  out.pipe = entry.choice("link", {"bus", "pipe"}, "bus") == "pipe";
  if (out.paper) out.rate_hz = kPaperLinkRate_hz;
  // The lower bound keeps a packet younger than the silence after which physics gives a hand up (100 ms).
  if (entry.has("link_rate_hz")) out.rate_hz = entry.number("link_rate_hz", {15.0, 10000.0});
  if (out.pipe && !out.rate_hz) {
    entry.fail("link", "needs link_rate_hz: a pipe is fed by a thread of its own, so many times a second; add it");
  }
  return out;
}

}  // namespace rtbus::config
