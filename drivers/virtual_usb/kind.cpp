#include "drivers/virtual_usb/kind.hpp"

namespace drivers::virtual_usb {

Faults parse_faults(rtbus::config::Map& settings, FaultTimes& times) {
  Faults out;
  auto map = settings.optional_map("faults");
  if (!map) return out;
  const rtbus::config::Range share{0.0, 1.0};
  out.lose_reply = map->number("lose_reply", share, out.lose_reply);
  out.late_reply = map->number("late_reply", share, out.late_reply);
  out.late_ms = map->number("late_ms", {0.0, 1e4}, out.late_ms);
  out.flip_echo_bit = map->number("flip_echo_bit", share, out.flip_echo_bit);
  out.flip_reply_bit = map->number("flip_reply_bit", share, out.flip_reply_bit);
  out.fail_handshake = map->number("fail_handshake", share, out.fail_handshake);
  out.split_reply = map->number("split_reply", share, out.split_reply);
  out.merge_reply = map->number("merge_reply", share, out.merge_reply);
  out.stall_in = map->number("stall_in", share, out.stall_in);
  out.status_flood = map->boolean("status_flood", out.status_flood);
  out.overrun = map->boolean("overrun", out.overrun);
  out.mute = map->boolean("mute", out.mute);
  out.pause_at_s = map->number("pause_at_s", {-1.0, 1e6}, out.pause_at_s);
  out.pause_ms = map->number("pause_ms", {0.0, 1e5}, out.pause_ms);
  out.unplug_at_s = map->number("unplug_at_s", {-1.0, 1e6}, out.unplug_at_s);
  out.replug_after_s = map->number("replug_after_s", {-1.0, 1e6}, out.replug_after_s);
  times.trigger = map->text("trigger", times.trigger);
  times.for_s = map->number("for_s", {-1.0, 1e5}, times.for_s);
  map->finish();
  return out;
}

}  // namespace drivers::virtual_usb
