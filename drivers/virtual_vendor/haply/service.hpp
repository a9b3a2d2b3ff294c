#pragma once
/// @file service.hpp
/// A stand-in for Haply's Inverse Service: a WebSocket server on 127.0.0.1, in a thread of its own, with one Inverse3
/// and one VerseGrip without hardware. It keeps the service's rules: a list of devices first, then one answer per
/// message and none without; unknown keys are ignored; a force acts for one message, and ends when messages stop;
/// forces of several clients add up. GET /version tells its version; a second port sends events and reads nothing.
#include <memory>
#include <string>

#include <Eigen/Core>

#include "drivers/virtual_vendor/stand_in.hpp"

namespace drivers::virtual_vendor::haply {

struct Settings {
  UnitSettings unit;                   ///< Its serial is the device's id.
  std::string grip = "6121";           ///< Empty: none.
  std::string understands = "vector";  ///< vector, values, or neither.
  bool format_3_0 = false;             ///< The older format: devices in a map.
  std::string version = "3.5.0";       ///< Empty: GET /version is refused.
  bool calibrated = true;
  double uncalibrate_at_s = -1.0;
  double idle_after_s = 0.1;  ///< Messages stop for so long: no force.
  double force_scale = 1.0;
  double slow_reply_us = 0.0;                                ///< An answer comes so late.
  double mute_at_s = -1.0;                                   ///< No answers from then on …
  double mute_for_s = -1.0;                                  ///< … for so long; < 0: for good.
  double close_at_s = -1.0;                                  ///< It closes the connection once.
  int close_code = 0;                                        ///< … with this code; 0: without one.
  bool fragments = false;                                    ///< Answers come in two fragments.
  bool ping_within = false;                                  ///< With a ping between them.
  int answer_bytes = 0;                                      ///< Answers are made so long, by a key that nobody knows.
  bool binary = false;                                       ///< Answers come as binary frames.
  double stall_at_s = -1.0;                                  ///< It sends the event device-safety-triggered.
  Eigen::Vector3d other_client_n = Eigen::Vector3d::Zero();  ///< What another program commands, frame D [N].
  double grip_rad = 0.0;                                     ///< Turn of the grip about the vertical.
};

/// Reads `virtual:` of a device file. finish() is the caller's. Throws rtbus::config::Error.
[[nodiscard]] Settings read(rtbus::config::Map& map, const DeviceInfo& info);

class Service {
 public:
  explicit Service(Settings settings);
  ~Service();
  Service(const Service&) = delete;
  Service& operator=(const Service&) = delete;

  /// −1: it could not listen.
  [[nodiscard]] int port() const noexcept;
  [[nodiscard]] int events_port() const noexcept;
  /// Pings that were answered.
  [[nodiscard]] int pongs() const noexcept;

  struct State;

 private:
  std::unique_ptr<State> state_;
};

}  // namespace drivers::virtual_vendor::haply
