"""The examples that people start from, run as they are."""

import json
import os
import re
import resource
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

import numpy as np

import rtbus
from rtbus.session import find_program
from tests.python.machine import Machine

EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "examples"
CONFIG = EXAMPLES.parents[1] / "config"
BUILT = Path(find_program()).parent
# A hand that begins 5 mm before what it pushes: a slow way, in which a pause of the machine is a small part.
HAND = {"haptic.0.device.hand.start_m": "[0, 0, 0.010]", "haptic.0.device.hand.speed_m_s": 0.02}
SETTLED_S = 0.3  # after a pause: the resume ramp is over, and what was pushed has come to rest


class Push:
    """A session in which the hand pushes until it has got so far along −z: what it felt while the machine did not pause."""

    def __init__(self, session_file, settings, reach_m=0.02):
        # An engine in Python takes seconds to begin, and ten on a full machine: the hand must wait for it.
        for start_s in (4, 12, 40):
            with Machine() as machine:
                waited = self._run(session_file, {**HAND, **settings, "haptic.0.device.hand.start_s": start_s}, reach_m)
            if waited:
                break
        else:
            raise AssertionError(f"the engine had not begun after {start_s} s:\n{self.log}")
        self.machine, self.name = machine, Path(session_file).name
        quiet = machine.was_quiet(self._ticks["due_ns"], SETTLED_S)
        self.force, self.z = self._ticks["force_n"][quiet], self._ticks["position_m"][quiet, 2]
        self.slides = self.force[self.z < -0.5 * reach_m, 2]

    def _run(self, session_file, settings, reach_m):
        """@returns False: the hand moved before all nodes ran."""
        session = rtbus.run(str(session_file), set=settings, timeout=60)
        try:
            blocks, reached, rests, end = [], 0.0, None, time.monotonic() + 90
            with session.open("haptic0.telemetry") as topic:
                while reached < reach_m:
                    if time.monotonic() > end:
                        raise AssertionError(f"the hand got {reached} m far:\n{session.log}")
                    topic.wait(0.1)
                    block = topic.read(4096)
                    if len(block) and rests is None:
                        rests = block["position_m"][0, 2] > 0.0099
                        if not rests:
                            return False
                    blocks.append(block)
                    reached = max(reached, -float(block["position_m"][:, 2].min(initial=0.0)))
            self._ticks, self.report = np.concatenate(blocks), session.end()
            return True
        finally:
            session.end()
            self.log = session.log
            session._log.close()

    @property
    def largest(self):
        """Force, while the machine did not pause [N]."""
        return float(np.linalg.norm(self.force, axis=1).max(initial=0.0))

    def judge_sliding(self, least, most):
        """The force of sliding, median over the last half of the way, against its bounds [N]."""
        if len(self.slides) < 100:  # of a second at 1 kHz
            self.machine.judge(False, f"{self.name}: {len(self.slides)} ticks of sliding without a pause")
        slides = float(np.median(self.slides))
        self.machine.judge(least <= slides <= most, f"{self.name}: sliding takes {slides} N, not {least} to {most} N")


