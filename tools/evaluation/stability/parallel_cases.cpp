#include "tools/evaluation/stability/parallel_cases.hpp"

#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <system_error>
#include <vector>

#include "tools/cli/common/interrupt.hpp"

namespace tools {

namespace {

struct Worker {
  pid_t pid = -1;
  int fd = -1;
  std::size_t next = 0;  ///< The case it is at.
};

/// The child: results into the pipe, each in one write below PIPE_BUF.
[[noreturn]] void serve(std::size_t from, std::size_t count, std::size_t stride, int fd,
                        const std::function<StabilityResult(std::size_t)>& work) {
  for (std::size_t i = from; i < count && !interrupted(); i += stride) {
    StabilityResult result = work(i);
    result.index = i;
    if (::write(fd, &result, sizeof result) != static_cast<ssize_t>(sizeof result)) break;
  }
  ::_exit(0);
}

void start(Worker& worker, std::size_t from, std::size_t count, std::size_t stride,
           const std::function<StabilityResult(std::size_t)>& work) {
  int ends[2];
  if (::pipe(ends) != 0) throw std::system_error(errno, std::generic_category(), "pipe");
  std::fflush(nullptr);
  const pid_t pid = ::fork();
  if (pid < 0) throw std::system_error(errno, std::generic_category(), "fork");
  if (pid == 0) {
    ::close(ends[0]);
    serve(from, count, stride, ends[1], work);
  }
  ::close(ends[1]);
  worker = {pid, ends[0], from};
}

/// One result; false at the end of the pipe.
bool read_result(int fd, StabilityResult& out) {
  char* const bytes = reinterpret_cast<char*>(&out);
  std::size_t got = 0;
  while (got < sizeof out) {
    const ssize_t n = ::read(fd, bytes + got, sizeof out - got);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    got += static_cast<std::size_t>(n);
  }
  return true;
}

}  // namespace

bool run_cases(std::size_t count, int jobs, const std::function<StabilityResult(std::size_t)>& work,
               const std::function<void(const StabilityResult&)>& done) {
  const auto stride = static_cast<std::size_t>(jobs < 1 ? 1 : jobs);
  std::vector<Worker> workers(stride);
  for (std::size_t w = 0; w < stride; ++w) start(workers[w], w, count, stride, work);
  std::size_t open = stride;
  while (open > 0) {
    std::vector<pollfd> polled;
    for (const Worker& worker : workers) polled.push_back({worker.fd, POLLIN, 0});
    if (::poll(polled.data(), polled.size(), -1) < 0 && errno != EINTR) {
      throw std::system_error(errno, std::generic_category(), "poll");
    }
    for (std::size_t w = 0; w < stride; ++w) {
      Worker& worker = workers[w];
      if (worker.fd < 0 || (polled[w].revents & (POLLIN | POLLHUP)) == 0) continue;
      StabilityResult result;
      if (read_result(worker.fd, result)) {
        worker.next = result.index + stride;
        done(result);
        continue;
      }
      ::close(worker.fd);
      int status = 0;
      while (::waitpid(worker.pid, &status, 0) < 0 && errno == EINTR) {
      }
      worker.fd = -1;
      --open;
      if (worker.next >= count || interrupted()) continue;
      StabilityResult broken;
      broken.index = worker.next;
      std::snprintf(broken.error, sizeof broken.error, WIFSIGNALED(status) ? "died of signal %d" : "ended with %d",
                    WIFSIGNALED(status) ? WTERMSIG(status) : WEXITSTATUS(status));
      done(broken);
      const std::size_t from = worker.next + stride;
      if (from >= count) continue;
      start(worker, from, count, stride, work);
      ++open;
    }
  }
  return !interrupted();
}

}  // namespace tools
