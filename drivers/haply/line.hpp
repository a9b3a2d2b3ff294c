#pragma once
/// @file line.hpp
/// A Haply Inverse3 and its VerseGrip, through Haply's own Inverse Service on this machine: one answer per message, all
/// of them exchanged by the I/O thread. The service ignores what it does not know without a word, so the driver looks
/// whether the force that it asked for is rendered.
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "drivers/haply/service_messages.hpp"
#include "drivers/haply/web_socket.hpp"
#include "drivers/io/line.hpp"
#include "drivers/vendor/claim.hpp"

namespace drivers::haply {

struct Settings {
  std::string address = "127.0.0.1";
  int port = 10001;                 ///< Of its WebSocket, and of GET /version.
  int events_port = 10020;          ///< Of its event channel; 0: not read.
  std::string device;               ///< Its id; empty: the only one.
  std::string grip;                 ///< Id of the VerseGrip; empty: the only one, if there is one.
  std::string field = "auto";       ///< auto, vector, values.
  std::string claim;                ///< Besides the service's device: what sessions claim who mean the same; or empty.
  std::string owner;                ///< Whom other sessions are told.
  Vec3 origin_m{0.0, -0.12, 0.15};  ///< Of D in the service's frame [m].
  struct Ports {
    int port = 0, events_port = 0;
  };
  /// A stand-in's service: called before connecting; gives its ports. Empty: a real one.
  std::function<Ports()> prepare;
};

class HaplyLine final : public io::Line {
 public:
  explicit HaplyLine(Settings settings) : settings_(std::move(settings)) {}
  ~HaplyLine() override { HaplyLine::disconnect(false); }

  [[nodiscard]] rtbus::Result<void, DeviceFault> connect(io::StopFlag& stop) override;
  [[nodiscard]] io::SendStatus send(const Vec3& force_n, double dt_s, bool live,
                                    std::uint64_t deadline_ns) noexcept override;
  [[nodiscard]] bool withheld() const noexcept override { return withheld_; }
  [[nodiscard]] io::ExchangeStatus receive(DeviceSample& out, std::uint64_t deadline_ns) noexcept override;
  void disconnect(bool reachable) noexcept override;

  [[nodiscard]] io::Readiness readiness() const noexcept override { return readiness_; }
  [[nodiscard]] std::string remedy() const override { return remedy_; }
  [[nodiscard]] std::string fault() const override { return fault_; }
  [[nodiscard]] std::string take_news() override { return std::exchange(news_, {}); }
  [[nodiscard]] const io::LinkCounters& counters() const noexcept override { return counters_; }

 private:
  [[nodiscard]] rtbus::Result<void, DeviceFault> choose(const Inventory& inventory);
  [[nodiscard]] rtbus::Result<void, DeviceFault> greet(const std::string& where, const io::StopFlag& stop);
  [[nodiscard]] rtbus::Result<void, DeviceFault> claim(const std::string& where);
  void check_echo(const ServiceState& state);
  void check_excess(const ServiceState& state);
  void show_events();
  [[nodiscard]] bool look_at(const ServiceState& state);

  Settings settings_;
  WebSocket socket_;
  std::vector<vendor::Claim> claims_;
  std::string device_, grip_, grip_kind_;
  ForceField field_ = ForceField::kVector;
  bool both_tried_ = false;
  bool field_confirmed_ = false;
  int unheard_ = 0;  ///< Answers in a row that show no force although one was sent.
  int excess_ = 0;   ///< Answers in a row that show more force than was sent.
  Vec3 sent_n_{}, sent_before_n_{};
  bool behind_ = false;  ///< An answer was not waited for: it may still come, and would be taken for the next one.
  bool first_ = true;
  bool withheld_ = false;
  bool withhold_next_ = false;
  io::Readiness readiness_ = io::Readiness::kReady;
  std::string message_;
  std::string remedy_, fault_, news_;
  Quat grip_wxyz_{1, 0, 0, 0};
  io::LinkCounters counters_;
};

}  // namespace drivers::haply
