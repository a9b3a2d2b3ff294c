#pragma once
/// @file python_engine.hpp
/// A wall whose physics is a Python program (`engine: external`), and that fails on demand.
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace tools {

/// One row: what the program does in the middle of a step.
struct PythonFault {
  const char* name;        ///< "python_raises"
  const char* what;        ///< For --list.
  const char* statements;  ///< In Python. Empty: it is stopped from outside, as a debugger does, for a second.
  bool ends_in_zero;       ///< The force goes to zero meanwhile.
  bool beats_on;           ///< Its heartbeat, a native thread, goes on: a hung engine, not a lost one.
  bool ends_the_program;   ///< The session starts it anew.
  double lasts_s = 0.0;    ///< The force stays at zero for so long; 0: not known.
};

[[nodiscard]] std::span<const PythonFault> python_faults() noexcept;

/// Why no Python engine can run here; empty: one can. Also lets the interpreter find the package in a source tree.
[[nodiscard]] std::string why_no_python_engine();

/// Writes the engine. @param trigger File at whose appearance the engine does its fault; it removes the file first.
/// @returns The assignments for `rtbus run --set`.
[[nodiscard]] std::vector<std::string> write_python_engine(const std::filesystem::path& file,
                                                           const std::string& trigger, const PythonFault& fault);

}  // namespace tools
