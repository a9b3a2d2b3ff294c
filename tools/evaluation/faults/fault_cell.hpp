#pragma once
/// @file fault_cell.hpp
/// A cell in a process of its own: it may change its limits and its file systems, a time limit ends it, and nothing
/// that it started outlives it.
#include <sys/types.h>

#include <cstdint>
#include <optional>
#include <string>

#include "tools/evaluation/faults/fault_session.hpp"

namespace tools {

class FaultCell {
 public:
  /// Starts it. @param trace File for the trace of the force; empty: none.
  FaultCell(FaultSetup setup, const std::string& trace);
  ~FaultCell();
  FaultCell(FaultCell&& other) noexcept;
  FaultCell& operator=(FaultCell&&) = delete;

  /// Nothing while it runs. One that takes too long is killed, which is a problem of the cell.
  [[nodiscard]] std::optional<FaultOutcome> poll();
  /// Waits for it. A signal to this program ends it early.
  [[nodiscard]] FaultOutcome wait();
  [[nodiscard]] const FaultSetup& setup() const noexcept { return setup_; }

 private:
  [[nodiscard]] std::string outcome_file() const { return setup_.report + ".outcome"; }
  [[nodiscard]] FaultOutcome take(int wait_status);

  FaultSetup setup_;
  pid_t pid_ = 0;
  std::uint64_t began_ns_ = 0, limit_ns_ = 0;
  bool killed_ = false;
};

}  // namespace tools
