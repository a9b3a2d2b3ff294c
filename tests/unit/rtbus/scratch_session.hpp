#pragma once
/// @file scratch_session.hpp
/// A session of its own for each test, and children that die on command.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <functional>
#include <stdexcept>
#include <string>

#include "rtbus/segment.hpp"
#include "rtbus/topic_directory.hpp"

namespace rtbus::test {

/// A session name nobody else uses; removes what a test left behind when it ends.
class ScratchSession {
 public:
  ScratchSession() {
    static int count = 0;
    session_.name = "test-" + std::to_string(::getpid()) + "-" + std::to_string(++count);
  }
  ~ScratchSession() { (void)remove_dead(session_.name); }
  operator const Session&() const { return session_; }  // NOLINT: that is what it is for
  Session& operator*() { return session_; }
  Session* operator->() { return &session_; }
  [[nodiscard]] std::string path(const std::string& topic) const {
    return "/dev/shm/" + segment_name(session_.name, topic);
  }
  [[nodiscard]] bool exists(const std::string& topic) const {
    struct stat status {};
    return ::lstat(path(topic).c_str(), &status) == 0;
  }

 private:
  Session session_;
};

/// Runs `work` in a forked child that then sleeps until it is killed. Returns when `work` is done.
class Child {
 public:
  explicit Child(const std::function<bool()>& work) {
    int pipe_ends[2];
    if (::pipe(pipe_ends) != 0) throw std::runtime_error("pipe");
    pid_ = ::fork();
    if (pid_ == 0) {
      const char outcome = work() ? 'y' : 'n';
      (void)!::write(pipe_ends[1], &outcome, 1);
      for (;;) ::pause();
    }
    ::close(pipe_ends[1]);
    char outcome = 'n';
    succeeded_ = ::read(pipe_ends[0], &outcome, 1) == 1 && outcome == 'y';
    ::close(pipe_ends[0]);
  }
  ~Child() { kill(); }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  void kill() {
    if (pid_ <= 0) return;
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
    pid_ = -1;
  }
  [[nodiscard]] bool succeeded() const { return succeeded_; }
  [[nodiscard]] pid_t pid() const { return pid_; }

 private:
  pid_t pid_ = -1;
  bool succeeded_ = false;
};

/// A segment file mapped for writing, to damage it on purpose.
class RawFile {
 public:
  explicit RawFile(const std::string& path) {
    const int fd = ::open(path.c_str(), O_RDWR | O_CLOEXEC);
    struct stat status {};
    if (fd < 0 || ::fstat(fd, &status) != 0) throw std::runtime_error("cannot open " + path);
    size_ = static_cast<std::size_t>(status.st_size);
    data_ = static_cast<std::byte*>(::mmap(nullptr, size_, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0));
    ::close(fd);
  }
  ~RawFile() { ::munmap(data_, size_); }
  RawFile(const RawFile&) = delete;
  RawFile& operator=(const RawFile&) = delete;
  template <class T>
  T& at(std::size_t offset) {
    return *reinterpret_cast<T*>(data_ + offset);
  }

 private:
  std::byte* data_ = nullptr;
  std::size_t size_ = 0;
};

/// A small sample whose fields are easy to check.
struct Probe {
  std::uint64_t number = 0;
  double value = 0.0;
  std::array<double, 3> vector{};
};

}  // namespace rtbus::test

template <>
struct rtbus::SampleTraits<rtbus::test::Probe> {
  static constexpr std::string_view kName = "test/Probe";
  using T = rtbus::test::Probe;
  static constexpr std::array kFields{RTBUS_FIELD(T, number, "1"), RTBUS_FIELD(T, value, "m"),
                                      RTBUS_FIELD(T, vector, "N")};
};

namespace rtbus::test {

/// The same size under another name and type.
struct OtherProbe {
  std::array<std::uint64_t, 5> numbers{};
};

}  // namespace rtbus::test

template <>
struct rtbus::SampleTraits<rtbus::test::OtherProbe> {
  static constexpr std::string_view kName = "test/OtherProbe";
  using T = rtbus::test::OtherProbe;
  static constexpr std::array kFields{RTBUS_FIELD(T, numbers, "1")};
};
