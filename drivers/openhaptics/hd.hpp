#pragma once
/// @file hd.hpp
/// The functions of the HDAPI (OpenHaptics, libHD) that the driver calls, found at run time: names, types and numbers
/// of a public interface, stated anew. Nothing of OpenHaptics is needed to build.
///
/// Lengths are mm, forces N, angles rad. On 64-bit Linux HDlong and the scheduler's handles have 8 bytes.
#include <cstdint>
#include <string>

#include "rtbus/result.hpp"

namespace drivers::openhaptics {

using Handle = std::uint32_t;           ///< HHD
using SchedulerHandle = unsigned long;  ///< HDSchedulerHandle
using Callback = std::uint32_t (*)(void* user_data);

/// HDErrorInfo: 12 bytes, returned by value.
struct ErrorInfo {
  std::uint32_t code = 0;
  int internal_code = 0;
  Handle device = 0;
};
static_assert(sizeof(ErrorInfo) == 12 && sizeof(SchedulerHandle) == 8);

// X(required, result, name, arguments)
#define RTBUS_HD_FUNCTIONS(X)                                                                                     \
  X(true, Handle, hdInitDevice, (const char* name))                                                               \
  X(true, void, hdDisableDevice, (Handle device))                                                                 \
  X(true, void, hdMakeCurrentDevice, (Handle device))                                                             \
  X(true, void, hdBeginFrame, (Handle device))                                                                    \
  X(true, void, hdEndFrame, (Handle device))                                                                      \
  X(true, ErrorInfo, hdGetError, ())                                                                              \
  X(true, const char*, hdGetErrorString, (std::uint32_t code))                                                    \
  X(true, void, hdEnable, (std::uint32_t what))                                                                   \
  X(true, void, hdGetBooleanv, (std::uint32_t what, unsigned char* out))                                          \
  X(true, void, hdGetIntegerv, (std::uint32_t what, int* out))                                                    \
  X(true, void, hdGetDoublev, (std::uint32_t what, double* out))                                                  \
  X(true, const char*, hdGetString, (std::uint32_t what))                                                         \
  X(true, void, hdSetDoublev, (std::uint32_t what, const double* value))                                          \
  X(true, std::uint32_t, hdCheckCalibration, ())                                                                  \
  X(true, void, hdUpdateCalibration, (std::uint32_t style))                                                       \
  X(true, void, hdStartScheduler, ())                                                                             \
  X(true, void, hdStopScheduler, ())                                                                              \
  X(true, SchedulerHandle, hdScheduleAsynchronous, (Callback callback, void* user_data, unsigned short priority)) \
  X(true, void, hdUnschedule, (SchedulerHandle handle))

struct Hd {
// Types and an argument list with its own parentheses.  NOLINTNEXTLINE(bugprone-macro-parentheses)
#define RTBUS_HD_MEMBER(required, result, name, arguments) result(*name) arguments = nullptr;
  RTBUS_HD_FUNCTIONS(RTBUS_HD_MEMBER)
#undef RTBUS_HD_MEMBER
  std::string file;  ///< That it came from.
};

enum : std::uint32_t {
  // Parameters
  kButtons = 0x2000,
  kInkwellSwitch = 0x2002,  ///< 0: the stylus is docked.
  kPosition = 0x2050,
  kVelocity = 0x2051,   ///< mm/s, filtered by the library.
  kTransform = 0x2052,  ///< 16 values, column-major.
  kVersion = 0x2500,
  kModelType = 0x2501,
  kDriverVersion = 0x2502,
  kSerialNumber = 0x2504,
  kUsableWorkspace = 0x2551,  ///< 6 values: lowest x, y, z, highest x, y, z.
  kCalibrationStyle = 0x2555,
  kNominalMaxForce = 0x2603,
  kCurrentForce = 0x2700,
  // Capabilities
  kForceOutput = 0x4000,
  kMaxForceClamping = 0x4001,
  // Calibration
  kCalibrationOk = 0x5000,
  kCalibrationNeedsUpdate = 0x5001,
  kCalibrationNeedsManualInput = 0x5002,
  kStyleEncoderReset = 1,
  kStyleAuto = 2,
  kStyleInkwell = 4,
  // Others
  kInvalidHandle = 0xFFFFFFFF,
  kLastPlausibleHandle = 1024,  ///< What lies above is a failed initialisation too.
  kCallbackDone = 0,
  kCallbackContinue = 1,
  kDefaultPriority = 32767,
};

/// @param file Of the device file; empty: the usual names.
[[nodiscard]] rtbus::Result<Hd, std::string> load_hd(const std::string& file);

/// What an error code asks of the driver.
enum class ErrorKind : std::uint8_t {
  kNone,    ///< Success, and what is known to be harmless.
  kWarm,    ///< The motors are near their limit; the library lowers the force.
  kForce,   ///< The library cut the force for safety; it comes back by its ramp.
  kDevice,  ///< The device is gone, or never came.
  kOther,   ///< A call was wrong.
};
[[nodiscard]] ErrorKind kind_of(std::uint32_t code) noexcept;
/// "COMM_ERROR (0x0302, internal -28): the link is lost; …": what it means, and what to do.
[[nodiscard]] std::string explain(const ErrorInfo& error);

}  // namespace drivers::openhaptics
