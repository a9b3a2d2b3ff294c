"""Physics of the user's own: what the hand feels from it, and what it feels when it fails."""

import contextlib
import ctypes
import os
import re
import signal
import subprocess
import sys
import tempfile
import textwrap
import threading
import time
import unittest
from pathlib import Path

import numpy as np

import rtbus
from rtbus import _engine_library
from tests.python.machine import Machine

EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "examples"
WALL = str(EXAMPLES / "python" / "python_wall.yaml")
# A hand that leans on the wall for good: its force shows at once whether physics is there.
LEANS = """{type: push, impedance: firm, start_m: [0, 0.010, 0], direction: [0, -1, 0], distance_m: 0.015, speed_m_s: 0.05,
         start_s: 1.5}"""


ZERO, UP = (0, 0, 0), (0, 1, 0)
PATIENCE_S = 40  # a machine that builds something beside it


def session_file(folder, engine="external"):
    """python_wall.yaml with that hand."""
    text = Path(WALL).read_text().replace("{type: drop, position_m: [0, 0.020, 0], release_s: 3.0}", LEANS)
    if engine != "external":
        text = text.replace("engine: external", f"engine: {engine}").replace("  command:", "  # command:")
    path = os.path.join(folder, f"{engine}.yaml")
    Path(path).write_text(text)
    return path


def engine_file(folder, body):
    """python_wall.py with `body` run at the top of each step."""
    lines = (EXAMPLES / "python" / "python_wall.py").read_text().splitlines()
    at = next(i for i, line in enumerate(lines) if "for step in engine" in line)
    lines[at + 1 : at + 1] = textwrap.indent(textwrap.dedent(body), " " * 8).splitlines()
    lines[1:1] = ["import gc, os, signal, sys, time"]
    path = os.path.join(folder, "engine.py")
    Path(path).write_text("\n".join(lines))
    return path


def python(path):
    return {"physics.command": f"[{sys.executable}, {path}]"}


