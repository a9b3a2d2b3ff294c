#include "tools/link/packet.hpp"

#include <algorithm>
#include <array>
#include <cstddef>

#include "rtbus/order_messages.hpp"

namespace link_dds {

namespace {

constexpr std::uint8_t kHasProxy = 1, kHasContacts = 2;

void put_number(std::uint64_t value, Bytes& out) {
  const std::size_t at = out.size();
  out.resize(at + sizeof value);
  std::memcpy(out.data() + at, &value, sizeof value);
}

bool take_number(std::span<const std::uint8_t>& in, std::uint64_t& value) {
  if (in.size() < sizeof value) return false;
  std::memcpy(&value, in.data(), sizeof value);
  in = in.subspan(sizeof value);
  return true;
}

/// Zeroes the rows of a table from `from` on.
void clear_rows(rtbus::ProxyContacts& message, const rtbus::Table& table, std::size_t from) {
  auto* const bytes = reinterpret_cast<std::byte*>(&message);
  for (const rtbus::detail::Column& column : rtbus::detail::columns_of<rtbus::ProxyContacts>()) {
    if (column.offset < table.begin_offset || column.offset >= table.end_offset) continue;
    std::memset(bytes + column.offset + from * column.row_bytes, 0, (column.rows - from) * column.row_bytes);
  }
}

/// Copies a row of a table onto another row of it.
void move_row(rtbus::ProxyContacts& message, const rtbus::Table& table, std::size_t from, std::size_t to) {
  if (from == to) return;
  auto* const bytes = reinterpret_cast<std::byte*>(&message);
  for (const rtbus::detail::Column& column : rtbus::detail::columns_of<rtbus::ProxyContacts>()) {
    if (column.offset < table.begin_offset || column.offset >= table.end_offset) continue;
    std::memcpy(bytes + column.offset + to * column.row_bytes, bytes + column.offset + from * column.row_bytes,
                column.row_bytes);
  }
}

/// The table that begins with the column at `offset`.
constexpr rtbus::Table table_at(std::size_t offset) {
  for (const rtbus::Table& table : rtbus::SampleTraits<rtbus::ProxyContacts>::kTables) {
    if (table.begin_offset == offset) return table;
  }
  throw "no table begins there";
}
constexpr rtbus::Table kContactTable = table_at(offsetof(rtbus::ProxyContacts, contact_body));
constexpr rtbus::Table kBodyTable = table_at(offsetof(rtbus::ProxyContacts, body_index));
constexpr rtbus::Table kSupportTable = table_at(offsetof(rtbus::ProxyContacts, support_body));

}  // namespace

void pack_words(std::span<const std::uint64_t> words, Bytes& out) {
  const std::size_t bits = out.size();
  out.resize(bits + (words.size() + 7) / 8);
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (words[i] == 0) continue;
    out[bits + i / 8] = static_cast<std::uint8_t>(out[bits + i / 8] | (1u << (i % 8)));
    put_number(words[i], out);
  }
}

bool unpack_words(std::span<const std::uint8_t>& in, std::span<std::uint64_t> words) {
  const std::size_t bitmap_bytes = (words.size() + 7) / 8;
  if (in.size() < bitmap_bytes) return false;
  const std::span<const std::uint8_t> bits = in.first(bitmap_bytes);
  in = in.subspan(bitmap_bytes);
  for (std::size_t i = 0; i < words.size(); ++i) {
    words[i] = 0;
    if (((bits[i / 8] >> (i % 8)) & 1u) != 0 && !take_number(in, words[i])) return false;
  }
  return true;
}

LeftOut keep_nearest(rtbus::ProxyContacts& message, std::size_t contacts, std::size_t supports_per_body,
                     bool companions) {
  LeftOut left;
  const std::size_t had = std::min<std::size_t>(message.contacts, rtbus::kContactSlots);
  const std::size_t had_bodies = std::min<std::size_t>(message.bodies, rtbus::kContactSlots);
  const std::size_t had_supports = std::min<std::size_t>(message.supports, rtbus::kSupportSlots);
  const std::size_t kept = std::min(contacts, had);
  left.contacts = static_cast<std::uint32_t>(had - kept);

  // Bodies keep their order; `row` says where each went.
  constexpr std::size_t kGone = rtbus::kContactSlots;
  std::array<std::size_t, rtbus::kContactSlots> row;
  std::array<bool, rtbus::kContactSlots> needed{};
  for (std::size_t i = 0; i < kept; ++i) {
    if (message.contact_body[i] < had_bodies) needed[message.contact_body[i]] = true;
  }
  const auto holder_of = [&](std::size_t i) { return std::size_t{message.support_holder[i]} - 1; };
  const auto is_pair = [&](std::size_t i) {
    return message.support_body[i] < had_bodies && message.support_holder[i] > 0 && holder_of(i) < had_bodies;
  };
  for (std::size_t reached = 0; companions && reached < had_bodies; ++reached) {
    for (std::size_t i = 0; i < had_supports; ++i) {
      if (!is_pair(i)) continue;
      bool &held = needed[message.support_body[i]], &holder = needed[holder_of(i)];
      held = holder = held || holder;
    }
  }
  row.fill(kGone);
  std::size_t bodies = 0;
  for (std::size_t i = 0; i < had_bodies; ++i) {
    if (!needed[i]) continue;
    move_row(message, kBodyTable, i, bodies);
    row[i] = bodies++;
  }
  for (std::size_t i = 0; i < kept; ++i) {
    if (message.contact_body[i] < had_bodies)
      message.contact_body[i] = static_cast<std::uint32_t>(row[message.contact_body[i]]);
  }

  std::array<std::size_t, rtbus::kContactSlots> held{};
  std::size_t supports = 0;
  for (std::size_t i = 0; i < had_supports; ++i) {
    const std::size_t body = message.support_body[i];
    if (body >= had_bodies || row[body] == kGone) continue;  // of a body that is not told
    if (held[row[body]]++ >= supports_per_body) {
      ++left.supports;
      continue;
    }
    const bool together = is_pair(i) && row[holder_of(i)] != kGone;
    const std::size_t holder = together ? row[holder_of(i)] + 1 : 0;
    move_row(message, kSupportTable, i, supports);
    message.support_holder[supports] = static_cast<std::uint32_t>(holder);
    message.support_body[supports++] = static_cast<std::uint32_t>(row[body]);
  }

  message.contacts = static_cast<std::uint32_t>(kept);
  message.bodies = static_cast<std::uint32_t>(bodies);
  message.supports = static_cast<std::uint32_t>(supports);
  message.contacts_overflow += left.contacts;
  message.supports_overflow += left.supports;
  clear_rows(message, kContactTable, kept);
  clear_rows(message, kBodyTable, bodies);
  clear_rows(message, kSupportTable, supports);
  return left;
}

