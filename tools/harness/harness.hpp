#pragma once
/// @file harness.hpp
/// Both cores in one process under a simulated clock: the same loop, ladder, stepper and device as the nodes run,
/// without threads, sleeps or shared memory. Two runs of one session are bit-identical.
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "drivers/device.hpp"
#include "haptic_node/loop.hpp"
#include "haptic_node/node_config.hpp"
#include "haptic_node/rendering/registry.hpp"
#include "physics_node/node_config.hpp"
#include "physics_node/stepper.hpp"
#include "rtbus/config/session.hpp"
#include "rtbus/copy_rows.hpp"
#include "rtbus/histogram.hpp"
#include "tools/harness/random.hpp"
#include "tools/harness/simulated_link.hpp"

namespace tools {

/// Delays and losses of the link between the nodes, and when physics stops.
struct HarnessOptions {
  double latency_s = 0.0;  ///< From a step's publication to its arrival at the loop.
  /// Start of the first physics period after the start of the run. With `step_on: packet` the packets are sampled and
  /// answered at these instants, as by the paper's thread, which runs beside the loop and not in step with it.
  double physics_phase_s = 0.0;
  double physics_dies_s = -1.0;     ///< Neither heartbeat nor step from then on; negative: never.
  double physics_returns_s = -1.0;  ///< … until then; negative: never.
  bool passivity = true;            ///< False: energy is observed, not controlled, for comparison.
  bool energy_bound = true;         ///< False: the controller's damper alone, likewise.
  bool energy_damper = true;        ///< False: the bound of the force alone, likewise.
  bool echo_lag = true;             ///< False: over a network the set-point does not lag (echo.hpp), likewise.
  bool knows_shapes = true;     ///< False: no loop knows the shapes of the scene; planes of physics alone, likewise.
  bool measure_cost = false;    ///< Look at the real clock around each cycle and step. Changes no result.
  double jitter_s = 0.0;        ///< Each answer comes later by 0…this besides, drawn evenly; never out of order.
  double lost_share = 0.0;      ///< Of the states of the hand, and of the answers, that never arrive.
  double loop_stops_s = -1.0;   ///< The loop stands still from then on (a pause of the machine); negative: never …
  double loop_pause_s = 0.0;    ///< … for so long.
  std::uint64_t link_seed = 1;  ///< Of jitter and losses: one seed, one run.
  /// Between each haptic node and physics, besides what is said above; it carries the states of the hand as well. The
  /// far end puts its heartbeat into each answer, and the near end stamps it anew.
  NetworkOptions network = {};
  /// Puts something between the node and its engine's world; empty: nothing.
  std::function<std::unique_ptr<physics::World>(std::unique_ptr<physics::World>)> around_world = {};
};

/// CPU time that a run of the harness took, without the simulated device.
struct HarnessCost {
  rtbus::Histogram cycle_ns;  ///< Of all haptic nodes together.
  std::uint64_t steps = 0;    ///< Of physics.
  double steps_s = 0.0;       ///< CPU time of all of them.
};

class TimedDevice;

/// The haptic nodes of a session with their physics, stepped by hand. What is said of "the" node is said of the first.
class Harness {
 public:
  using Observer = std::function<void(const rtbus::Telemetry&)>;
  using StepObserver = std::function<void(const rtbus::ProxyState&)>;

  /// @param session Is consumed: its node maps are read. Throws rtbus::config::Error; std::runtime_error when the
  /// device cannot be opened (`process: own` has no place here).
  Harness(rtbus::config::SessionConfig& session, const HarnessOptions& options);

  /// Simulates `duration_s` more and shows each cycle of the first node to `observer`.
  void run(double duration_s, const Observer& observer);
  /// The same with every node: `observer(node, telemetry)`. Nodes that are due at one time go in the session's order.
  using ObserverOfAll = std::function<void(std::size_t, const rtbus::Telemetry&)>;
  void run_all(double duration_s, const ObserverOfAll& observer);

  /// From now on that node neither reads nor publishes: killed. Physics releases its proxy after 100 ms
  /// (physics::Node::kDeviceSilentNs).
  void kill(std::size_t node) { hands_.at(node)->killed = true; }

