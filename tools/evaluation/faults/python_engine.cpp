#include "tools/evaluation/faults/python_engine.hpp"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "tools/cli/common/run_program.hpp"
#include "tools/cli/common/tree_python.hpp"

namespace tools {

namespace {

namespace fs = std::filesystem;

constexpr const char* kPython = "/usr/bin/python3";  // the one that the packages are for

/// The plane y = 0 of scenes/wall.yaml.
constexpr const char* kWall = R"(import gc, os, sys, time
import numpy as np
import rtbus

UP = np.array([0.0, 1.0, 0.0])

TAKES_S = []  # that the next steps take

def add_nan():
    UP[:] = np.nan

def fault():
FAULT

with rtbus.Engine(gives_bodies=True, bodies=1) as engine:
    for step in engine:
        if step.index == 1:
            engine.body(0, (0, 0, 0))
        if step.index % 10 == 0 and os.path.exists(TRIGGER):
            os.remove(TRIGGER)
            fault()
        if TAKES_S:
            time.sleep(TAKES_S.pop())
        for hand in step.hands:
            if hand.spring:
                velocity, mass = hand.free_step(step.dt)
                push = max(0.0, min((hand.radius - hand.position[1]) / step.dt, 0.1) - velocity[1])
                velocity = velocity + push * UP
                hand.move(hand.position + step.dt * velocity, velocity, mass * push * UP / step.dt)
            if hand.placed:
                x, y, z = hand.position
                if y - hand.radius < hand.reach:
                    hand.contact(0, (x, 0, z), UP, y - hand.radius, 0.0)
)";

std::string replaced(std::string text, const std::string& word, const std::string& by) {
  for (std::size_t at = 0; (at = text.find(word, at)) != std::string::npos; at += by.size()) {
    text.replace(at, word.size(), by);
  }
  return text;
}

}  // namespace

std::string why_no_python_engine() {
  for (const auto& [name, value] : tree_python()) ::setenv(name.c_str(), value.c_str(), 1);
  const ProgramOutcome found = run_program(kPython, ".", {"-c", "import rtbus._engine_library as e; e.library()"});
  if (found.status == 0) return {};
  return "no Python engine runs here (install python3-rtbus): " + found.complaint();
}

std::span<const PythonFault> python_faults() noexcept {
  static constexpr PythonFault kRows[] = {
      // A heap of cycles that the collector has to go through, again and again, for a second.
      {"python_collects_garbage", "an engine in Python collects garbage for a second",
       "gc.disable()\n"
       "heap = [[] for _ in range(100000)]\n"
       "for each in heap: each.append(each)\n"
       "end = time.monotonic() + 1.0\n"
       "while time.monotonic() < end: gc.collect()\n"
       "gc.enable()",
       true, true, false},
      // A step cannot say how long it takes before it has ended: the fault is in what the next one is believed.
      {"python_half_hertz", "an engine in Python takes 2 s for each of four steps", "TAKES_S.extend([2.0] * 4)", true,
       true, false, 7.5},
      {"python_raises", "an engine in Python ends by an exception", "raise RuntimeError('my world broke')", true, false,
       true},
      {"python_prints", "an engine in Python prints 3 MB within a step", "for _ in range(3000): print('x' * 1000)",
       false, true, false},
      {"python_forks", "an engine in Python forks within a step",
       "if os.fork() == 0:\n    time.sleep(2)\n    os._exit(0)", false, true, false},
      {"python_nan", "an engine in Python answers with numbers that are none; the interface refuses them", "add_nan()",
       true, false, true},
      {"python_stopped", "an engine in Python is stopped for a second", "", true, false, false},
  };
  return kRows;
}

std::vector<std::string> write_python_engine(const fs::path& file, const std::string& trigger,
                                             const PythonFault& fault) {
  std::error_code none;
  fs::remove(trigger, none);
  std::string indented;
  std::istringstream lines(fault.statements[0] == '\0' ? "pass" : fault.statements);
  for (std::string line; std::getline(lines, line);) indented += "    " + line + "\n";
  std::ofstream(file) << replaced(replaced(kWall, "FAULT\n", indented), "TRIGGER",
                                  "'" + fs::absolute(trigger).string() + "'");
  return {"physics.engine=external",
          "physics.command=[" + std::string(kPython) + ", " + fs::absolute(file).string() + "]", "physics.rate_hz=500"};
}

}  // namespace tools
