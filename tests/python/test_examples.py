"""The examples that people start from, run as they are."""

import concurrent.futures
import os
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

EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "examples"
CONFIG = EXAMPLES.parents[1] / "config"
BUILT = Path(find_program()).parent
HAND = {"haptic.0.device.hand.start_s": 4.0,  # an engine in Python has begun by then, also on a busy machine
        "haptic.0.device.hand.speed_m_s": 0.05}


def push(session_file, settings, reach_m=0.02):
    """Runs a session in which the hand pushes, until it has got so far along −z.

    Returns the largest force, the mean of the force along z over the last half of the way [N], and the report.
    """
    session = rtbus.run(str(session_file), set={**HAND, **settings}, timeout=60)
    try:
        blocks, reached, end = [], 0.0, time.monotonic() + 40
        with session.open("haptic0.telemetry", from_oldest=True) as topic:
            while reached < reach_m:
                if time.monotonic() > end:
                    raise AssertionError(f"the hand got {reached} m far:\n{session.log}")
                topic.wait(0.1)
                block = topic.read(4096)
                blocks.append(block)
                reached = max(reached, -float(block["position_m"][:, 2].min(initial=0.0)))
        ticks = np.concatenate(blocks)
        slides = ticks["force_n"][ticks["position_m"][:, 2] < -0.5 * reach_m, 2]
        return float(np.abs(ticks["force_n"]).max()), float(slides.mean()), session.end()
    finally:
        session.end()
        session._log.close()


def push_all(*sessions):
    """Several at once: they mostly wait."""
    with concurrent.futures.ThreadPoolExecutor() as pool:
        return [each.result() for each in [pool.submit(push, *session) for session in sessions]]


class Examples(unittest.TestCase):
    def test_the_wall_stands_in_the_readme_and_is_short(self):
        wall = (EXAMPLES / "python" / "python_wall.py").read_text()
        self.assertLessEqual(len(wall.splitlines()), 40)
        for page in ("README.md", "docs/your-own-physics.md"):
            self.assertIn(wall, (EXAMPLES.parents[1] / page).read_text(), page)

    def test_own_engine_is_pushed_with_both_methods(self):
        methods = ("local_contact", "remote_virtual_coupling")
        command = f"[{BUILT / 'own_engine'}]"
        found = push_all(*((EXAMPLES / "own_engine.yaml", {"physics.command": command, "haptic.0.method": method})
                           for method in methods))
        for method, (largest, _, report) in zip(methods, found):
            print(f"own_engine, {method}: largest force {largest:.2f} N")
            self.assertEqual(report["faults"], [])
            self.assertEqual(report["restarts"], [])
            self.assertGreater(largest, 0.05)
            self.assertLess(largest, 5.0)

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
        found = push_all(*sessions)
        friction = 0.1 * 0.5 * 9.81  # of the sliding block [N]
        for (largest, slides, report), (file, *_) in zip(found, sessions):
            print(f"{file.name}: largest force {largest:.3f} N, sliding {slides:.3f} N, closed form {friction:.3f} N")
            self.assertEqual(report["faults"], [])
            self.assertEqual(report["restarts"], [])
            self.assertAlmostEqual(slides, friction, delta=0.15 * friction)
        self.assertAlmostEqual(found[0][0], found[1][0], delta=0.3)

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
            self.assertIn("samples shown, 0 missed", out.stdout)
            self.assertGreater(os.path.getsize(picture), 5000)


if __name__ == "__main__":
    unittest.main()
