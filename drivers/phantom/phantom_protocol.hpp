#pragma once
/// @file phantom_protocol.hpp
/// The bracket protocol as a usb::Protocol: line set-up, probe, homing, one exchange at a time.
///
/// The device answers each command once and discards what arrives while it works, so a command is never sent before the
/// last one was answered or given up (`kReplyLostNs`). Motor currents are zero while not homed, when no answer came for
/// kStaleNs, after an answer with an error bit of kCommandErrors, and in a pose that the linkage cannot have. With no
/// valid command for 100 ms the device itself cuts its amplifiers: the time-out that stands behind a host that dies.
#include <cstdint>
#include <memory>
#include <string>

#include "drivers/phantom/homing.hpp"
#include "drivers/phantom/motor_protection.hpp"
#include "drivers/phantom/phantom_kinematics.hpp"
#include "drivers/phantom/phantom_message.hpp"
#include "drivers/usb/inspection.hpp"
#include "drivers/usb/protocol.hpp"

namespace drivers::phantom {

/// Everything a PHANToM-class device is made from, besides which one it is.
struct PhantomSettings {
  Model model;
  HomingMode homing = HomingMode::kAtStart;
  double home_tolerance_rad = 0.05;
  MotorLimits motors;
  double gravity_share = 0.0;  ///< Of the arm's own weight that the motors carry, 0…1.
  std::array<double, 3> gimbal_sign{1.0, 1.0, 1.0};
  std::array<double, 3> gimbal_zero_rad{};
};

/// @p homing may outlive the protocol, so that a device that was lost keeps its history; see homing.hpp.
class PhantomProtocol final : public usb::Protocol {
 public:
  static constexpr std::uint64_t kReplyLostNs = 12'000'000;  ///< A command without answer for so long is lost.
  static constexpr std::uint64_t kStaleNs = 10'000'000;      ///< Older measurements justify no force.

  PhantomProtocol(const PhantomSettings& settings, std::shared_ptr<Homing> homing);

  [[nodiscard]] rtbus::Result<void, DeviceFault> bring_up(usb::Channel& channel) override;
  [[nodiscard]] usb::UsbStatus send(usb::Channel& channel, const Vec3& force_n, double dt_s,
                                    std::uint64_t deadline_ns) noexcept override;
  [[nodiscard]] usb::ExchangeStatus receive(usb::Channel& channel, DeviceSample& out,
                                            std::uint64_t deadline_ns) noexcept override;
  void shut_down(usb::Channel& channel) noexcept override;

  [[nodiscard]] bool withheld() const noexcept override { return withheld_; }
  [[nodiscard]] usb::Readiness readiness() const noexcept override;
  [[nodiscard]] std::string remedy() const override;
  [[nodiscard]] std::string fault() const override;
  [[nodiscard]] const usb::LinkCounters& counters() const noexcept override { return counters_; }

  /// Asks a board that the user has named: which arm it is and what its counters show. Zero currents alone. (A valid
  /// command switches the amplifiers on for 100 ms, at no current.)
  [[nodiscard]] usb::Inspection inspect(usb::Channel& channel);

  /// The newest answer and the currents last sent; for tools and tests. The I/O thread's.
  [[nodiscard]] const Reply& last_reply() const noexcept { return reply_; }
  [[nodiscard]] const CurrentsMa& last_currents_ma() const noexcept { return sent_ma_; }
  [[nodiscard]] const MotorProtection& protection() const noexcept { return protection_; }
  /// Answers whose pose the linkage cannot have [count].
  [[nodiscard]] std::uint64_t impossible_poses() const noexcept { return impossible_poses_; }

 private:
  enum class Got : std::uint8_t { kReply, kNothing, kLost, kStopping };

  [[nodiscard]] rtbus::Result<void, DeviceFault> set_line(usb::Channel& channel);
  [[nodiscard]] rtbus::Result<void, DeviceFault> drain(usb::Channel& channel);
  [[nodiscard]] rtbus::Result<void, DeviceFault> probe(usb::Channel& channel, bool any_model = false);
  [[nodiscard]] rtbus::Result<void, DeviceFault> look_for_calibration(usb::Channel& channel);
  [[nodiscard]] Got ask(usb::Channel& channel, const CurrentsMa& currents_ma);

  [[nodiscard]] usb::UsbStatus transmit(usb::Channel& channel, const CurrentsMa& currents_ma,
                                        std::uint64_t deadline_ns) noexcept;
  [[nodiscard]] Got next_reply(usb::Channel& channel, std::uint64_t deadline_ns) noexcept;
  [[nodiscard]] CurrentsMa currents_for(const Vec3& force_n) noexcept;
  [[nodiscard]] usb::ExchangeStatus measure(std::uint64_t now_ns, DeviceSample& out) noexcept;
  void take_pose() noexcept;
  void watch_calibration(std::uint64_t now_ns) noexcept;

  PhantomSettings settings_;
  Kinematics kinematics_;
  MotorProtection protection_;
  std::shared_ptr<Homing> homing_;
  usb::LinkCounters counters_;
  ReplyDecoder decoder_;

  Reply reply_;
  std::uint64_t answered_ns_ = 0;  ///< When the newest valid answer arrived.
  std::uint64_t sent_ns_ = 0;
  bool owed_ = false;       ///< A command was sent and not answered yet.
  bool abandoned_ = false;  ///< The answer to an abandoned command may still come.
  CurrentsMa sent_ma_{};
  bool connected_ = false;  ///< Brought up, and not shut down since.
  bool withhold_ = true;    ///< The last answer justifies no force.
  bool withheld_ = false;   ///< The last send() was asked for one and gave none.

  ArmPose pose_;
  JointAngles angles_ = JointAngles::Zero();
  DeviceSample sample_;
  std::uint64_t impossible_poses_ = 0;

  bool calibration_pending_ = false;  ///< Firmware that waits for its button and shows no counters before.
  int echo_ma_ = 0;                   ///< Of motor a, to see whether it still echoes.
  int echoes_missed_ = 0;
  int wrong_model_ = 0;
};

}  // namespace drivers::phantom
