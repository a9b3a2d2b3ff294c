#pragma once
/// @file packet.hpp
/// Samples of the bus as bytes of a datagram. A sample is a row of 64-bit words, most of them zero: sent are a bit for
/// each word and the words that are not zero. Lossless. Both ends have the same byte order (checked by the layout).
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <vector>

#include "rtbus/contact_messages.hpp"
#include "rtbus/messages.hpp"

namespace link_dds {

using Bytes = std::vector<std::uint8_t>;

/// Bytes of a packet's body that one Ethernet frame holds: 1500 less IP, UDP, RTPS and the head of the packet.
inline constexpr std::size_t kMostBody_bytes = 1320;

/// Appends.
void pack_words(std::span<const std::uint64_t> words, Bytes& out);
/// Takes from the front of `in`. False: too short; `words` then holds anything.
[[nodiscard]] bool unpack_words(std::span<const std::uint8_t>& in, std::span<std::uint64_t> words);

template <rtbus::Sample T>
void pack(const T& sample, Bytes& out) {
  std::array<std::uint64_t, sizeof(T) / 8> words;
  std::memcpy(words.data(), &sample, sizeof sample);
  pack_words(words, out);
}
template <rtbus::Sample T>
[[nodiscard]] bool unpack(std::span<const std::uint8_t>& in, T& sample) {
  std::array<std::uint64_t, sizeof(T) / 8> words;
  if (!unpack_words(in, words)) return false;
  std::memcpy(static_cast<void*>(&sample), words.data(), sizeof sample);
  return true;
}

/// From physics, for one hand.
struct Answer {
  rtbus::Heartbeat beat;          ///< Newest; its times in the clock of who sends.
  std::uint64_t beat_age_ns = 0;  ///< When it was sent.
  std::optional<rtbus::ProxyState> proxy;
  std::optional<rtbus::ProxyContacts> contacts;  ///< Of the same step.
};

/// What did not fit into a datagram.
struct LeftOut {
  std::uint32_t contacts = 0, supports = 0;
};

/// The answer in at most `most` bytes: of the contacts as many as fit, nearest first, each with its body and with what
/// holds that. What is left out counts as overflow in the message, too.
LeftOut pack_answer(const Answer& answer, Bytes& out, std::size_t most = kMostBody_bytes);
[[nodiscard]] std::optional<Answer> unpack_answer(std::span<const std::uint8_t> in);

/// Keeps the first `contacts` contacts and the bodies and supports that they need, of each body at most
/// `supports_per_body`. @param companions Also the bodies that are told together with these, and what holds them.
[[nodiscard]] LeftOut keep_nearest(rtbus::ProxyContacts& message, std::size_t contacts, std::size_t supports_per_body,
                                   bool companions);

/// From a hand.
[[nodiscard]] Bytes pack_hand(const rtbus::DeviceState& state, std::uint64_t device_sequence);
struct Hand {
  rtbus::DeviceState state;
  std::uint64_t device_sequence = 0;  ///< In the ring of its own machine.
};
[[nodiscard]] std::optional<Hand> unpack_hand(std::span<const std::uint8_t> in);

/// A hash of the layouts of all samples that travel, and of the byte order.
[[nodiscard]] std::uint64_t layout() noexcept;

}  // namespace link_dds