  /// From now on `observer` sees the answer of each physics step to the first node, when it is made (not when it
  /// arrives).
  void observe_steps(StepObserver observer) { step_observer_ = std::move(observer); }
  /// Likewise what it says about the contacts, if the method asks for them.
  using ContactObserver = std::function<void(const rtbus::ProxyContacts&)>;
  void observe_contacts(ContactObserver observer) { contact_observer_ = std::move(observer); }

  /// From now on each answer to the first node passes through `tamper` before it is under way: a physics that says
  /// something else than what it has computed. It sees the hand as physics does. What is not sane
  /// (rtbus/sane_sample.hpp) is refused, as by the bus. A time of publication that it lowers is an answer that arrives
  /// at once.
  struct Answer {
    const rtbus::DeviceState& device;
    rtbus::Stamped<rtbus::ProxyState>& proxy;
    rtbus::Stamped<rtbus::ProxyContacts>* contacts;  ///< Null when the method asks for none.
    bool silent = false;                             ///< Set: this answer is not published, and no heartbeat either.
  };
  using Tamper = std::function<void(Answer&)>;
  void tamper(Tamper tamper) { tamper_ = std::move(tamper); }

  [[nodiscard]] double now_s() const noexcept;  ///< Simulated time since the start.
  [[nodiscard]] const haptic::HapticConfig& config(std::size_t node = 0) const { return hands_[node]->config; }
  [[nodiscard]] rtbus::LoopStats stats() const { return hands_.front()->loop->stats(); }
  [[nodiscard]] const rtbus::DeviceState& device_state(std::size_t node = 0) const {
    return hands_.at(node)->loop->device_state();
  }
  /// To look at: a SimulatedDevice knows where the tip really is and what the hand does.
  [[nodiscard]] const drivers::Device& device(std::size_t node = 0) const { return *hands_.at(node)->device; }
  [[nodiscard]] drivers::Device& device(std::size_t node = 0) { return *hands_.at(node)->device; }
  [[nodiscard]] std::size_t hands() const noexcept { return hands_.size(); }
  /// Null when the session has no physics that a node needs.
  [[nodiscard]] const physics::Stepper* stepper() const noexcept { return stepper_.get(); }
  /// FNV-1a over every cycle's telemetry so far, of all nodes: the fingerprint of a run.
  [[nodiscard]] std::uint64_t hash() const noexcept { return hash_; }
  /// Empty unless HarnessOptions::measure_cost.
  [[nodiscard]] const HarnessCost& cost() const noexcept { return cost_; }

