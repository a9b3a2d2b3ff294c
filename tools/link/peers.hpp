#pragma once
/// @file peers.hpp
/// Who is at the other end, and whether what comes is taken. Knows no DDS and no clock of its own.
#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace link_dds {

/// Of the messages on the wire.
inline constexpr std::uint32_t kVersion = 1;

/// As in link_messages.idl.
struct PeerHello {
  std::uint32_t version = kVersion;
  std::uint64_t layout = 0;
  std::uint64_t life = 0;
  std::uint64_t supervisor = 0;
  std::string session;
  std::vector<std::string> nodes;
  bool leaving = false;
};

/// Decides which process speaks for each node of the other machines: the first that fits and claims it, until it leaves
/// or has been silent for long. One thread.
class Peers {
 public:
  /// @param nodes Of the session, wherever they run. @param silence_ns A peer that was not heard for so long may be
  /// replaced by another.
  Peers(PeerHello self, std::vector<std::string> nodes, std::uint64_t silence_ns)
      : self_(std::move(self)), nodes_(std::move(nodes)), silence_ns_(silence_ns) {}

  /// What was decided, for the user; empty: nothing that he has not been told.
  [[nodiscard]] std::vector<std::string> hear(const PeerHello& hello, std::uint64_t now_ns);

  /// A packet for `node` from `life`: true when it counts. Refused ones are counted.
  [[nodiscard]] bool accepts(const std::string& node, std::uint64_t life, std::uint64_t now_ns);

  /// The life that speaks for `node`; 0: nobody yet.
  [[nodiscard]] std::uint64_t life_of(const std::string& node) const;
  [[nodiscard]] std::uint64_t refused_packets() const noexcept { return refused_packets_; }
  [[nodiscard]] std::uint64_t refused_peers() const noexcept { return refused_peers_; }

 private:
  struct Holder {
    std::uint64_t life = 0, supervisor = 0, heard_ns = 0;
  };
  [[nodiscard]] std::optional<std::string> misfit(const PeerHello& hello) const;
  void refuse(std::uint64_t life, const std::string& why, std::vector<std::string>& told);

  /// Strangers are remembered so that each is told of once; a flood of them is not remembered without end.
  static constexpr std::size_t kMostStrangers = 64;
  PeerHello self_;
  std::vector<std::string> nodes_;
  std::uint64_t silence_ns_;
  std::map<std::string, Holder> holders_;  ///< By the node's name.
  std::set<std::uint64_t> strangers_;      ///< Lives that were refused.
  std::uint64_t refused_packets_ = 0, refused_peers_ = 0;
};

/// Newest wins: of one stream of one life, what is older or the same is dropped. One thread.
class NewestWins {
 public:
  [[nodiscard]] bool takes(std::uint64_t life, std::uint64_t sequence) noexcept;
  [[nodiscard]] std::uint64_t received() const noexcept { return received_; }
  [[nodiscard]] std::uint64_t late() const noexcept { return late_; }  ///< Older or the same.
  [[nodiscard]] std::uint64_t lost() const noexcept { return lost_; }  ///< Numbers that were passed over, less late.

 private:
  std::uint64_t life_ = 0, newest_ = 0, received_ = 0, late_ = 0, lost_ = 0;
};

/// The other machine's clock less ours, from round trips: NTP's formula (RFC 5905, section 8) on the exchange of least
/// delay in each of the last kSlots slots of time, and of these the one of least delay. One thread.
class ClockOffset {
 public:
  static constexpr std::size_t kSlots = 8;
  static constexpr std::uint64_t kSlot_ns = 62'500'000;
  /// By so much per second two quartz clocks part.
  static constexpr double kDrift = 1e-4;

  /// @param sent_ns Our packet left, by our clock. @param came_ns It came, by the other's. @param left_ns The answer
  /// left, by the other's. @param now_ns It is here, by ours. Times in another order are ignored.
  void add(std::uint64_t sent_ns, std::uint64_t came_ns, std::uint64_t left_ns, std::uint64_t now_ns) noexcept;
  /// Another machine, or it was started anew.
  void begin_anew() noexcept { slots_ = {}; }

  struct Estimate {
    double offset_s = 0.0;      ///< The other's clock less ours.
    double error_s = 0.0;       ///< It is off by no more: half the delay, and what the clocks drift meanwhile.
    double round_trip_s = 0.0;  ///< Least delay of the slots, without the time at the other end.
  };
  [[nodiscard]] std::optional<Estimate> estimate(std::uint64_t now_ns) const noexcept;

 private:
  struct Slot {
    std::uint64_t number = 0;  ///< now_ns / kSlot_ns; 0: empty.
    std::uint64_t at_ns = 0;
    std::uint64_t delay_ns = 0;
    std::int64_t offset_ns = 0;
  };
  std::array<Slot, kSlots> slots_{};
};

/// Times of another machine in our clock. A packet is taken to have come without delay where it was the fastest so far,
/// so all times are at most now and their differences are kept. One thread.
class TimeShift {
 public:
  /// @param theirs_ns When something happened, by their clock. @returns by ours, never later than now_ns; 0: before our
  /// clock began, which no honest time is.
  [[nodiscard]] std::uint64_t here(std::uint64_t theirs_ns, std::uint64_t now_ns) noexcept;
  void begin_anew() noexcept { known_ = false; }

 private:
  bool known_ = false;
  std::int64_t shift_ns_ = 0;
  std::uint64_t at_ns_ = 0;
};

/// What the hand's own machine called the samples that physics answers. One thread.
class Echoes {
 public:
  struct Echo {
    std::uint64_t device_time_ns = 0, device_sequence = 0;
  };
  void remember(std::uint64_t here_ns, const Echo& echo) noexcept;
  [[nodiscard]] std::optional<Echo> find(std::uint64_t here_ns) const noexcept;

 private:
  static constexpr std::size_t kRemembered = 16384;  ///< 16 s at 1 kHz: no answer that counts is older.
  struct Row {
    std::uint64_t here_ns = 0;
    Echo echo;
  };
  std::vector<Row> rows_ = std::vector<Row>(kRemembered);
  std::size_t next_ = 0;
};

}  // namespace link_dds