class Follow:
    """Force on the hand, tick by tick."""

    def __init__(self, session):
        self.topic = session.open("haptic0.telemetry")
        self.window = np.zeros(0, self.topic.dtype)

    def force(self, ticks=300):
        """Vertical force [N] over the next ticks."""
        self._take(ticks)
        return self.window["force_n"][:, 1]

    def until(self, holds, ticks=20):
        """Follows the force until it holds over so many ticks; (whether it did, the largest force met on the way).

        The windows have that length however late this process reads. `window` is the last one.
        """
        end, largest, kept = time.monotonic() + PATIENCE_S, 0.0, self.window[:0]
        step = max(1, ticks // 4)
        while time.monotonic() < end:
            self._take(step)
            kept = np.concatenate([kept, self.window])[-ticks:]
            largest = max(largest, float(np.abs(self.window["force_n"][:, 1]).max(initial=0.0)))
            if len(kept) == ticks and holds(kept["force_n"][:, 1]):
                self.window = kept
                return True, largest
        return False, largest

    def _take(self, ticks):
        parts, end = [self.window[:0]], time.monotonic() + PATIENCE_S
        while (left := ticks - sum(map(len, parts))) > 0 and time.monotonic() < end:
            self.topic.wait(0.1)
            parts.append(self.topic.read(left))
        self.window = np.concatenate(parts)


def gone(force):
    return bool(np.all(np.abs(force) < 0.01))


def leans(force):
    return float(np.median(force)) > 0.5


def leans_a_little(force):
    return float(np.median(force)) > 0.3


def leans_all_the_time(force):
    return float(force.min()) > 0.1


def rests(force):
    return leans(force) and float(np.ptp(force)) < 0.02


class Engine(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.machine = Machine()
        self.machine.__enter__()
        self.addCleanup(self.machine.__exit__)

    def run_wall(self, **options):
        options["set"] = {**python(EXAMPLES / "python" / "python_wall.py"), **options.get("set", {})}
        session = rtbus.run(session_file(self.folder.name), timeout=60, **options)
        self.addCleanup(session._log.close)
        self.addCleanup(session.end)
        return session

    def expect(self, held, said, session):
        """Where it did not hold: a machine that stood in the way is told from a defect."""
        if not held:
            session.end()
        self.machine.judge(held, f"{said}:\n{session.log}")

    def wait_until_it_leans(self, session):
        self.expect(Follow(session).until(leans, 300)[0], "the hand never felt the wall", session)


class Feels(Engine):
    def rest(self, method):
        """A session whose hand comes to rest on the wall: what it felt there."""
        session = self.run_wall(set={"haptic.0.method": method, "haptic.0.device.hand.start_s": 2.0})
        with session.open("haptic0.telemetry", from_oldest=True) as topic:
            topic.wait(PATIENCE_S)
            free = topic.latest()["position_m"][1] > 0.006  # above the wall while the engine runs already
        follow = Follow(session)
        self.expect(follow.until(rests, 500)[0], f"{method}: the hand never came to rest on the wall", session)
        with session.open("physics.proxy_state.haptic0") as topic:
            topic.wait(PATIENCE_S)
            tool = topic.latest()["position_m"][1]
        return free, tool, follow.window, session.end()

    def test_both_methods_rest_on_the_wall_with_the_force_of_their_spring(self):
        for method in ("remote_virtual_coupling", "local_contact"):
            with self.subTest(method=method):
                free, tool, block, report = self.rest(method)
                self.assertGreater(tool, 0.0049)
                proxy, hand = np.median(block["proxy_position_m"][:, 1]), np.median(block["position_m"][:, 1])
                force = float(np.median(block["force_n"][:, 1]))
                print(f"{method}: free {free}, proxy at {1e3 * proxy:.3f} mm, hand at {1e3 * hand:.3f} mm, force {force:.3f} N")
                self.assertEqual(report["physics"]["engine"], "external")
                self.assertEqual(report["faults"], [])
                self.assertAlmostEqual(proxy, 0.005, delta=5e-5)  # the ball of 5 mm lies on the wall
                self.assertGreater(force, 0.5)
                spring = 200 * (proxy - hand)
                self.assertLess(force, 0.05 + 1.1 * spring)
                if free:  # else passivity lets the force grow slowly
                    self.assertGreater(force, 0.9 * spring - 0.05)


# What the engine of the next test does when a file names it.
FAULTS = """
if step.index % 10 == 0 and os.path.exists(TRIGGER):
    fault = open(TRIGGER).read()
    os.remove(TRIGGER)
    if fault == "raises":
        raise RuntimeError("my world broke")
    if fault == "tells NaN":
        step.hands[0].move((0, float("nan"), 0), (0, 0, 0))
    if fault == "stalls":
        time.sleep(0.6)
    if fault in ("forks, prints, collects", "forks and is killed") and os.fork() == 0:
        time.sleep(20 if "killed" in fault else 3)
        os._exit(0)
    if fault == "forks and is killed":
        os.kill(os.getpid(), signal.SIGKILL)
    if fault == "forks, prints, collects":
        for _ in range(300):
            print("x" * 1000)
        gc.collect()
"""


class Stranger(threading.Thread):
    """Writes the topics of physics itself: its tool is 5 mm above the hand's, so the hand feels 1 N if it believes that."""

    LAG_NS = {"two seconds late": 2 * 10**9, "0.3 s late": 3 * 10**8}

    def __init__(self, session):
        super().__init__()
        self.session, self.mode, self.refused, self._ended = session, "good", "", threading.Event()

    def end(self):
        self._ended.set()

    def publisher(self, topic, kind):
        return rtbus.publisher(topic, kind, self.session)

    def run(self):
        with contextlib.ExitStack() as stack:
            own = {topic: stack.enter_context(self.publisher(f"physics.{topic}", f"rtbus/{kind}"))
                   for topic, kind in (("heartbeat", "Heartbeat"), ("step_stats", "StepStats"), ("node_info", "NodeInfo"))}
            own["node_info"].publish(role=b"physics", kind=b"a stranger")
            own["step_stats"].publish(steps=1)
            tool, device, step = None, None, 0
            while not self._ended.wait(0.005):
                step += 1
                own["heartbeat"].publish(beats=step, state=1, pid=os.getpid(), work_period_ns=5_000_000,
                                         last_work_ns=rtbus.now_ns())
                with contextlib.suppress(rtbus.NotFound):
                    device = device or stack.enter_context(rtbus.open("haptic0.device_state", self.session, presence=False))
                hand = device.latest() if device else None
                if hand is None:
                    continue
                if self.mode == "another layout":
                    if tool:
                        tool.close()
                        with self.publisher("physics.proxy_state.haptic0", [("position_m", "f8", 3)]) as other:
                            while self.mode == "another layout" and not self._ended.wait(0.005):
                                other.publish(position_m=hand["target_position_m"] + [0, 0.005, 0])
                                own["heartbeat"].publish(beats=step, state=1, pid=os.getpid(), work_period_ns=5_000_000,
                                                         last_work_ns=rtbus.now_ns())
                        tool = None
                    continue
                tool = tool or self.publisher("physics.proxy_state.haptic0", "rtbus/ProxyState")
                try:
                    tool.publish(
                        position_m=hand["target_position_m"] + [0, 0.005, 0], orientation_wxyz=(1, 0, 0, 0), step_s=0.005,
                        step_index=step, device_sequence=step, mapping_epoch=hand["mapping_epoch"],
                        device_time_ns={"past": 1, "future": rtbus.now_ns() + 10**9}.get(  # past: before the hand was there
                            self.mode, int(hand["sample_time_ns"]) - self.LAG_NS.get(self.mode, 0)))
                except rtbus.UnfitValue as error:
                    self.refused = str(error)
            if tool:
                tool.close()


class Fails(Engine):
    def fire(self, fault):
        Path(self.trigger + ".new").write_text(fault)
        os.rename(self.trigger + ".new", self.trigger)

    def fades_and_returns(self, session, name, fire):
        follow = Follow(session)
        resting = float(np.median(follow.force()))
        fire()
        faded, before = follow.until(gone)
        if name == "is stopped in a debugger":
            os.kill(self.engine_pid(session), signal.SIGCONT)
        self.assertTrue(faded, f"the force never faded:\n{session.log}")
        returned, after = follow.until(leans, 200)
        self.expect(returned, "the force did not return", session)
        self.assertLess(max(before, after), 2 * resting + 0.5)

    def engine_pid(self, session):
        (pid,) = [each.pid for each in session.nodes() if each.name == "physics"]
        return pid

    def test_the_hand_is_safe_from_each_fault_and_the_force_returns(self):
        self.trigger = os.path.join(self.folder.name, "trigger")
        path = engine_file(self.folder.name, FAULTS.replace("TRIGGER", repr(self.trigger)))
        session = self.run_wall(set={**python(path), "supervise.first_delay_s": 0.1})
        self.wait_until_it_leans(session)
        for name in ("raises", "tells NaN", "stalls", "forks and is killed"):
            with self.subTest(engine=name):
                self.fades_and_returns(session, name, lambda name=name: self.fire(name))
        self.assertIn("my world broke", session.log)
        self.assertIn("hand haptic0: tool.position[1] = nan is not finite", session.log)
        name = "is stopped in a debugger"
        with self.subTest(engine=name):
            self.fades_and_returns(session, name, lambda: os.kill(self.engine_pid(session), signal.SIGSTOP))

        with self.subTest(engine="forks, prints, collects"):  # nothing is felt of it
            self.fire("forks, prints, collects")
            while os.path.exists(self.trigger):
                time.sleep(0.05)
            self.expect(Follow(session).until(leans, 500)[0], "something was felt of it", session)

        with self.subTest(engine="a second one"):
            command = [sys.executable, str(EXAMPLES / "python" / "python_wall.py")]
            environment = {**os.environ, "RTBUS_ENGINE_CONFIG": WALL, "RTBUS_ENGINE_SET": f"session={session.name}"}
            second = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)
            self.assertNotEqual(second.returncode, 0)
            self.assertIn("a live writer holds this topic", second.stderr)
            self.expect(Follow(session).until(leans, 200)[0], "the first engine is not felt any more", session)
        report = session.end()
        self.assertEqual(len(report["restarts"]), 3)  # raised, NaN, killed: not for stalls, forks or prints

    def test_asking_for_what_it_does_not_give_is_said(self):
        path = engine_file(self.folder.name, "")
        text = Path(path).read_text().replace("gives_bodies=True, ", "")
        Path(path).write_text(text)
        with self.assertRaisesRegex(RuntimeError, "this engine gives the tool only; write method: remote_virtual_coupl"):
            session = self.run_wall(set={**python(path), "haptic.0.method": "local_contact"})
            session.wait(60)
            raise RuntimeError(session.log)

    def test_answers_to_the_future_or_the_past_and_other_layouts_are_not_felt(self):
        name = f"py-{os.getpid()}-raw"
        path = session_file(self.folder.name)
        Path(path).write_text(Path(path).read_text().replace("  command:", "  # command:"))
        stranger = Stranger(name)
        stranger.start()
        self.addCleanup(stranger.join)
        self.addCleanup(stranger.end)
        # The hand moves against the force once: at the first start nothing fills the spring of one that only rests
        # (decision 0016), except where the machine paused just then.
        session = rtbus.run(path, name=name, timeout=60, set={"haptic.0.device.hand.start_s": 3})
        self.addCleanup(session._log.close)
        self.addCleanup(session.end)
        follow = Follow(session)
        for mode in ("past", "future", "another layout"):
            stranger.mode = "good"
            self.expect(follow.until(leans_a_little, 100)[0], "not so: a good answer is felt", session)
            stranger.mode = mode
            self.assertTrue(follow.until(gone, 100)[0], mode)
            self.assertTrue(gone(follow.force(500)), mode)
        self.assertRegex(stranger.refused, "device_time_ns lies .* in the future")
        self.assertNotIn("hand of long ago", session.log)

        # Published just now, each of them, and with the right epoch: but to where the hand was.
        stranger.mode = "0.3 s late"
        self.expect(follow.until(leans_a_little, 100)[0], "not so: a delay is felt", session)
        # Only forces that have been on for longer than 2 s can come from so late an answer. A loss that a busy machine
        # causes in between begins that time anew.
        for _ in range(5):
            stranger.mode = "good"
            self.expect(follow.until(leans_all_the_time, 2500)[0], "no force that lasts for 2.5 s", session)
            stranger.mode = "two seconds late"
            self.assertTrue(follow.until(gone, 100)[0], session.log)
            self.assertTrue(gone(follow.force(500)))
            if "hand of long ago" in session.log:
                break
        self.expect("physics answers a hand of long ago: device_time_ns" in session.log, "an answer to 2 s ago was not told", session)
        stranger.mode = "good"
        self.expect(follow.until(leans_a_little, 100)[0], "not so: the force returns", session)

    def test_wrong_arguments_name_the_field(self):
        with rtbus.Engine(WALL, set={"session": f"py-{os.getpid()}-args"}, gives_bodies=True, bodies=2) as engine:
            hand = engine.hands[0]
            self.assertEqual((hand.name, hand.radius, hand.mass, hand.away), ("haptic0", 0.005, 0.1, True))
            refused = {  # by the names that Python has for them
                r"^position takes 3 numbers.*shape \(2,\)": lambda: hand.move((0, 0), ZERO),
                "^position takes 3 numbers.*array of <U1": lambda: hand.move(("a", "b", "c"), ZERO),
                "^velocity takes 3 numbers.*complex128": lambda: hand.move(ZERO, np.zeros(3, complex)),
                "^orientation takes 4 numbers": lambda: hand.move(ZERO, ZERO, orientation=ZERO),
                r"^hand haptic0: tool.spring_force\[1\] = nan is not finite": lambda: hand.move(
                    ZERO, ZERO, spring_force=(0, float("nan"), 0)),
                "^contact: body = 2 does not exist; this session has 2": lambda: hand.contact(2, ZERO, UP, 0.0),
                "^contact: body = -1 does not exist; this session has 2": lambda: hand.contact(-1, ZERO, UP, 0.0),
                "^contact: body takes a whole number, and got 1.5": lambda: hand.contact(1.5, ZERO, UP, 0.0),
                "^contact: normal has the length 2": lambda: hand.contact(1, ZERO, (0, 2, 0), 0.0),
                "^contact: gap = nan is not finite": lambda: hand.contact(1, ZERO, UP, float("nan")),
                "^gap takes a number, and got 'near'": lambda: hand.contact(1, ZERO, UP, "near"),
                "^contact: friction = -0.5.* is negative": lambda: hand.contact(1, ZERO, UP, 0.0, friction=-0.5),
                "^body 0: a dynamic body needs a mass and three inertia": lambda: engine.body(0, ZERO, kind="dynamic"),
                "^body 1: mass = -1.* is negative": lambda: engine.body(1, ZERO, mass=-1.0),
                "^mass takes a number, and got None": lambda: engine.body(1, ZERO, mass=None),
                "^body 1: friction_bound = -1.* is negative": lambda: engine.body(1, ZERO, friction_bound=-1.0),
                r"^body 1: torque\[2\] = inf is not finite": lambda: engine.body(1, ZERO, torque=(0, 0, float("inf"))),
                r"^body 1: friction_force\[0\] = nan": lambda: engine.body(1, ZERO, friction_force=(float("nan"), 0, 0)),
                "^body = -1 does not exist; this session has 2": lambda: engine.body(-1, ZERO),
                "^kind = 'liquid' is unknown": lambda: engine.body(0, ZERO, kind="liquid"),
                "^size of a capsule takes 2 numbers": lambda: engine.shape(0, "capsule", 0.1),
                r"^shape: size\[1\] must be above 0": lambda: engine.shape(0, "capsule", (0.1, 0)),
                "^shape: body = 7 does not exist": lambda: engine.shape(7, "plane"),
                "^support: friction = -0.5.* is negative": lambda: engine.support(0, ZERO, UP, 1.0, friction=-0.5),
                "^support: force must be above 0": lambda: engine.support(0, ZERO, UP, 0.0),
                "^support: inverse_mass = -1.* is negative": lambda: engine.support(0, ZERO, UP, 1.0, inverse_mass=-1.0),
                "^support: body = 2 does not exist": lambda: engine.support(2, ZERO, UP, 1.0),
            }
            for step in engine:
                hand = step.hands[0]
                for said, call in refused.items():
                    with self.subTest(said=said), self.assertRaisesRegex((ValueError, TypeError), said):
                        call()
                hand.move(ZERO, ZERO)
                break
            with self.assertRaisesRegex(rtbus.AlreadyOwned, "a live writer holds this topic"):
                rtbus.Engine(WALL, set={"session": engine.session})

    def test_the_structures_are_those_of_the_header(self):
        pinned = (EXAMPLES.parents[1] / "tests" / "unit" / "c_api" / "engine_abi_layout.c").read_text()
        structs = {f"rtbus_engine_{name.lower()}": kind for name, kind in vars(_engine_library).items()
                   if isinstance(kind, type) and issubclass(kind, ctypes.Structure)}
        sizes = dict(re.findall(r"BYTES\((\w+), (\d+)\)", pinned))
        self.assertEqual({name: str(ctypes.sizeof(kind)) for name, kind in structs.items()}, sizes)
        for name, member, at in re.findall(r"PINNED\((\w+), (\w+), (\d+)\)", pinned):
            self.assertEqual(getattr(structs[name], member).offset, int(at), f"{name}.{member}")

    def test_shapes_are_told_once_per_change_with_a_hash(self):
        session, seen = f"py-{os.getpid()}-shapes", []
        with rtbus.Engine(WALL, set={"session": session}, gives_bodies=True, bodies=70) as engine:
            for step in engine:
                for hand in step.hands:
                    if hand.spring:
                        hand.move(hand.target, (0, 0, 0))
                if step.index in (1, 30):
                    engine.clear_shapes()
                    engine.body(1, (0, 1, 0), kind="dynamic", mass=1, inertia=(1, 1, 1))
                    for body in range(70):
                        engine.shape(body, "box", (0.1, 0.2, 0.01 * step.index))
                    engine.shape(1, "sphere", 0.3, position=(0, 1, 0))
                if step.index == 60:
                    break
            with rtbus.open("physics.body_shapes", session, from_oldest=True) as topic:
                seen = topic.read(100)
        self.assertEqual(list(seen["first_shape"]), [0, 64, 0, 64])  # two tables of 71 shapes
        self.assertEqual(list(seen["count"]), [64, 7, 64, 7])
        self.assertEqual(seen["hash"][0], seen["hash"][1])
        self.assertNotEqual(seen["hash"][0], seen["hash"][2])
        self.assertGreater(seen["epoch"][2], seen["epoch"][0])
        self.assertEqual(list(seen["body_kind"][0][:3]), [0, 2, 0])
        self.assertEqual((seen["body"][1][6], seen["shape"][1][6], seen["bodies"][1]), (1, 2, 70))
        np.testing.assert_allclose(seen["size_m"][0][5], (0.1, 0.2, 0.01))


if __name__ == "__main__":
    unittest.main()
