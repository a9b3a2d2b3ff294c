#pragma once
/// @file falcon_protocol.hpp
/// The Novint Falcon behind the shared I/O thread of the USB drivers: brings the device to life (probe, firmware, mode
/// of the line), then exchanges one 16-byte frame each way per sample. Frame D of the driver has the axes of frame B of
/// falcon_kinematics.hpp and its origin at FalconSettings::centre_m.
///
/// The user homes the device by pulling the grip out and pushing it in; until all three axes are homed every command is
/// zero and the red light is on. Afterwards the grip's weight is compensated, growing over a second, and the green
/// light is on.
#include <array>
#include <memory>
#include <string>

#include <Eigen/Core>

#include "drivers/device.hpp"
#include "drivers/falcon/falcon_firmware.hpp"
#include "drivers/falcon/falcon_frame.hpp"
#include "drivers/falcon/falcon_kinematics.hpp"
#include "drivers/falcon/motor_commands.hpp"
#include "drivers/usb/inspection.hpp"
#include "drivers/usb/protocol.hpp"

namespace drivers::falcon {

inline constexpr std::uint16_t kVendorId = 0x0403;  // FTDI's, which assigned the product number
inline constexpr std::uint16_t kProductId = 0xCB48;

/// Everything a Falcon is driven with. Keys: config/devices/falcon.yaml.
struct FalconSettings {
  std::shared_ptr<const FirmwareImage> firmware;  ///< Null: the Falcon must be running already.
  bool force_upload = false;                      ///< Load the firmware at start even when some is running.
  bool never_probe = false;                       ///< Do not ask whether some is running: always load.
  UploadPatience patience;
  Geometry geometry = geometries()[0];
  double command_gain = kGainMartinHillier;   ///< Counts per N·m of joint torque, calibration included.
  Eigen::Vector3d centre_m{0.0, 0.0, 0.120};  ///< Origin of D in B.
  double grip_mass_kg = 0.0;                  ///< Whose weight the motors carry.
  double max_force_n = 8.0;                   ///< Of force and weight together, norm at the tip.
  bool keep_homing_flag = true;               ///< Also after homing.
  bool event_character = false;               ///< Ask the USB chip to send at each `>` instead of each millisecond.
};

class FalconProtocol final : public usb::Protocol {
 public:
  explicit FalconProtocol(FalconSettings settings);

  [[nodiscard]] rtbus::Result<void, DeviceFault> bring_up(usb::Channel& channel) override;
  [[nodiscard]] usb::UsbStatus send(usb::Channel& channel, const Vec3& force_n, double dt_s,
                                    std::uint64_t deadline_ns) noexcept override;
  [[nodiscard]] bool withheld() const noexcept override { return withheld_; }
  void set_live(bool live) noexcept override { live_ = live; }
  [[nodiscard]] usb::ExchangeStatus receive(usb::Channel& channel, DeviceSample& out,
                                            std::uint64_t deadline_ns) noexcept override;
  void shut_down(usb::Channel& channel) noexcept override;

  [[nodiscard]] usb::Readiness readiness() const noexcept override {
    return homed_ == kAllHomed ? usb::Readiness::kReady : usb::Readiness::kNotHomed;
  }
  [[nodiscard]] std::string remedy() const override;
  [[nodiscard]] const usb::LinkCounters& counters() const noexcept override { return counters_; }

  /// Asks a Falcon that nobody uses: whether firmware runs, and whether it is homed. At most two zero frames, no
  /// handshake, which would restart the processor and lose both.
  [[nodiscard]] usb::Inspection inspect(usb::Channel& channel);

  /// The last upload, for people; attempts 0: the firmware was running already.
  [[nodiscard]] const UploadReport& upload() const noexcept { return upload_; }

 private:
  [[nodiscard]] usb::UsbStatus set_up_exchange(usb::Channel& channel) noexcept;
  [[nodiscard]] usb::UsbStatus poll_frames(usb::Channel& channel, int frames, bool& answered,
                                           DeviceFrame* answer = nullptr) noexcept;
  [[nodiscard]] rtbus::Result<void, DeviceFault> load(usb::Channel& channel);
  [[nodiscard]] usb::UsbStatus send_frame(usb::Channel& channel, const HostFrame& frame,
                                          std::uint64_t deadline_ns) noexcept;
  [[nodiscard]] usb::UsbStatus read_into_finder(usb::Channel& channel, std::uint64_t deadline_ns) noexcept;
  [[nodiscard]] bool newest_frame(DeviceFrame& out) noexcept;
  void discard_late_answers(usb::Channel& channel) noexcept;
  [[nodiscard]] std::uint64_t damages() const noexcept {
    return counters_.bad_frames + counters_.resyncs + payload_errors_;
  }
  void note_damage(std::uint64_t now_ns) noexcept;
  [[nodiscard]] bool accept(const DeviceFrame& frame, std::uint64_t now_ns, DeviceSample& out) noexcept;
  void forget() noexcept;

  const FalconSettings settings_;
  const Kinematics kinematics_;
  std::array<std::uint8_t, 4096> transfer_{};
  FrameFinder finder_;
  int unanswered_ = 0;   ///< Commands whose answer may still come.
  int sends_since_ = 0;  ///< Sends since that became more than one.
  std::uint8_t homed_ = 0;
  bool doubted_ = false;  ///< The last answer was the first one without all axes homed.
  bool withheld_ = false;
  bool live_ = true;
  std::uint64_t accepted_ns_ = 0;  ///< When the last valid answer came.
  /// Frames have no checksum: where damage is seen, there is damage that is not. Until then no frame is believed.
  std::uint64_t doubted_until_ns_ = 0;
  std::uint64_t damaged_ns_ = 0;      ///< When damage was seen last.
  std::uint64_t damages_ = 0;         ///< Seen until then.
  std::uint64_t payload_errors_ = 0;  ///< Told by the USB chip.
  double carried_ = 0.0;              ///< Share of the grip's weight that the motors carry now, 0…1.
  Eigen::Vector3d position_m_;        ///< Frame B.
  Eigen::Vector3d angles_rad_;
  bool uploaded_ = false;
  UploadReport upload_;
  usb::LinkCounters counters_;
};

}  // namespace drivers::falcon
