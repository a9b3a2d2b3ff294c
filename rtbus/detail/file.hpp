#pragma once
/// @file file.hpp
/// Kernel locks on a segment's file, and which file a name leads to. Private to rtbus.
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <string>

namespace rtbus::detail {

/// Where glibc keeps POSIX shared memory. Needed to list it and to look at a name without opening it.
inline constexpr const char* kShmDirectory = "/dev/shm";

inline struct flock one_byte(short type, long byte) noexcept {
  struct flock lock {};
  lock.l_type = type;
  lock.l_whence = SEEK_SET;
  lock.l_start = byte;
  lock.l_len = 1;
  return lock;
}

/// Takes an open-file-description lock (F_WRLCK or F_RDLCK) without waiting. It belongs to the open file, not to the
/// process: two segments of one process do conflict, and closing an unrelated descriptor does not drop it (both unlike
/// classic POSIX locks). A child of fork() shares it until it closes the descriptor or calls exec (O_CLOEXEC).
[[nodiscard]] inline bool lock_byte(int fd, short type, long byte) noexcept {
  struct flock lock = one_byte(type, byte);
  return ::fcntl(fd, F_OFD_SETLK, &lock) == 0;
}

/// True when another open file holds a lock on `byte` that conflicts with `type`.
[[nodiscard]] inline bool is_locked_against(int fd, short type, long byte) noexcept {
  struct flock lock = one_byte(type, byte);
  return ::fcntl(fd, F_OFD_GETLK, &lock) == 0 && lock.l_type != F_UNLCK;
}

/// Identity of an inode.
struct FileId {
  dev_t device = 0;
  ino_t inode = 0;
  bool operator==(const FileId&) const = default;
};
[[nodiscard]] inline FileId file_id(const struct stat& status) noexcept { return {status.st_dev, status.st_ino}; }

/// Looks at what a segment name leads to, without following a symbolic link. False: nothing there.
[[nodiscard]] inline bool look_up(const std::string& name, struct stat& out) noexcept {
  const std::string path = std::string(kShmDirectory) + "/" + name;
  return ::lstat(path.c_str(), &out) == 0;
}
/// A file of ours has all its blocks from the beginning; one with holes was made or cut by somebody else.
[[nodiscard]] inline bool has_holes(const struct stat& status) noexcept {
  return static_cast<std::uint64_t>(status.st_blocks) * 512 < static_cast<std::uint64_t>(status.st_size);
}
[[nodiscard]] inline bool leads_to(const std::string& name, const FileId& id) noexcept {
  struct stat status {};
  return look_up(name, status) && file_id(status) == id;
}

}  // namespace rtbus::detail