class Examples(unittest.TestCase):
    def test_the_wall_stands_in_the_readme_and_is_short(self):
        wall = (EXAMPLES / "python" / "python_wall.py").read_text()
        lines = len(wall.splitlines())
        self.assertLessEqual(lines, 40)
        self.assertIn(f"A wall in {lines} lines:", wall)
        self.assertIn(wall, (EXAMPLES.parents[1] / "README.md").read_text())
        self.assertIn(f"a whole physics in {lines} lines", (EXAMPLES.parents[1] / "docs" / "your-own-physics.md").read_text())

    def test_the_wall_runs_in_the_tree_without_settings(self):
        ours = ("PYTHONPATH", "RTBUS_LIBRARY_DIR", "RTBUS_PROGRAM")
        environment = {name: value for name, value in os.environ.items() if name not in ours}
        environment["PATH"] = f"{Path(sys.executable).parent}:{environment['PATH']}"
        with tempfile.TemporaryDirectory() as folder:
            report = Path(folder) / "report.json"
            out = subprocess.run([find_program(), "run", str(EXAMPLES / "python" / "python_wall.yaml"), "--duration", "2", "--no-plots",
                                  "--set", f"session=py-{os.getpid()}-tree", "--report", str(report), "--no-bare-loop"],
                                 env=environment, cwd=folder, capture_output=True, text=True, timeout=90)
            self.assertEqual(out.returncode, 0, out.stdout + out.stderr)
            self.assertEqual(json.loads(report.read_text())["physics"]["engine"], "external")

    def test_own_engine_is_pushed_with_both_methods(self):
        methods = ("local_contact", "remote_virtual_coupling")
        command = f"[{BUILT / 'own_engine'}]"
        for method in methods:
            with self.subTest(method=method):
                push = Push(EXAMPLES / "own_engine.yaml", {"physics.command": command, "haptic.0.method": method})
                print(f"own_engine, {method}: largest force {push.largest:.2f} N")
                self.assertEqual(push.report["faults"], [], push.log)
                self.assertEqual(push.report["restarts"], [], push.log)
                self.assertLess(push.largest, 5.0)
                push.machine.judge(push.largest > 0.05, f"{method}: the largest force is {push.largest} N")

    def test_mujoco_is_felt_like_bullet(self):
        if not (BUILT / "mujoco_engine").exists():
            self.skipTest("built without MuJoCo")
        # Bullet's parts of a step last 1 ms too; both answer 100 times a second.
        sessions = [(CONFIG / "block_mujoco.yaml", {}, 0.025), (CONFIG / "free_block.yaml", {"physics.throttle_hz": 100}, 0.025)]
        try:
            import cffi  # noqa: F401

            python = f"[{sys.executable}, mujoco_python.py, block.xml]"
            sessions.append((EXAMPLES / "python" / "mujoco_python.yaml", {"physics.command": python}, 0.025))
        except ImportError:
            print("python3-cffi is not installed: mujoco_python.py is not run")
        found = [Push(*session) for session in sessions]
        friction = 0.1 * 0.5 * 9.81  # of the sliding block [N]
        for push in found:
            slides = float(np.median(push.slides)) if len(push.slides) else 0.0
            print(f"{push.name}: largest force {push.largest:.3f} N, sliding {slides:.3f} N in {len(push.slides)} quiet ticks, "
                  f"closed form {friction:.3f} N; {push.machine.evidence or 'no pause'}")
            self.assertEqual(push.report["faults"], [], push.log)
            self.assertEqual(push.report["restarts"], [], push.log)
        for push in found:
            push.judge_sliding(0.85 * friction, 1.15 * friction)
        for push in found[:2]:
            push.machine.judge(abs(found[0].largest - found[1].largest) <= 0.3, "MuJoCo and Bullet differ in the largest force")

    def test_a_scene_too_large_for_the_memory_is_refused_by_mujoco(self):
        if not (BUILT / "mujoco_engine").exists():
            self.skipTest("built without MuJoCo")
        environment = {**os.environ, "RTBUS_ENGINE_CONFIG": str(CONFIG / "block_mujoco.yaml"),
                       "RTBUS_ENGINE_SET": f"session=py-{os.getpid()}-oom\nscene=scenes/stack_500.yaml"}
        # MuJoCo asks for gigabytes with this scene.
        limit = lambda: resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30))  # noqa: E731
        out = subprocess.run([str(BUILT / "mujoco_engine")], env=environment, stdin=subprocess.PIPE, text=True,
                             stdout=subprocess.PIPE, stderr=subprocess.STDOUT, preexec_fn=limit, timeout=60)
        self.assertEqual(out.returncode, 2, out.stdout)
        self.assertIn("stack_500.yaml: MuJoCo refuses the scene", out.stdout)
        self.assertNotIn("Press Enter", out.stdout)

    def test_mujoco_refuses_what_it_cannot_do_by_name(self):
        if not (BUILT / "mujoco_engine").exists():
            self.skipTest("built without MuJoCo")
        command = [find_program(), "run", str(CONFIG / "soft_cube.yaml"), "--set", "physics.engine=mujoco",
                   "--set", f"session=py-{os.getpid()}-soft", "--duration", "1"]
        soft = [each for each in CONFIG.glob("*.yaml") if "soft" in each.name]
        command[2] = str(soft[0])
        out = subprocess.run(command, capture_output=True, text=True, timeout=60)
        self.assertNotEqual(out.returncode, 0)
        self.assertIn("soft, which the engine mujoco cannot do", out.stdout + out.stderr)


class Readers(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.session = rtbus.run("config/wall.yaml", timeout=60)
        cls.addClassCleanup(cls.session._log.close)
        cls.addClassCleanup(cls.session.end)

    def test_recordings_are_compared(self):
        try:
            import h5py  # noqa: F401
        except ImportError:
            self.skipTest("h5py is not installed")
        with tempfile.TemporaryDirectory() as folder:
            files = [os.path.join(folder, name) for name in ("a.h5", "b.h5")]
            records = [subprocess.Popen([find_program(), "record", file, "--session", self.session.name, "--duration", "1"],
                                        stdout=subprocess.DEVNULL) for file in files]
            self.assertEqual([each.wait(60) for each in records], [0, 0])
            out = subprocess.run([sys.executable, str(EXAMPLES / "python" / "compare_recordings.py"), *files],
                                 capture_output=True, text=True, timeout=90)
            self.assertEqual(out.returncode, 0, out.stderr)
            self.assertRegex(out.stdout, r"RMS 0\.\d+ N")

    def test_live_plot_draws(self):
        try:
            import matplotlib  # noqa: F401
        except ImportError:
            self.skipTest("matplotlib is not installed")
        with tempfile.TemporaryDirectory() as folder:
            picture = os.path.join(folder, "live.png")
            command = [sys.executable, str(EXAMPLES / "python" / "live_plot.py"), self.session.name, "--save", picture]
            out = subprocess.run(command, capture_output=True, text=True, timeout=90)
            self.assertEqual(out.returncode, 0, out.stderr)
            missed, away_s = re.search(r"samples shown, (\d+) missed, at most ([0-9.]+) s between two reads", out.stdout).groups()
            (held,) = [each.capacity for each in self.session.topics() if each.topic == "haptic0.telemetry"]
            if float(away_s) > 1e-3 * held - 0.1:
                self.skipTest(f"this machine kept the reader away for {away_s} s, and the ring holds {held} ms")
            self.assertEqual(int(missed), 0, out.stdout)
            self.assertGreater(os.path.getsize(picture), 5000)


if __name__ == "__main__":
    unittest.main()
