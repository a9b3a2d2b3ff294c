#pragma once
/// @file private_folder.hpp
/// Where pipes and sockets of a session live.
#include <sys/types.h>

#include <string>

namespace rtbus {

/// A folder that only this user may enter: $XDG_RUNTIME_DIR, else /tmp/rtbus-UID, which is made. Empty when neither can
/// be had.
[[nodiscard]] std::string private_folder();

/// That folder of user `uid` in a process that may have had another environment: the two places where it can be.
struct PrivateFolders {
  std::string runtime;  ///< /run/user/UID, as systemd sets XDG_RUNTIME_DIR.
  std::string own;      ///< /tmp/rtbus-UID.
};
[[nodiscard]] PrivateFolders private_folders_of(uid_t uid);

}  // namespace rtbus
