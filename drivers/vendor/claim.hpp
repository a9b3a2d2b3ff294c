#pragma once
/// @file claim.hpp
/// Which session of this machine drives a vendor's device. A vendor's library may let two programs command one device,
/// or refuse the second without saying whose the first is: a session takes a claim before it opens anything.
///
/// A claim is a socket in Linux's abstract namespace, with no file: it ends with its process, however that ends. A
/// second socket beside it carries the owner's name, which /proc/net/unix shows to everybody. Sessions in containers
/// with a network of their own do not see each other's claims.
#include <string>

#include "rtbus/result.hpp"

namespace drivers::vendor {

class Claim {
 public:
  Claim() = default;  ///< Of nothing.
  ~Claim() { release(); }
  Claim(Claim&& other) noexcept;
  Claim& operator=(Claim&& other) noexcept;
  Claim(const Claim&) = delete;
  Claim& operator=(const Claim&) = delete;

  /// @param device "force_dimension 4711": the same for everybody who means the same device.
  /// @param owner  "session wall, node haptic0": what others are told about this claim.
  /// The failure is the owner that has it. @realtime No.
  [[nodiscard]] static rtbus::Result<Claim, std::string> take(const std::string& device, const std::string& owner);

  [[nodiscard]] bool held() const noexcept { return claim_ >= 0; }
  void release() noexcept;

 private:
  int claim_ = -1, name_ = -1;
};

/// Which other process has claimed a device whose name begins so: "session wall, node haptic0 (pid 4711)"; empty: none.
[[nodiscard]] std::string other_owner(const std::string& device);

}  // namespace drivers::vendor
