#include "tools/link/peers.hpp"

#include <algorithm>
#include <cstdio>
#include <cstdlib>

namespace link_dds {

namespace {

std::string hex(std::uint64_t value) {
  char text[20];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(value));
  return text;
}

/// What a stranger calls himself, without what a terminal should not be sent.
std::string plain(const std::string& text) {
  std::string out = text.substr(0, 64);
  std::replace_if(
      out.begin(), out.end(), [](char c) { return c < 0x20 || c > 0x7e; }, '?');
  return out;
}

}  // namespace

std::optional<std::string> Peers::misfit(const PeerHello& hello) const {
  if (hello.version != self_.version) {
    return "it speaks version " + std::to_string(hello.version) + " of the link, this end version " +
           std::to_string(self_.version) + "; install the same release of rtbus on both machines";
  }
  if (hello.session != self_.session) {
    return "it belongs to session '" + plain(hello.session) + "', this is '" + self_.session +
           "'; give each session its own network.domain";
  }
  if (hello.layout != self_.layout) {
    return "its messages have another layout (" + hex(hello.layout) + ", here " + hex(self_.layout) +
           "); install the same release of rtbus on both machines";
  }
  for (const std::string& node : hello.nodes) {
    if (std::find(nodes_.begin(), nodes_.end(), node) == nodes_.end()) {
      return "it claims " + plain(node) + ", which this session has not; use the same session file on both machines";
    }
    if (std::find(self_.nodes.begin(), self_.nodes.end(), node) != self_.nodes.end()) {
      return "it claims " + plain(node) + ", which runs here; name other nodes with --only on one of the machines";
    }
  }
  return std::nullopt;
}

void Peers::refuse(std::uint64_t life, const std::string& why, std::vector<std::string>& told) {
  if (strangers_.contains(life)) return;
  ++refused_peers_;
  if (strangers_.size() >= kMostStrangers) return;
  strangers_.insert(life);
  told.push_back("a peer (" + hex(life) + ") is refused: " + why);
}

std::vector<std::string> Peers::hear(const PeerHello& hello, std::uint64_t now_ns) {
  std::vector<std::string> told;
  if (hello.life == 0 || hello.life == self_.life) return told;
  if (const auto why = misfit(hello)) {
    refuse(hello.life, *why, told);
    return told;
  }
  for (const std::string& node : hello.nodes) {
    Holder& holder = holders_[node];
    if (hello.leaving) {
      if (holder.life == hello.life) {
        holder = {};
        told.push_back(plain(node) + " has left");
      }
      continue;
    }
    if (holder.life == hello.life) {
      holder.heard_ns = now_ns;
      continue;
    }
    const bool free = holder.life == 0 || now_ns > holder.heard_ns + silence_ns_;
    const bool successor = holder.life != 0 && holder.supervisor == hello.supervisor;
    if (!free && !successor) {
      refuse(hello.life,
             "it claims " + plain(node) + ", for which another peer (" + hex(holder.life) +
                 ") speaks already; end one of them",
             told);
      continue;
    }
    holder = {hello.life, hello.supervisor, now_ns};
    strangers_.erase(hello.life);
    told.push_back(plain(node) + " is there (" + hex(hello.life) + ")");
  }
  return told;
}

bool Peers::accepts(const std::string& node, std::uint64_t life, std::uint64_t now_ns) {
  const auto found = holders_.find(node);
  if (life == 0 || found == holders_.end() || found->second.life != life) {
    ++refused_packets_;
    return false;
  }
  found->second.heard_ns = now_ns;
  return true;
}

std::uint64_t Peers::life_of(const std::string& node) const {
  const auto found = holders_.find(node);
  return found == holders_.end() ? 0 : found->second.life;
}

bool NewestWins::takes(std::uint64_t life, std::uint64_t sequence) noexcept {
  if (life != life_) {
    life_ = life;
    newest_ = sequence == 0 ? 0 : sequence - 1;
  }
  if (sequence <= newest_) {
    ++late_;
    if (lost_ > 0) --lost_;  // it had been counted when it was passed over
    return false;
  }
  lost_ += sequence - newest_ - 1;
  newest_ = sequence;
  ++received_;
  return true;
}

void ClockOffset::add(std::uint64_t sent_ns, std::uint64_t came_ns, std::uint64_t left_ns,
                      std::uint64_t now_ns) noexcept {
  if (sent_ns == 0 || now_ns < sent_ns || left_ns < came_ns || left_ns - came_ns > now_ns - sent_ns) return;
  Slot fresh;
  fresh.number = now_ns / kSlot_ns + 1;
  fresh.at_ns = now_ns;
  fresh.delay_ns = (now_ns - sent_ns) - (left_ns - came_ns);
  // ((came − sent) + (left − now)) / 2; differences of unsigned numbers wrap around to the right signed ones.
  fresh.offset_ns = static_cast<std::int64_t>(came_ns - sent_ns) / 2 + static_cast<std::int64_t>(left_ns - now_ns) / 2;
  Slot& slot = slots_[fresh.number % kSlots];
  if (slot.number != fresh.number || fresh.delay_ns < slot.delay_ns) slot = fresh;
}

std::optional<ClockOffset::Estimate> ClockOffset::estimate(std::uint64_t now_ns) const noexcept {
  const Slot* best = nullptr;
  for (const Slot& slot : slots_) {
    if (slot.number == 0 || slot.number + kSlots <= now_ns / kSlot_ns + 1) continue;
    if (best == nullptr || slot.delay_ns < best->delay_ns) best = &slot;
  }
  if (best == nullptr) return std::nullopt;
  const double age_s = static_cast<double>(now_ns - best->at_ns) * 1e-9;
  const double delay_s = static_cast<double>(best->delay_ns) * 1e-9;
  return Estimate{static_cast<double>(best->offset_ns) * 1e-9, 0.5 * delay_s + kDrift * age_s, delay_s};
}

std::uint64_t TimeShift::here(std::uint64_t theirs_ns, std::uint64_t now_ns) noexcept {
  const auto shift_ns = static_cast<std::int64_t>(now_ns - theirs_ns);  // wraps around to the right signed number
  std::uint64_t late_ns = 0;                                            // more than the fastest packet was
  if (known_ && shift_ns > shift_ns_) {
    late_ns = static_cast<std::uint64_t>(shift_ns) - static_cast<std::uint64_t>(shift_ns_);
    // Clocks drift: the fastest packet counts less from second to second.
    const double drift_ns = now_ns > at_ns_ ? ClockOffset::kDrift * static_cast<double>(now_ns - at_ns_) : 0.0;
    late_ns -= std::min(late_ns, static_cast<std::uint64_t>(drift_ns));
  }
  known_ = true;
  shift_ns_ = static_cast<std::int64_t>(static_cast<std::uint64_t>(shift_ns) - late_ns);
  at_ns_ = now_ns;
  return now_ns - std::min(now_ns, late_ns);
}

void Echoes::remember(std::uint64_t here_ns, const Echo& echo) noexcept {
  rows_[next_] = {here_ns, echo};
  next_ = (next_ + 1) % rows_.size();
}

std::optional<Echoes::Echo> Echoes::find(std::uint64_t here_ns) const noexcept {
  for (std::size_t i = 0; i < rows_.size(); ++i) {  // newest first: that is where answers are
    const Row& row = rows_[(next_ + rows_.size() - 1 - i) % rows_.size()];
    if (row.here_ns == 0) return std::nullopt;
    if (row.here_ns == here_ns) return row.echo;
  }
  return std::nullopt;
}

}  // namespace link_dds
