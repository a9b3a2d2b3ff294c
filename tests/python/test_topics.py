"""Topics from Python, without a session."""

import gc
import multiprocessing
import os
import signal
import threading
import time
import unittest

import numpy as np

import rtbus

POINT = [("number", "u8"), ("position_m", "f8", 3)]


def scratch() -> str:
    scratch.count += 1
    return f"py-{os.getpid()}-{scratch.count}"


scratch.count = 0


def publish_and_wait(session, first):
    with rtbus.publisher("points", POINT, session) as writer:
        writer.publish(number=first)
        time.sleep(60)


class Types(unittest.TestCase):
    def test_known_types_have_their_shapes_and_units(self):
        poses = rtbus.known_type("rtbus/BodyPoses")
        self.assertEqual(poses.dtype["position_m"].shape, (64, 3))
        self.assertEqual(poses.dtype["orientation_wxyz"].shape, (64, 4))
        self.assertEqual(poses.units["simulated_s"], "s")
        self.assertEqual(rtbus.known_type("rtbus/NodeInfo").dtype["role"], np.dtype("S16"))
        for name in rtbus.known_types():
            self.assertEqual(rtbus.known_type(name).name, name)
        with self.assertRaisesRegex(rtbus.NotFound, "rtbus/Nothing"):
            rtbus.known_type("rtbus/Nothing")

    def test_a_dtype_survives_the_way_to_the_bus_and_back(self):
        dtype = np.dtype([("a", "f8", (2, 3)), ("b", "u4", 4), ("c", "i4"), ("d", "u1", 4), ("e", "S8"), ("f", "S4", 2)])
        session = scratch()
        with rtbus.publisher("all", dtype, session, units={"a": "N"}) as writer, rtbus.open("all", session) as topic:
            self.assertEqual(topic.dtype, dtype)
            self.assertEqual(topic.units["a"], "N")
            writer.publish(a=np.arange(6).reshape(2, 3), e=b"hello", f=[b"x", b"yz"])
            sample = topic.latest()
            self.assertEqual(sample["a"][1, 2], 5.0)
            self.assertEqual(sample["e"].item(), b"hello")
            self.assertEqual(rtbus.units(sample)["a"], "N")

    def test_what_the_bus_cannot_carry_is_refused_by_the_fields_name(self):
        for dtype, said in (
            ([("x", "f4", 2)], "'x' is float32"),
            ([("x", ">f8")], "'x' is >f8"),
            (np.dtype("f8"), "structured dtype"),
            ([("x", "u4")], "multiple of 8"),
            (np.dtype({"names": ["x", "y"], "formats": ["u4", "f8"], "offsets": [0, 8]}), "'y' begins at byte 8"),
        ):
            with self.assertRaisesRegex((TypeError, ValueError), said):
                rtbus.publisher("bad", dtype, scratch())
        with self.assertRaisesRegex(ValueError, "no field 'z'"):
            rtbus.publisher("bad", POINT, scratch(), units={"z": "m"})


class Reading(unittest.TestCase):
    def setUp(self):
        self.session = scratch()
        self.writer = rtbus.publisher("points", POINT, self.session, units={"position_m": "m"}, capacity=1024)
        self.addCleanup(self.writer.close)

    def test_latest_is_a_copy_that_stays(self):
        with rtbus.open("points", self.session) as topic:
            self.assertIsNone(topic.latest())
            before_ns = time.monotonic_ns()
            self.writer.publish(number=1, position_m=(1, 2, 3))
            after_ns = time.monotonic_ns()
            first = topic.latest()
            self.assertTrue(before_ns <= topic.stamp_ns <= after_ns)
            self.writer.publish(number=2)
            self.assertEqual(topic.latest()["number"], 2)
            self.assertEqual(topic.sequence, 2)
        gc.collect()
        self.assertEqual(first["number"], 1)
        self.assertEqual(list(first["position_m"]), [1, 2, 3])
        with self.assertRaises(rtbus.Ended):
            topic.latest()

    def test_blocks_bring_everything_in_order(self):
        with rtbus.open("points", self.session) as topic:

            def publish():
                for i in range(1000):
                    self.writer.publish(number=i)
                    time.sleep(0.0001)

            thread = threading.Thread(target=publish)
            thread.start()
            numbers = []
            for block in topic.blocks(timeout=20):
                numbers += list(block["number"])
                if numbers[-1] == 999:
                    break
            thread.join()
            self.assertEqual(topic.missed, 0)
            self.assertEqual(numbers, list(range(1000)))

    def test_latest_is_the_newest_also_after_a_read(self):
        with rtbus.open("points", self.session) as topic:
            for i in range(3):
                self.writer.publish(number=i)
            self.assertEqual(len(topic.read()), 3)
            self.assertEqual(topic.latest()["number"], 2)
            self.assertEqual(topic.sequence, 3)
            self.writer.publish(number=3)
            self.assertEqual(topic.latest()["number"], 3)

    def test_a_slow_reader_knows_what_it_missed(self):
        with rtbus.open("points", self.session) as topic:
            for i in range(3000):
                self.writer.publish(number=i)
            block = topic.read()
            self.assertGreater(topic.missed, 1000)
            self.assertEqual(len(block) + topic.missed, 3000)
            self.assertEqual(block["number"][-1], 2999)

    def test_waiting_leaves_python_to_other_threads(self):
        turns = [0]

        def count():
            while not done.is_set():
                turns[0] += 1
                time.sleep(0.001)

        done = threading.Event()
        thread = threading.Thread(target=count)
        thread.start()
        during = []
        with rtbus.open("points", self.session) as topic:
            for _ in range(3):  # the machine may pause in one
                began, before = time.monotonic(), turns[0]
                self.assertFalse(topic.wait(0.1))
                during.append(turns[0] - before)
                self.assertGreaterEqual(time.monotonic() - began, 0.1)
        done.set()
        thread.join()
        self.assertGreater(max(during), 3)  # holding the interpreter would allow one each

    def test_a_writer_that_dies_and_returns_is_followed(self):
        session = scratch()
        context = multiprocessing.get_context("spawn")
        child = context.Process(target=publish_and_wait, args=(session, 1))
        child.start()
        with rtbus.open("points", session, from_oldest=True, timeout=20) as topic:
            self.assertTrue(topic.wait(30))
            self.assertEqual(topic.read()["number"][0], 1)
            os.kill(child.pid, signal.SIGKILL)
            child.join()
            self.assertFalse(topic.alive)
            with rtbus.publisher("points", POINT, session) as writer:
                writer.publish(number=2)
                self.assertTrue(topic.wait(20))
                self.assertEqual(list(topic.read()["number"]), [2])

    def test_another_layout_is_told(self):
        with rtbus.open("points", self.session) as topic:
            self.writer.close()
            with rtbus.publisher("points", [("other", "u8")], self.session):
                with self.assertRaisesRegex(rtbus.LayoutMismatch, "open the topic again"):
                    topic.wait(1)

    def test_presence_is_seen(self):
        self.assertFalse(self.writer.observed)
        with rtbus.open("points", self.session):
            self.assertTrue(self.writer.observed)
        self.assertFalse(self.writer.observed)

    def test_a_forked_child_leaves_the_topic_alone(self):
        pid = os.fork()
        if pid == 0:
            self.writer.close()
            os._exit(0)
        os.waitpid(pid, 0)
        with rtbus.open("points", self.session) as topic:
            self.writer.publish(number=5)
            self.assertEqual(topic.latest()["number"], 5)

    def test_lists_and_says_what_is_missing(self):
        (found,) = rtbus.topics(self.session)
        self.assertEqual((found.topic, found.type, found.alive), ("points", "user/points", True))
        self.assertIn(self.session, rtbus.sessions())
        with self.assertRaisesRegex(rtbus.NotFound, "topic nothing"):
            rtbus.open("nothing", self.session)
        with self.assertRaises(ValueError):
            rtbus.open("points", "No Name")


