#include "rtbus/detail/fork_guard.hpp"

#include <fcntl.h>
#include <pthread.h>
#include <sys/mman.h>
#include <unistd.h>

namespace rtbus::detail {

/// The guards of this process, as a list.
struct ForkGuards {
  static pthread_mutex_t mutex;
  static ForkGuard* first;

  static void lock() { ::pthread_mutex_lock(&mutex); }
  static void unlock() { ::pthread_mutex_unlock(&mutex); }
  static void in_child() {
    const int nowhere = ::open("/dev/null", O_RDWR | O_CLOEXEC);
    for (ForkGuard* each = first; each != nullptr; each = each->after_) {
      if (nowhere >= 0) ::dup3(nowhere, each->fd_, O_CLOEXEC);
      // Without memory for a copy the child has no page here, rather than the parent's.
      if (::mmap(each->base_, each->bytes_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED, -1, 0) ==
          MAP_FAILED) {
        ::munmap(each->base_, each->bytes_);
      }
      if (each->owner_ != nullptr) *each->owner_ = false;
    }
    if (nowhere >= 0) ::close(nowhere);
    unlock();
  }
};
pthread_mutex_t ForkGuards::mutex = PTHREAD_MUTEX_INITIALIZER;
ForkGuard* ForkGuards::first = nullptr;

void ForkGuard::watch(int fd, void* base, std::size_t bytes, bool* owner) noexcept {
  static const int registered = ::pthread_atfork(&ForkGuards::lock, &ForkGuards::unlock, &ForkGuards::in_child);
  (void)registered;
  forget();
  ForkGuards::lock();
  fd_ = fd;
  base_ = base;
  bytes_ = bytes;
  owner_ = owner;
  after_ = ForkGuards::first;
  if (after_ != nullptr) after_->before_ = this;
  ForkGuards::first = this;
  ForkGuards::unlock();
}

void ForkGuard::forget() noexcept {
  if (fd_ < 0) return;
  ForkGuards::lock();
  (before_ != nullptr ? before_->after_ : ForkGuards::first) = after_;
  if (after_ != nullptr) after_->before_ = before_;
  before_ = after_ = nullptr;
  fd_ = -1;
  ForkGuards::unlock();
}

}  // namespace rtbus::detail
