"""A session from Python: started, followed, recorded, ended."""

import gc
import os
import subprocess
import tempfile
import time
import unittest
from pathlib import Path

import numpy as np

import rtbus
from rtbus.session import find_program


class WallSession(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.session = rtbus.run("config/wall.yaml", set={"haptic.0.realtime.priority": 40}, timeout=60)
        cls.addClassCleanup(cls.session._log.close)

    @classmethod
    def tearDownClass(cls):
        cls.session.end()

    def test_nodes_are_seen(self):
        found = {each.name: each for each in self.session.nodes()}
        self.assertEqual(set(found), {"physics", "haptic0"})
        self.assertEqual(found["haptic0"].state, "running")
        self.assertTrue(found["haptic0"].alive)

    def test_telemetry_is_followed_without_loss_and_cheaply(self):
        with self.session.open("haptic0.telemetry") as topic:
            self.assertEqual(topic.units["force_n"], "N")
            topic.wait(5)
            used, count, last = time.thread_time(), 0, None
            for sample in topic.follow(timeout=5.0):
                if last is not None and topic.missed == 0:
                    self.assertEqual(sample["tick"], last + 1)
                last = sample["tick"]
                count += 1
                if count == 3000:
                    break
            share = (time.thread_time() - used) / (1e-3 * count)  # of the time in which so many come
            print(f"follow(): {count} samples at {100 * share:.1f} % of a core, {topic.missed} missed")
            self.assertEqual(count, 3000)
            (held,) = [each.capacity for each in self.session.topics() if each.topic == topic.name]
            if topic.longest_away > 1e-3 * held - 0.1:
                self.skipTest(f"this machine kept the reader away for {topic.longest_away} s, and the ring holds {held} ms")
            self.assertEqual(topic.missed, 0)
            self.assertLess(share, 0.15)  # 4 % on a quiet machine (docs/python.md)

    def test_a_recording_comes_back_as_arrays(self):
        if "record" not in subprocess.run([find_program(), "--help"], capture_output=True, text=True).stdout:
            self.skipTest("built without HDF5")
        try:
            import h5py  # noqa: F401
        except ImportError:
            self.skipTest("h5py is not installed")
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "trial.h5")
            subprocess.run(
                [find_program(), "record", path, "--session", self.session.name, "--duration", "1"],
                check=True, capture_output=True,
            )
            with rtbus.Recording(path) as recording:
                self.assertEqual(recording.session, self.session.name)
                samples = recording["haptic0.telemetry"]
                self.assertTrue(np.all(np.diff(samples["sequence"].astype(np.int64)) == 1))  # nothing is lost
                self.assertGreater(1e-9 * float(samples["stamp_ns"][-1] - samples["stamp_ns"][0]), 0.5)
                self.assertEqual(samples["force_n"].shape, (len(samples), 3))
                self.assertEqual(rtbus.units(samples)["force_n"], "N")
                self.assertTrue(np.all(np.diff(samples["tick"].astype(np.int64)) > 0))
                with self.assertRaisesRegex(KeyError, "no topic 'x'"):
                    recording["x"]


class Orders(unittest.TestCase):
    def test_a_session_is_stopped_rearmed_and_adjusted(self):
        with rtbus.run("config/wall.yaml", timeout=60,
                       set={"haptic.0.adjustable": "[coupling.stiffness_n_per_m]"}) as session:
            key = "haptic0.coupling.stiffness_n_per_m"
            self.assertFalse(session.orders()["estop"])
            session.estop('he said "stop"')
            self.assertTrue(session.orders()["estop"])
            self.assertEqual(session.orders()["reason"], 'he said "stop"')
            with session.open("haptic0.telemetry") as topic:
                end = time.monotonic() + 20
                while not topic.wait(1) or np.any(topic.latest()["force_n"]):
                    self.assertLess(time.monotonic(), end, "the force stays")
            session.rearm()
            self.assertFalse(session.orders()["estop"])
            session.adjust(key, 150)
            (gain,) = [each for each in session.orders()["adjustable"] if each["key"] == key]
            self.assertEqual(gain["value"], 150)
            with self.assertRaises(rtbus.OrderRefused):
                session.adjust(key, 1e6)
            with self.assertRaises(rtbus.OrderRefused):
                session.adjust("haptic0.coupling.damping_n_s_per_m", 1)
            with self.assertRaises(ValueError):
                session.adjust(key, float("nan"))
        with self.assertRaisesRegex(rtbus.NotFound, "takes no orders"):
            rtbus.estop(session.name)


class Starting(unittest.TestCase):
    def test_a_session_that_cannot_start_says_why(self):
        with self.assertRaisesRegex(RuntimeError, "no session file nothing_like_it"):
            rtbus.run("nothing_like_it", timeout=60)

    def test_a_session_ends_with_its_report(self):
        session = rtbus.run("config/wall.yaml", duration=1.0, timeout=60)
        self.assertEqual(session.wait(90), 0, session.log)
        report = session.end()
        self.assertEqual(report["haptic"][0]["name"], "haptic0")
        self.assertFalse(rtbus.topics(session.name))
        session._log.close()
        folder = Path(session._report_file).parent
        self.assertTrue(folder.exists())
        del session
        gc.collect()  # errors while it started keep frames that know it
        self.assertFalse(folder.exists(), "its files went with it")


if __name__ == "__main__":
    unittest.main()