class Publishing(unittest.TestCase):
    def test_wrong_values_name_their_field(self):
        with rtbus.publisher("proxy", "rtbus/ProxyState", scratch()) as writer:
            with self.assertRaisesRegex(rtbus.UnfitValue, r"velocity_m_s\[2\] is not finite"):
                writer.publish(velocity_m_s=(0, 0, float("nan")))
            writer.publish(velocity_m_s=(0, 0, 0))  # the writer's sample keeps what was set
            with self.assertRaisesRegex(ValueError, "'position_m'.*takes"):
                writer.publish(position_m=(1, 2))
            with self.assertRaisesRegex(TypeError, "'velocity_m_s' .* is float64, and got an array of complex128"):
                writer.publish(velocity_m_s=np.zeros(3, complex))
            with self.assertRaisesRegex(TypeError, "'position_m' .* is float64, and got an array of <U1"):
                writer.publish(position_m=("a", "b", "c"))
            with self.assertRaisesRegex(TypeError, "'step_index' .* is uint64, and got an array of float64"):
                writer.publish(step_index=1.5)
            with self.assertRaisesRegex(ValueError, "'step_index' .* is uint64, from 0 to 18446744073709551615, and got -1"):
                writer.publish(step_index=-1)
            with self.assertRaisesRegex(rtbus.UnfitValue, "position_m.0. is impossible in a rtbus/ProxyState"):
                writer.publish(position_m=(1e30, 0, 0))
            writer.publish(position_m=(0, 0, 0), step_index=np.uint64((1 << 64) - 1 >> 20))
            with self.assertRaisesRegex(rtbus.UnfitValue, "device_time_ns lies .* in the future"):
                writer.publish(device_time_ns=rtbus.now_ns() + 10**9)
            writer.publish(device_time_ns=0)
            with self.assertRaisesRegex(rtbus.UnfitValue, "stamp_ns lies .* in the future"):
                writer.publish(stamp_ns=rtbus.now_ns() + 10**9)
            with self.assertRaisesRegex(TypeError, "no field 'positon_m'"):
                writer.publish(positon_m=(1, 2, 3))
            wrong = np.zeros((), [(n, writer.dtype[n] if n != "step_s" else "f4") for n in writer.dtype.names])
            with self.assertRaisesRegex(TypeError, "'step_s' differs"):
                writer.publish(wrong)
            with self.assertRaises(TypeError):
                writer.publish([1, 2, 3])

    def test_a_text_that_is_too_long_is_refused(self):
        with rtbus.publisher("info", "rtbus/NodeInfo", scratch()) as writer:
            writer.publish(role=b"physics", kind="mine")
            with self.assertRaisesRegex(ValueError, "'role' .* holds a text of 16 bytes"):
                writer.publish(role=b"a name that is too long")
            with self.assertRaisesRegex(TypeError, "'role' .* is .S16, and got an array of int64"):
                writer.publish(role=5)

    def test_two_writers_of_one_topic_are_refused(self):
        session = scratch()
        with rtbus.publisher("points", POINT, session):
            with self.assertRaisesRegex(rtbus.AlreadyOwned, "live writer"):
                rtbus.publisher("points", POINT, session)


if __name__ == "__main__":
    unittest.main()