LeftOut pack_answer(const Answer& answer, Bytes& out, std::size_t most) {
  out.clear();
  out.push_back(static_cast<std::uint8_t>((answer.proxy ? kHasProxy : 0) | (answer.contacts ? kHasContacts : 0)));
  put_number(answer.beat_age_ns, out);
  pack(answer.beat, out);
  if (answer.proxy) pack(*answer.proxy, out);
  if (!answer.contacts) return {};
  const std::size_t head = out.size();
  // A body stands on four supports as well as on thirty: they go first, then the contacts that are far away. What is
  // told together stays together, or it would be a pile; if not even one contact fits so, it is told as one.
  constexpr std::size_t kEnoughSupports = 4;
  const std::size_t all = std::min<std::size_t>(answer.contacts->contacts, rtbus::kContactSlots);
  LeftOut left;
  for (const bool companions : {true, false}) {
    const std::size_t fewest = companions ? 1 : 0;
    for (std::size_t contacts = all + 1; contacts-- > fewest;) {
      for (std::size_t supports = rtbus::kSupportSlots; supports >= kEnoughSupports; supports /= 2) {
        rtbus::ProxyContacts part = *answer.contacts;
        left = keep_nearest(part, contacts, supports, companions);
        out.resize(head);
        pack(part, out);
        if (out.size() <= most) return left;
      }
    }
  }
  out.resize(head);  // not even an empty one
  out.front() = static_cast<std::uint8_t>(out.front() & ~kHasContacts);
  return left;
}

std::optional<Answer> unpack_answer(std::span<const std::uint8_t> in) {
  Answer out;
  if (in.empty()) return std::nullopt;
  const std::uint8_t parts = in.front();
  in = in.subspan(1);
  if ((parts & ~(kHasProxy | kHasContacts)) != 0 || !take_number(in, out.beat_age_ns) || !unpack(in, out.beat)) {
    return std::nullopt;
  }
  if ((parts & kHasProxy) != 0 && !unpack(in, out.proxy.emplace())) return std::nullopt;
  if ((parts & kHasContacts) != 0 && !unpack(in, out.contacts.emplace())) return std::nullopt;
  return in.empty() ? std::optional(out) : std::nullopt;
}

Bytes pack_hand(const rtbus::DeviceState& state, std::uint64_t device_sequence) {
  Bytes out;
  put_number(device_sequence, out);
  pack(state, out);
  return out;
}

std::optional<Hand> unpack_hand(std::span<const std::uint8_t> in) {
  Hand out;
  if (!take_number(in, out.device_sequence) || !unpack(in, out.state) || !in.empty()) return std::nullopt;
  return out;
}

std::uint64_t layout() noexcept {
  constexpr std::uint64_t kHashes[] = {rtbus::type_hash<rtbus::DeviceState>(),   rtbus::type_hash<rtbus::ProxyState>(),
                                       rtbus::type_hash<rtbus::ProxyContacts>(), rtbus::type_hash<rtbus::Heartbeat>(),
                                       rtbus::type_hash<rtbus::NodeInfo>(),      rtbus::type_hash<rtbus::StepStats>(),
                                       rtbus::type_hash<rtbus::LoopStats>(),     rtbus::type_hash<rtbus::Orders>(),
                                       rtbus::type_hash<rtbus::BodyOrders>()};
  std::uint64_t hash = std::endian::native == std::endian::little ? 0xcbf29ce484222325ULL : 0x84222325cbf29ce4ULL;
  for (const std::uint64_t each : kHashes) hash = rtbus::detail::fnv1a(each, hash);
  return hash;
}

}  // namespace link_dds
