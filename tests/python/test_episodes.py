"""Recordings cut into episodes: from a file whose content is known."""

import os
import subprocess
import tempfile
import unittest

import numpy as np

try:
    import h5py
except ImportError:
    h5py = None

from rtbus import episodes
from rtbus.session import find_program

TICKS = 1000


def recording(path, marks, pressed=()):
    """A recording of one second at 1 kHz; a body at x = time, told 30 times a second."""
    tick = np.arange(TICKS)
    stamps = (10**9 + tick * 10**6).astype(np.uint64)
    with h5py.File(path, "w") as file:
        file.attrs.update({"schema": "rtbus-recording/1", "session": "test", "started_monotonic_ns": np.uint64(10**9)})
        group = file.create_group("topics/haptic0.telemetry")
        group.attrs["type"] = "rtbus/Telemetry"
        buttons = np.zeros(TICKS, np.uint32)
        for begin, end in pressed:
            buttons[begin:end] = 2
        columns = {"sequence": tick.astype(np.uint64) + 1, "stamp_ns": stamps, "buttons": buttons,
                   "proxy_age_ns": np.full(TICKS, 2_000_000, np.uint64)}
        for name in ("position_m", "velocity_m_s", "proxy_position_m", "proxy_velocity_m_s", "force_n", "rendered_force_n"):
            columns[name] = np.stack([tick * 1e-3, 0 * tick, 0 * tick], 1)
        for i, (name, values) in enumerate(columns.items()):
            group.create_dataset(name, data=values).attrs.update({"unit": "m", "offset": i})
        frames = np.arange(30)
        poses = file.create_group("topics/physics.body_poses")
        body = np.zeros((30, 64, 3))
        body[:, 0, 0] = frames / 30
        for i, (name, values) in enumerate({
            "sequence": frames.astype(np.uint64) + 1, "stamp_ns": (10**9 + frames * 33_333_333).astype(np.uint64),
            "frame": frames.astype(np.uint64) + 1, "first_body": np.zeros(30, np.uint32), "count": np.ones(30, np.uint32),
            "bodies": np.ones(30, np.uint32), "position_m": body.reshape(30, 192),
            "orientation_wxyz": np.tile([1.0, 0, 0, 0], (30, 64)),
        }.items()):
            poses.create_dataset(name, data=values).attrs["offset"] = i
        file.create_dataset("marks/stamp_ns", data=np.array([10**9 + at * 10**6 for at, _ in marks], np.uint64))
        file.create_dataset("marks/text", data=[text for _, text in marks], dtype=h5py.string_dtype())


@unittest.skipIf(h5py is None, "h5py is not installed")
class Episodes(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.source, self.target = (os.path.join(folder.name, name) for name in ("trial.h5", "demos.h5"))

    def test_marks_cut(self):
        recording(self.source, [(100, "reach"), (400, "push"), (900, "end")])
        self.assertEqual(episodes.export(self.source, self.target), 2)
        with h5py.File(self.target) as out:
            first, second = out["data/episode_0000"], out["data/episode_0001"]
            self.assertEqual((first.attrs["name"], first.attrs["num_samples"]), ("reach", 300))
            self.assertEqual((second.attrs["name"], second.attrs["num_samples"]), ("push", 500))
            self.assertEqual(second["time_s"][0], 0)
            self.assertAlmostEqual(second["time_s"][-1], 0.499)
            self.assertAlmostEqual(second["actions/position_m"][0, 0], 0.4)
            self.assertEqual(second["forces/force_n"].shape, (500, 3))
            self.assertEqual(second["ages/proxy_age_s"][0], 0.002)
            # What was known at that tick: never a later body, and its age says how old.
            x, age = second["observations/body_position_m"][:, 0, 0], second["ages/body_age_s"][:]
            now = 0.4 + second["time_s"][:]
            self.assertTrue(np.all(x <= now + 1e-6))
            np.testing.assert_allclose(now - age, x, atol=1e-6)

    def test_a_button_cuts(self):
        recording(self.source, [], pressed=[(50, 150), (700, 1000)])
        self.assertEqual(episodes.export(self.source, self.target, button=1), 2)
        with h5py.File(self.target) as out:
            self.assertEqual(out["data/episode_0000"].attrs["num_samples"], 100)
            self.assertEqual(out["data/episode_0001/actions/buttons"][0], 2)

    def test_rtbus_export_does_the_same(self):
        try:
            program = find_program()
        except FileNotFoundError as error:
            self.skipTest(str(error))
        if "  export " not in subprocess.run([program, "--help"], capture_output=True, text=True, timeout=90).stdout:
            self.skipTest("built without HDF5")
        recording(self.source, [(100, "reach"), (400, "push"), (900, "end")])
        # A virtual environment without our packages, which is the first in the PATH, is not asked.
        with tempfile.TemporaryDirectory() as folder:
            os.mkdir(os.path.join(folder, "bin"))
            os.symlink("/usr/bin/python3", os.path.join(folder, "bin", "python3"))
            with open(os.path.join(folder, "pyvenv.cfg"), "w") as file:
                file.write("home = /usr/bin\ninclude-system-site-packages = false\n")
            path = os.pathsep.join([os.path.join(folder, "bin"), os.environ["PATH"]])
            out = subprocess.run([program, "export", self.source, "--episodes", self.target], capture_output=True, text=True,
                                 timeout=90, env={**os.environ, "PATH": path})
        self.assertEqual(out.returncode, 0, out.stdout + out.stderr)
        self.assertIn("2 episodes written", out.stdout)
        with h5py.File(self.target) as file:
            self.assertEqual(len(file["data"]), 2)

    def test_nothing_to_cut_is_said(self):
        recording(self.source, [(100, "alone")])
        with self.assertRaisesRegex(ValueError, "fewer than two marks"):
            episodes.export(self.source, self.target)
        with self.assertRaisesRegex(ValueError, "never has button 0 held"):
            episodes.export(self.source, self.target, button=0)


if __name__ == "__main__":
    unittest.main()
