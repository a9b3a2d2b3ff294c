#include "tools/link/wire.hpp"

#include <dds/ddsrt/log.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <memory>
#include <sstream>
#include <utility>

#include <link_messages.h>

#include "rtbus/clock.hpp"

namespace link_dds {

namespace {

using tools::dds::new_qos;

/// A reader keeps so many until they are taken: what others send between does not push the peer's out.
constexpr std::int32_t kKept = 64;

/// Cyclone DDS has a line for each datagram that is none of DDS's: of a flood the first is told, then one in ten
/// seconds.
void tell_sparsely(void*, const dds_log_data_t* data) {
  static std::atomic<std::uint64_t> told_ns{0}, untold{0};
  constexpr std::uint64_t kPause_ns = 10 * rtbus::kNsPerS;
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  std::uint64_t before_ns = told_ns.load();
  if ((before_ns != 0 && now_ns < before_ns + kPause_ns) || !told_ns.compare_exchange_strong(before_ns, now_ns)) {
    ++untold;
    return;
  }
  std::string line(data->message, std::min<std::size_t>(data->size, 160));
  std::replace_if(
      line.begin(), line.end(), [](char c) { return c < 0x20 || c > 0x7e; }, ' ');
  const std::uint64_t count = untold.exchange(0);
  std::fprintf(stderr, "rtbus link: DDS: %s%s\n", line.c_str(),
               count > 0 ? (" (and " + std::to_string(count) + " more lines)").c_str() : "");
}

/// At its end each writer waits so long for readers that have not confirmed everything. One that was killed never does,
/// and supervisors wait for 2 s.
constexpr const char* kLinger = "300ms";

/// No multicast: it speaks to the named addresses alone. A packet is one datagram (kMostBody_bytes).
std::string configuration(const std::string& own, const std::vector<std::string>& others) {
  std::string out =
      "<General><Interfaces><NetworkInterface address=\"" + own +
      "\"/></Interfaces><AllowMulticast>false</AllowMulticast><FragmentSize>1400B</FragmentSize></General>"
      "<Discovery><SPDPInterval>500ms</SPDPInterval><Peers>";
  for (const std::string& other : others) out += "<Peer address=\"" + other + "\"/>";
  return out +
         "</Peers><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>16</MaxAutoParticipantIndex></"
         "Discovery><Internal><WriterLingerDuration>" +
         kLinger + "</WriterLingerDuration></Internal>";
}

std::vector<std::string> split(const char* list) {
  std::vector<std::string> out;
  std::istringstream words(list != nullptr ? list : "");
  for (std::string word; std::getline(words, word, ',');) out.push_back(word);
  return out;
}

}  // namespace

void PacketWriter::send(const Head& head, std::span<const std::uint8_t> body) noexcept {
  rtbus_link_Packet packet{};
  packet.life = head.life;
  packet.number = head.sequence;
  packet.sent_ns = head.sent_ns;
  packet.echo_ns = head.echo_ns;
  packet.held_ns = head.held_ns;
  packet.body._length = packet.body._maximum = static_cast<std::uint32_t>(body.size());
  packet.body._buffer = const_cast<std::uint8_t*>(body.data());  // dds_write only reads it
  (void)dds_write(writer_, &packet);
}

void PacketReader::drain(const std::function<void(const Head&, std::span<const std::uint8_t>)>& take) {
  constexpr std::uint32_t kAtOnce = 16;
  for (int round = 0; round * kAtOnce < kKept; ++round) {
    void* samples[kAtOnce] = {};
    dds_sample_info_t infos[kAtOnce];
    const dds_return_t count = dds_take(reader_, samples, infos, kAtOnce, kAtOnce);
    if (count <= 0) return;
    for (dds_return_t i = 0; i < count; ++i) {
      if (!infos[i].valid_data) continue;
      const auto& packet = *static_cast<const rtbus_link_Packet*>(samples[i]);
      take({packet.life, packet.number, packet.sent_ns, packet.echo_ns, packet.held_ns},
           {packet.body._buffer, packet.body._length});
    }
    (void)dds_return_loan(reader_, samples, count);
  }
}

rtbus::Result<Wire, std::string> Wire::open(int domain, const std::string& own,
                                            const std::vector<std::string>& others) {
  dds_set_log_sink(&tell_sparsely, nullptr);
  auto participant = tools::dds::Participant::open(domain, configuration(own, others));
  if (!participant) {
    return rtbus::Failure{"DDS does not begin at address " + own + ", domain " + std::to_string(domain) + ": " +
                          participant.error() +
                          "; `ip address` lists this machine's addresses, network.machines names one for each node"};
  }
  Wire wire(std::move(*participant));
  if (auto prepared = wire.prepare(); !prepared) return rtbus::Failure{prepared.error()};
  return wire;
}

rtbus::Result<void, std::string> Wire::prepare() {
  waitset_ = dds_create_waitset(participant_.entity());
  if (waitset_ < 0) return rtbus::Failure{std::string("DDS gives no waitset: ") + dds_strretcode(waitset_)};
  const std::string topic = "rtbus_link/hello";
  const auto writer = participant_.writer(topic, rtbus_link_Hello_desc, new_qos(true, true, 1));
  if (!writer) return rtbus::Failure{writer.error()};
  const auto reader = participant_.reader(topic, rtbus_link_Hello_desc, new_qos(true, true, kKept));
  if (!reader) return rtbus::Failure{reader.error()};
  hello_writer_ = *writer;
  hello_reader_ = *reader;
  return {};
}

rtbus::Result<PacketWriter, std::string> Wire::writer(const std::string& name, bool reliable) {
  const auto made = participant_.writer(name, rtbus_link_Packet_desc, new_qos(reliable, false, reliable ? 16 : 1));
  if (!made) return rtbus::Failure{made.error()};
  return PacketWriter(*made);
}

rtbus::Result<PacketReader, std::string> Wire::reader(const std::string& name, bool reliable) {
  const auto made = participant_.reader(name, rtbus_link_Packet_desc, new_qos(reliable, false, kKept));
  if (!made) return rtbus::Failure{made.error()};
  const dds_entity_t condition = dds_create_readcondition(*made, DDS_ANY_STATE);
  const dds_return_t attached = condition < 0 ? condition : dds_waitset_attach(waitset_, condition, 0);
  if (attached < 0) return rtbus::Failure{tools::dds::refused(name, attached)};
  return PacketReader(*made);
}

void Wire::greet(const PeerHello& hello) {
  std::string nodes;
  for (const std::string& node : hello.nodes) nodes += (nodes.empty() ? "" : ",") + node;
  rtbus_link_Hello message{};
  message.version = hello.version;
  message.layout = hello.layout;
  message.life = hello.life;
  message.supervisor = hello.supervisor;
  message.session = const_cast<char*>(hello.session.c_str());  // dds_write only reads them
  message.nodes = const_cast<char*>(nodes.c_str());
  message.leaving = hello.leaving;
  (void)dds_write(hello_writer_, &message);
}

void Wire::hear(const std::function<void(const PeerHello&)>& take) {
  void* samples[kKept] = {};
  dds_sample_info_t infos[kKept];
  const dds_return_t count = dds_take(hello_reader_, samples, infos, kKept, kKept);
  for (dds_return_t i = 0; i < count; ++i) {
    if (!infos[i].valid_data) continue;
    const auto& message = *static_cast<const rtbus_link_Hello*>(samples[i]);
    take({message.version, message.layout, message.life, message.supervisor,
          message.session != nullptr ? message.session : "", split(message.nodes), message.leaving});
  }
  if (count > 0) (void)dds_return_loan(hello_reader_, samples, count);
}

void Wire::wait(std::uint64_t timeout_ns) {
  (void)dds_waitset_wait(waitset_, nullptr, 0, static_cast<dds_duration_t>(timeout_ns));
}

}  // namespace link_dds
