#include "rtbus/private_folder.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>

namespace rtbus {

PrivateFolders private_folders_of(uid_t uid) {
  return {"/run/user/" + std::to_string(uid), "/tmp/rtbus-" + std::to_string(uid)};
}

std::string private_folder() {
  const auto mine = [](const char* path) {
    struct stat info {};
    return ::lstat(path, &info) == 0 && S_ISDIR(info.st_mode) && info.st_uid == ::geteuid() &&
           (info.st_mode & 0077) == 0;
  };
  if (const char* runtime = std::getenv("XDG_RUNTIME_DIR"); runtime != nullptr && mine(runtime)) return runtime;
  const std::string own = private_folders_of(::geteuid()).own;
  if (::mkdir(own.c_str(), 0700) != 0 && errno != EEXIST) return "";
  return mine(own.c_str()) ? own : "";
}

}  // namespace rtbus
