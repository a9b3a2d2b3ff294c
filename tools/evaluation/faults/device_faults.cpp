// Faults of devices that can happen while a session runs. On the stand-ins for makers' devices: unplugged, silent,
// late, garbage, not calibrated any more; the service's connection closed, its answers in pieces. Faults at their start
// are tests/unit/vendor's. Stalls and short packets end within a maker's library: those cells cannot be. On the virtual
// USB devices, a Falcon and a PHANToM-class arm: unplugged, stalled, short, late, mute, garbage.
#include <algorithm>
#include <fstream>
#include <string_view>

#include "drivers/registry/registry.hpp"
#include "tools/evaluation/faults/fault_session.hpp"

namespace tools {
namespace {

/// One row: what goes wrong, and what the hand is promised then (docs/device-*.md).
struct DeviceFault {
  const char* name;                 ///< "omega_unplugged"
  const char* what;                 ///< For --list.
  const char* driver;               ///< It is left out where this driver was not built.
  const char* session;              ///< File beside the session of the other cells.
  std::vector<const char*> faults;  ///< Keys of `virtual:`; their times count from the fault.
  double zero_ms;                   ///< Promised: zero force after the fault.
  double lasts_s;                   ///< The device is well again so long after the fault; < 0: it stays so.
  bool quick;                       ///< Also with --quick: one row per driver.
  Feels feels = Feels::kZero;
};

/// Force time-out of the drivers, and the omega's watchdog; one tick on top.
constexpr double kForceTimeout_ms = 20.0 + 1.0;
/// The stand-in's own choice for the service, whose delay until idle is not established.
constexpr double kServiceIdle_ms = 100.0 + 1.0;
/// The virtual Falcon's own time-out (torque_timeout_ms), and that of the arm's amplifiers: nothing reaches either one
/// any more.
constexpr double kFalconTimeout_ms = 50.0 + 1.0, kArmTimeout_ms = 100.0 + 1.0;

const std::vector<DeviceFault>& all() {
  static const std::vector<DeviceFault> rows{
      {"omega_unplugged",
       "a virtual omega.3 is unplugged, and plugged in a second later",
       "force_dimension",
       "wall_virtual_omega.yaml",
       {"faults.unplug_at_s=0", "faults.replug_after_s=1"},
       kForceTimeout_ms,
       1.0,
       true},
      {"omega_silent",
       "a virtual omega.3 is silent for 0.3 s",
       "force_dimension",
       "wall_virtual_omega.yaml",
       {"block_at_s=0", "block_s=0.3"},
       kForceTimeout_ms,
       0.3,
       false},
      {"omega_uncalibrated",
       "a virtual omega.3 loses its calibration",
       "force_dimension",
       "wall_virtual_omega.yaml",
       {"lose_calibration_at_s=0"},
       kForceTimeout_ms,
       -1.0,
       false},
      {"omega_late",
       "each call to the SDK of a virtual omega.3 takes 15 ms longer, for 0.3 s",
       "force_dimension",
       "wall_virtual_omega.yaml",
       {"faults.late_reply=1", "faults.late_ms=15", "faults.for_s=0.3"},
       0.0,
       0.3,
       false,
       Feels::kAnything},
      {"omega_garbage",
       "every tenth position of a virtual omega.3 is wrong, for 0.3 s",
       "force_dimension",
       "wall_virtual_omega.yaml",
       {"faults.garbage=0.1", "faults.for_s=0.3"},
       0.0,
       0.3,
       false,
       Feels::kAnything},
      {"touch_unplugged",
       "a virtual Touch is unplugged",
       "openhaptics",
       "wall_virtual_touch.yaml",
       {"faults.unplug_at_s=0"},
       kForceTimeout_ms,
       -1.0,
       false},
      {"touch_uncalibrated",
       "a virtual Touch loses its calibration",
       "openhaptics",
       "wall_virtual_touch.yaml",
       {"uncalibrate_at_s=0"},
       kForceTimeout_ms,
       -1.0,
       false},
      {"touch_calibrated_again",
       "a virtual Touch loses its calibration and is docked again 0.5 s later",
       "openhaptics",
       "wall_virtual_touch.yaml",
       {"uncalibrate_at_s=0", "docked_at_s=0.5"},
       kForceTimeout_ms,
       0.5,
       true},
      {"touch_late",
       "each servo tick of a virtual Touch comes 15 ms late, for 0.3 s",
       "openhaptics",
       "wall_virtual_touch.yaml",
       {"faults.late_reply=1", "faults.late_ms=15", "faults.for_s=0.3"},
       0.0,
       0.3,
       false,
       Feels::kAnything},
      {"touch_garbage",
       "every tenth position of a virtual Touch is wrong, for 0.3 s",
       "openhaptics",
       "wall_virtual_touch.yaml",
       {"faults.garbage=0.1", "faults.for_s=0.3"},
       0.0,
       0.3,
       false,
       Feels::kAnything},
      {"inverse3_unplugged",
       "a virtual Inverse3 is unplugged, and plugged in a second later",
       "haply",
       "wall_virtual_inverse3.yaml",
       {"faults.unplug_at_s=0", "faults.replug_after_s=1"},
       kServiceIdle_ms,
       1.0,
       false},
      {"inverse3_silent",
       "a virtual Inverse3 is silent for a second",
       "haply",
       "wall_virtual_inverse3.yaml",
       {"mute_at_s=0", "mute_for_s=1"},
       kForceTimeout_ms,
       1.0,
       false},
      {"inverse3_service_closes",
       "the Inverse Service closes the connection",
       "haply",
       "wall_virtual_inverse3.yaml",
       {"close_at_s=0"},
       kServiceIdle_ms,
       0.0,
       true},
      {"inverse3_late",
       "each answer of the Inverse Service comes 15 ms late, for 0.3 s",
       "haply",
       "wall_virtual_inverse3.yaml",
       {"faults.late_reply=1", "faults.late_ms=15", "faults.for_s=0.3"},
       0.0,
       0.3,
       false,
       Feels::kAnything},
      {"inverse3_short",
       "each answer of the Inverse Service comes in two frames, for 0.3 s",
       "haply",
       "wall_virtual_inverse3.yaml",
       {"faults.split_reply=1", "faults.for_s=0.3"},
       0.0,
       0.3,
       false,
       Feels::kAnything},
      {"inverse3_garbage",
       "a bit is wrong in every tenth answer of the Inverse Service, for 0.3 s",
       "haply",
       "wall_virtual_inverse3.yaml",
       {"faults.garbage=0.1", "faults.for_s=0.3"},
       0.0,
       0.3,
       false,
       Feels::kAnything},
      {"falcon_unplugged",
       "a virtual Falcon is unplugged, and plugged in a second later",
       "falcon",
       "wall_virtual_falcon.yaml",
       {"faults.unplug_at_s=0", "faults.replug_after_s=1"},
       kFalconTimeout_ms,
       1.0,
       true},
      {"falcon_mute",
       "a virtual Falcon hears and says nothing for 0.3 s",
       "falcon",
       "wall_virtual_falcon.yaml",
       {"faults.mute=true", "faults.for_s=0.3"},
       kFalconTimeout_ms,
       0.3,
       false},
      {"falcon_stalled",
       "each packet of a virtual Falcon is refused by a stall for 0.3 s",
       "falcon",
       "wall_virtual_falcon.yaml",
       {"faults.stall_in=1", "faults.for_s=0.3"},
       kFalconTimeout_ms,
       0.3,
       false},
      {"falcon_late",
       "each answer of a virtual Falcon comes 15 ms late, for 0.3 s",
       "falcon",
       "wall_virtual_falcon.yaml",
       {"faults.late_reply=1", "faults.late_ms=15", "faults.for_s=0.3"},
       0.0,
       0.3,
       false,
       Feels::kAnything},
      {"falcon_short",
       "each answer of a virtual Falcon comes in two packets, for 0.3 s",
       "falcon",
       "wall_virtual_falcon.yaml",
       {"faults.split_reply=1", "faults.for_s=0.3"},
       0.0,
       0.3,
       false,
       Feels::kAnything},
      {"falcon_garbage",
       "every tenth byte of the answers of a virtual Falcon is wrong, for 0.3 s",
       "falcon",
       "wall_virtual_falcon.yaml",
       {"faults.flip_reply_bit=0.1", "faults.for_s=0.3"},
       0.0,
       0.3,
       false,
       Feels::kAnything},
      {"arm_unplugged",
       "a virtual PHANToM-class arm is unplugged, and plugged in a second later, where it has moved",
       "phantom",
       "wall_virtual_phantom.yaml",
       {"faults.unplug_at_s=0", "faults.replug_after_s=1"},
       kArmTimeout_ms,
       -1.0,
       true},
      {"arm_mute",
       "a virtual PHANToM-class arm does not answer for 0.15 s",
       "phantom",
       "wall_virtual_phantom.yaml",
       {"faults.mute=true", "faults.for_s=0.15"},
       kForceTimeout_ms,
       0.15,
       false},
      {"arm_stalled",
       "each packet of a virtual PHANToM-class arm is refused by a stall for 0.15 s",
       "phantom",
       "wall_virtual_phantom.yaml",
       {"faults.stall_in=1", "faults.for_s=0.15"},
       kForceTimeout_ms,
       0.15,
       false},
      {"arm_late",
       "each answer of a virtual PHANToM-class arm comes 15 ms late, for 0.3 s",
       "phantom",
       "wall_virtual_phantom.yaml",
       {"faults.late_reply=1", "faults.late_ms=15", "faults.for_s=0.3"},
       0.0,
       0.3,
       false,
       Feels::kAnything},
      {"arm_short",
       "each answer of a virtual PHANToM-class arm comes in two packets, for 0.3 s",
       "phantom",
       "wall_virtual_phantom.yaml",
       {"faults.split_reply=1", "faults.for_s=0.3"},
       0.0,
       0.3,
       false,
       Feels::kAnything},
      {"arm_garbage",
       "every tenth byte of the answers of a virtual PHANToM-class arm is wrong, for 0.3 s",
       "phantom",
       "wall_virtual_phantom.yaml",
       {"faults.flip_reply_bit=0.1", "faults.for_s=0.3"},
       0.0,
       0.3,
       false,
       Feels::kAnything}};
  return rows;
}

FaultRow row_of(const DeviceFault& fault) {
  FaultRow row;
  row.name = fault.name;
  row.what = fault.what;
  row.feels = fault.feels;
  row.zero_ms = fault.zero_ms;
  row.ends = fault.lasts_s >= 0.0 ? Ends::kComesBack : Ends::kStaysAtZero;
  row.quick = fault.quick;
  // A loop that its silent device paces wakes late without the machine's doing.
  row.own_wakeups = true;
  row.held = row.feels == Feels::kZero && fault.lasts_s * 1e3 > fault.zero_ms;
  row.session = fault.session;
  row.prepare = [&fault](RunCommand& command, const FaultSession& cell) {
    const bool usb = std::string_view(fault.driver) == "falcon" || std::string_view(fault.driver) == "phantom";
    const std::string unit = usb ? "haptic.0.device.usb.virtual." : "haptic.0.device.virtual.";
    command.arguments.insert(command.arguments.end(), {"--set", unit + "publish_state=true", "--set",
                                                       unit + "faults.trigger=" + cell.trigger()});
    for (const char* const each : fault.faults)
      command.arguments.insert(command.arguments.end(), {"--set", unit + each});
  };
  row.happen = [&fault](FaultSession& cell) {
    const std::uint64_t begins_ns = rtbus::monotonic_ns();
    std::ofstream(cell.trigger()).flush();
    if (fault.feels == Feels::kZero) {
      cell.await_zero();
    } else {
      cell.follow(std::max(0.0, fault.lasts_s));
    }
    cell.mark_over(begins_ns + static_cast<std::uint64_t>(std::max(0.0, fault.lasts_s) * 1e9));
  };
  return row;
}

}  // namespace

std::vector<FaultRow> device_faults() {
  std::vector<FaultRow> out;
  for (const DeviceFault& fault : all()) {
    if (drivers::driver_present(fault.driver)) out.push_back(row_of(fault));
  }
  return out;
}

}  // namespace tools
