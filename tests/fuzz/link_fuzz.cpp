// What the other machine of a link may send: packets, and what is said of who sends them. Records of a kind, of a
// length, and of so many bytes.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <span>
#include <string>

#include "rtbus/order_messages.hpp"
#include "rtbus/sane_sample.hpp"
#include "tools/link/packet.hpp"
#include "tools/link/peers.hpp"

namespace {

using Input = std::span<const std::uint8_t>;

constexpr std::uint64_t kNow_ns = 1'000'000'000'000;

void require(bool condition) {
  if (!condition) std::abort();
}

Input take(Input& in, std::size_t bytes) {
  const Input out = in.first(std::min(bytes, in.size()));
  in = in.subspan(out.size());
  return out;
}

/// 0 where the input has ended.
std::uint64_t take_number(Input& in) {
  std::uint64_t out = 0;
  const Input bytes = take(in, sizeof out);
  std::memcpy(&out, bytes.data(), bytes.size());
  return out;
}

template <class T>
bool is_sane(const T& sample) {
  return rtbus::SampleTraits<T>::sane(sample, kNow_ns);
}

/// Bytes that are a sample come out of it again, as far as they say something.
template <class T>
void unpack_and_pack(Input body) {
  T sample, again;
  if (!link_dds::unpack(body, sample)) return;
  (void)is_sane(sample);
  link_dds::Bytes bytes;
  link_dds::pack(sample, bytes);
  Input rest = bytes;
  require(link_dds::unpack(rest, again) && rest.empty());
  require(std::memcmp(&sample, &again, sizeof sample) == 0);
}

void answer(Input body) {
  const auto taken = link_dds::unpack_answer(body);
  if (!taken) return;
  // A link sends on only what its own physics has said, which is sane.
  if (taken->contacts && !is_sane(*taken->contacts)) return;
  link_dds::Bytes bytes;
  (void)link_dds::pack_answer(*taken, bytes);
  const auto again = link_dds::unpack_answer(bytes);
  require(again.has_value() && again->proxy.has_value() == taken->proxy.has_value());
  require(!again->contacts || (is_sane(*again->contacts) && bytes.size() <= link_dds::kMostBody_bytes));
}

void nearest(Input body) {
  const Input counts = take(body, 2);
  const auto taken = link_dds::unpack_answer(body);
  if (counts.size() < 2 || !taken || !taken->contacts || !is_sane(*taken->contacts)) return;
  rtbus::ProxyContacts part = *taken->contacts;
  (void)link_dds::keep_nearest(part, counts[0], counts[1], counts[0] % 2 == 0);
  require(is_sane(part) && part.contacts <= counts[0]);
}

void hand(Input body) {
  const auto taken = link_dds::unpack_hand(body);
  if (!taken) return;
  (void)is_sane(taken->state);
  const auto again = link_dds::unpack_hand(link_dds::pack_hand(taken->state, taken->device_sequence));
  require(again && again->device_sequence == taken->device_sequence);
}

void clocks(Input body) {
  link_dds::TimeShift shift;
  link_dds::ClockOffset offset;
  link_dds::Echoes echoes;
  link_dds::NewestWins newest;
  std::uint64_t now_ns = kNow_ns;
  while (!body.empty()) {
    now_ns += take_number(body) % 10'000'000'000;
    const std::uint64_t theirs_ns = take_number(body);
    const std::uint64_t here_ns = shift.here(theirs_ns, now_ns);
    require(here_ns <= now_ns);
    offset.add(take_number(body), theirs_ns, take_number(body), now_ns);
    if (const auto estimate = offset.estimate(now_ns)) {
      require(std::isfinite(estimate->offset_s) && estimate->error_s >= 0.0 && estimate->round_trip_s >= 0.0);
    }
    echoes.remember(here_ns, {theirs_ns, theirs_ns});
    require(echoes.find(here_ns).has_value() == (here_ns != 0));
    (void)newest.takes(take_number(body) % 3, theirs_ns);
  }
}

void strangers(Input body) {
  link_dds::PeerHello self;
  self.layout = link_dds::layout();
  self.life = 1;
  self.session = "fuzz";
  self.nodes = {"haptic0"};
  link_dds::Peers peers(self, {"physics", "haptic0"}, 1'000'000'000);
  std::uint64_t now_ns = kNow_ns;
  while (!body.empty()) {
    now_ns += take_number(body) % 10'000'000'000;
    link_dds::PeerHello hello = self;
    hello.life = take_number(body) % 8;
    const Input flags = take(body, 2);
    const std::uint8_t flag = flags.empty() ? 0 : flags[0];
    if ((flag & 1) != 0) hello.version = flag;
    if ((flag & 2) != 0) hello.layout = take_number(body);
    if ((flag & 4) != 0) hello.leaving = true;
    const Input text = take(body, flags.size() < 2 ? 0 : flags[1]);
    const std::string name(text.begin(), text.end());
    hello.nodes = {(flag & 8) != 0 ? name : "physics"};
    if ((flag & 16) != 0) hello.session = name;
    (void)peers.hear(hello, now_ns);
    // The machine of the hand keeps its own node, whoever claims it.
    require(!peers.accepts("haptic0", hello.life, now_ns));
    if (peers.accepts("physics", hello.life, now_ns)) require(peers.life_of("physics") == hello.life);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input in(data, size);
  while (!in.empty()) {
    const std::uint8_t kind = take(in, 1).front();
    const Input length = take(in, 2);
    const Input body = take(in, length.size() < 2 ? 0 : length[0] + 256U * length[1]);
    switch (kind % 10) {
      case 0:
        answer(body);
        break;
      case 1:
        nearest(body);
        break;
      case 2:
        hand(body);
        break;
      case 3:
        unpack_and_pack<rtbus::StepStats>(body);
        break;
      case 4:
        unpack_and_pack<rtbus::NodeInfo>(body);
        break;
      case 5:
        unpack_and_pack<rtbus::Orders>(body);
        break;
      case 6:
        unpack_and_pack<rtbus::BodyOrders>(body);
        break;
      case 7:
        unpack_and_pack<rtbus::LoopStats>(body);
        break;
      case 8:
        clocks(body);
        break;
      case 9:
        strangers(body);
        break;
    }
  }
  return 0;
}
