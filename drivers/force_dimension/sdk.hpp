#pragma once
/// @file sdk.hpp
/// The functions of Force Dimension's SDK that the driver calls, found at run time: names, types and numbers of a
/// public interface, stated anew. Nothing of the SDK is needed to build.
///
/// Angles are rad, lengths m, forces N. `id` −1 is the default device. An int result is 0 (done), 1 or 2 (done, with a
/// remark) or −1; the reason is last_error() of the same thread.
#include <cstdint>
#include <string>

#include "rtbus/result.hpp"

namespace drivers::force_dimension {

// X(required, result, name, arguments)
#define RTBUS_FD_FUNCTIONS(X)                                                                                    \
  X(true, void, dhdGetSDKVersion, (int* major, int* minor, int* release, int* revision))                         \
  X(true, int, dhdGetDeviceCount, ())                                                                            \
  X(false, int, dhdGetAvailableCount, ())                                                                        \
  X(true, int, dhdOpenID, (char index))                                                                          \
  X(true, int, dhdOpenSerial, (int serial))                                                                      \
  X(true, int, dhdClose, (char id))                                                                              \
  X(true, int, dhdGetSystemType, (char id))                                                                      \
  X(true, const char*, dhdGetSystemName, (char id))                                                              \
  X(true, int, dhdGetSerialNumber, (unsigned short* out, char id))                                               \
  X(true, int, dhdGetPosition, (double* x, double* y, double* z, char id))                                       \
  X(true, int, dhdGetPositionAndOrientationFrame, (double* x, double* y, double* z, double(*frame)[3], char id)) \
  X(false, int, dhdGetLinearVelocity, (double* x, double* y, double* z, char id))                                \
  X(false, int, dhdGetGripperGap, (double* gap_m, char id))                                                      \
  X(true, int, dhdSetForce, (double x, double y, double z, char id))                                             \
  X(true, int, dhdSetForceAndTorqueAndGripperForce,                                                              \
    (double fx, double fy, double fz, double tx, double ty, double tz, double grip, char id))                    \
  X(true, int, dhdEnableForce, (unsigned char on, char id))                                                      \
  X(true, int, dhdSetBrakes, (int on, char id))                                                                  \
  X(false, int, dhdSetMaxForce, (double newton, char id))                                                        \
  X(true, int, dhdSetGravityCompensation, (int on, char id))                                                     \
  X(true, int, dhdGetButton, (int index, char id))                                                               \
  X(false, unsigned, dhdGetButtonMask, (char id))                                                                \
  X(true, int, dhdGetStatus, (int* status, char id))                                                             \
  X(true, int, dhdErrorGetLast, ())                                                                              \
  X(true, const char*, dhdErrorGetStr, (int error))                                                              \
  X(true, int, dhdEnableExpertMode, ())                                                                          \
  X(true, int, dhdDisableExpertMode, ())                                                                         \
  X(true, int, dhdSetTimeGuard, (int us, char id))                                                               \
  X(false, int, dhdSetWatchdog, (unsigned char steps, char id))                                                  \
  X(false, int, drdOpenID, (char index))                                                                         \
  X(false, int, drdClose, (char id))                                                                             \
  X(false, bool, drdIsSupported, (char id))                                                                      \
  X(false, bool, drdIsInitialized, (char id))                                                                    \
  X(false, bool, drdIsRunning, (char id))                                                                        \
  X(false, int, drdAutoInit, (char id))                                                                          \
  X(false, int, drdStop, (bool keep_force, char id))

struct Sdk {
// Types and an argument list with its own parentheses.  NOLINTNEXTLINE(bugprone-macro-parentheses)
#define RTBUS_FD_MEMBER(required, result, name, arguments) result(*name) arguments = nullptr;
  RTBUS_FD_FUNCTIONS(RTBUS_FD_MEMBER)
#undef RTBUS_FD_MEMBER
  std::string file;  ///< That it came from.

  /// libdrd's functions are there: the device can be calibrated by itself.
  [[nodiscard]] bool has_drd() const noexcept {
    return drdOpenID != nullptr && drdClose != nullptr && drdIsInitialized != nullptr && drdAutoInit != nullptr &&
           drdStop != nullptr;
  }
  [[nodiscard]] std::string version() const;  ///< "3.16.1"
  /// "COM error (error 2)", of the last call of this thread.
  [[nodiscard]] std::string last_error() const;
};

/// Result values that are no errors.
inline constexpr int kTimeGuard = 1;       ///< Asked again too soon: the state is the old one.
inline constexpr int kMotorSaturated = 2;  ///< The force was lowered.

/// Errors that the driver tells apart.
enum Error : int {
  kErrorCom = 2,
  kErrorNoDevice = 5,
  kErrorTimeout = 7,
  kErrorNotReady = 12,
  kErrorInvalidIndex = 15,
  kErrorNotEnabled = 19,
  kErrorInUse = 20,
};

/// Entries of dhdGetStatus(), whose array has 16 or 17 of them, by version: give it room for 32.
enum Status : int { kStatusReset = 3, kStatusForce = 5, kStatusBrake = 6, kStatusForceOffCause = 14 };
inline constexpr int kStatusRoom = 32;

/// Maps the library. @param file Of the device file; empty: the usual names, and the folders that FDSDK, FORCEDIM_SDK
/// and FD_SDK_DIR name.
[[nodiscard]] rtbus::Result<Sdk, std::string> load_sdk(const std::string& file);

}  // namespace drivers::force_dimension