 private:
  /// The link of the simulated clock: newest state out, delayed answers in.
  struct Link final : haptic::PhysicsLink {
    void send(const rtbus::DeviceState& state, std::uint64_t now_ns) noexcept override {
      if (lost_share > 0.0 && random.fraction() < lost_share) return;
      if (network) {
        ++states_sent;
        if (const auto at_ns = network->out.arrival_ns(now_ns)) network->states.send({states_sent, state}, *at_ns);
        return;
      }
      if (device.sequence > 0) unheard.push_back(device.value);
      device.value = state;
      ++device.sequence;
    }
    /// The newest state that has come to physics.
    void take_state(std::uint64_t now_ns) {
      if (!network) return;
      if (auto arrived = network->states.take(now_ns)) {
        device.value = arrived->packet.second;
        device.sequence = arrived->packet.first;
      }
    }
    /// What has come from physics.
    void take_answers(std::uint64_t now_ns);
    void hear(const rtbus::Heartbeat& heard, std::uint64_t now_ns);
    bool receive(rtbus::Stamped<rtbus::ProxyState>& out) noexcept override {
      return std::exchange(proxy_fresh, false) && (out = proxy, true);
    }
    bool receive(rtbus::Stamped<rtbus::ProxyContacts>& out) noexcept override {
      if (!std::exchange(contacts_fresh, false)) return false;
      rtbus::copy_rows(contacts.value, out.value);  // as over the bus
      out.sequence = contacts.sequence;
      out.stamp_ns = contacts.stamp_ns;
      return true;
    }
    bool receive(std::size_t other, rtbus::Stamped<rtbus::DeviceState>& out) noexcept override {
      const rtbus::Stamped<rtbus::DeviceState>& newest = other_hands[other]->device;
      return newest.sequence > out.sequence && (out = newest, true);
    }
    bool receive(rtbus::Stamped<rtbus::Heartbeat>& out) noexcept override {
      return std::exchange(beat_fresh, false) && (out = beat, true);
    }
    [[nodiscard]] std::uint64_t refused() const noexcept override { return refused_answers; }
    std::vector<const Link*> other_hands;  ///< As in HapticConfig::other_hands.
    rtbus::Stamped<rtbus::DeviceState> device;
    std::vector<rtbus::DeviceState> unheard;  ///< Before that one, and after the one that physics took last.
    rtbus::Stamped<rtbus::ProxyState> proxy;
    rtbus::Stamped<rtbus::ProxyContacts> contacts;
    rtbus::Stamped<rtbus::Heartbeat> beat;
    bool proxy_fresh = false;
    bool contacts_fresh = false;
    bool beat_fresh = false;
    std::uint64_t refused_answers = 0;
    double lost_share = 0.0;
    Random random;
    /// One datagram: a proxy with its contacts, and a heartbeat.
    struct Datagram {
      rtbus::Heartbeat beat;
      rtbus::Stamped<rtbus::ProxyState> proxy;
      std::optional<rtbus::Stamped<rtbus::ProxyContacts>> contacts;
    };
    struct Network {
      OneWay out, back;
      DelayLine<std::pair<std::uint64_t, rtbus::DeviceState>> states{};
      DelayLine<Datagram> answers{};
      DelayLine<rtbus::Heartbeat> beats{};
    };
    std::optional<Network> network;
    std::uint64_t states_sent = 0;
  };

  /// One haptic node: device, loop, and its end of the link.
  struct Hand {
    Hand(haptic::HapticConfig settings, const rtbus::config::SessionConfig& session, std::uint64_t start_ns,
         bool timed);
    haptic::HapticConfig config;
    std::unique_ptr<drivers::Device> device;
    TimedDevice* timed = nullptr;  ///< The device, when its time is to be left out of the cost.
    Link link;
    std::unique_ptr<haptic::Loop> loop;
    std::deque<rtbus::Stamped<rtbus::ProxyState>> under_way;              ///< stamp_ns: when it arrives.
    std::deque<rtbus::Stamped<rtbus::ProxyContacts>> contacts_under_way;  ///< Likewise.
    std::uint64_t next_tick_ns = 0;
    std::uint64_t heard_ns = 0;  ///< When it last spoke.
    std::uint64_t proxies_sent = 0;
    bool killed = false;
    bool silent = false;  ///< Physics has noticed.
  };

  void cycle(Hand& hand);
  void advance_physics(std::uint64_t now_ns);
  void step_physics(std::uint64_t begin_ns);
  /// Puts the answer to a hand under way.
  void publish(Hand& hand, const rtbus::Stamped<rtbus::ProxyState>& answer,
               const rtbus::Stamped<rtbus::ProxyContacts>* contacts);
  [[nodiscard]] rtbus::Heartbeat beat() const noexcept;
  [[nodiscard]] bool physics_silent(std::uint64_t now_ns) const noexcept;
  [[nodiscard]] bool loop_stands(std::uint64_t now_ns) const noexcept;

  HarnessOptions options_;
  std::optional<physics::PhysicsConfig> physics_;
  std::unique_ptr<physics::Stepper> stepper_;
  std::vector<std::unique_ptr<Hand>> hands_;
  StepObserver step_observer_;
  ContactObserver contact_observer_;
  Tamper tamper_;
  bool silenced_ = false;  ///< By the last call of tamper_.
  std::uint64_t now_ns_;
  std::uint64_t next_step_ns_ = 0;
  std::uint64_t next_beat_ns_ = 0;
  std::uint64_t hash_ = 0xcbf29ce484222325ULL;
  HarnessCost cost_;
};

}  // namespace tools
