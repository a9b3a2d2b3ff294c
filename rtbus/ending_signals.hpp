#pragma once
/// @file ending_signals.hpp
/// The signals that end a node: blocked everywhere, waited for by main().
#include <pthread.h>
#include <signal.h>

namespace rtbus {

/// Blocks SIGINT, SIGTERM and SIGHUP in this thread and those it will start; main() waits for them with sigwait() or
/// sigtimedwait(), so that no handler interrupts anything. SIGPIPE is ignored: a reader of our messages that goes away
/// must not end a node. Call it in main(), before any thread exists. @returns the blocked set.
[[nodiscard]] inline sigset_t block_ending_signals() {
  sigset_t ending;
  sigemptyset(&ending);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&ending, signal);
  pthread_sigmask(SIG_BLOCK, &ending, nullptr);
  ::signal(SIGPIPE, SIG_IGN);
  return ending;
}

}  // namespace rtbus
