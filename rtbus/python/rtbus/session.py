"""Sessions: their nodes, and `rtbus run` from Python.

Threads: the functions may be called from any thread; orders wait for their answer, for a second at most, and other Python
threads run meanwhile. A Session belongs to one thread at a time.
"""

from __future__ import annotations

import ctypes
import json
import os
import shutil
import signal
import subprocess
import tempfile
import time
import weakref
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import IO, Any

from . import _library as _c
from .topics import Topic, TopicInfo, open, topics

_WITHOUT_PHYSICS = ("direct", "virtual_coupling")
_STATES = ("starting", "running", "stopping")
_REPORT = "report.json"


@dataclass(frozen=True)
class Node:
    """A node of a session, by its heartbeat. Ages are seconds; None: never."""

    name: str
    alive: bool
    state: str
    pid: int
    beat_age_s: float | None
    work_age_s: float | None


def nodes(session: str) -> list[Node]:
    """The nodes of a session. Raises NotFound when there is none."""
    entries = (_c.Node * 32)()
    count = _c.check(_c.lib.rtbus_session_nodes(session.encode(), entries, ctypes.sizeof(_c.Node), len(entries)))
    never = (1 << 64) - 1

    def age(ns: int) -> float | None:
        return None if ns == never else 1e-9 * ns

    return [
        Node(e.name.decode(), bool(e.alive), _STATES[e.state], e.pid, age(e.beat_age_ns), age(e.work_age_ns))
        for e in entries[: min(count, len(entries))]
    ]


def estop(session: str, reason: str = "") -> None:
    """Zero force in all haptic nodes of the session, held until :func:`rearm`.

    **No substitute for a switch in the supply of the device.** Raises NotFound when no `rtbus run` serves the session.
    """
    _c.check(_c.lib.rtbus_estop(session.encode(), reason.encode()))


def rearm(session: str) -> None:
    """Allows force again after an E-stop; it ramps up."""
    _c.check(_c.lib.rtbus_rearm(session.encode()))


def adjust(session: str, key: str, value: float) -> None:
    """Changes a gain that the session lists as adjustable: ``adjust("lab", "haptic0.coupling.stiffness_n_per_m", 250)``.

    Raises OrderRefused, which names the limit or the keys that may change.
    """
    _c.check(_c.lib.rtbus_adjust(session.encode(), key.encode(), value))


def mark(session: str, text: str) -> None:
    """Notes an event in the recordings under way."""
    _c.check(_c.lib.rtbus_mark(session.encode(), text.encode()))


def orders(session: str) -> dict[str, Any]:
    """State of the orders: E-stop, reason, and what is adjustable with its value and limit (docs/orders.md)."""
    answer = ctypes.create_string_buffer(4097)
    _c.check(_c.lib.rtbus_order(session.encode(), b'{"order":"state"}', answer, len(answer), 1.0))
    return json.loads(answer.value)


def find_program() -> str:
    """The program `rtbus`: $RTBUS_PROGRAM, or in the PATH, or in the source tree's build."""
    here = Path(__file__).resolve()
    candidates = [os.environ.get("RTBUS_PROGRAM"), shutil.which("rtbus")]
    if len(here.parents) > 3:
        candidates.append(str(here.parents[3] / "build" / "bin" / "rtbus"))
    for each in candidates:
        if each and os.access(each, os.X_OK):
            return each
    raise FileNotFoundError("the program rtbus is not in the PATH; install the package rtbus, or set RTBUS_PROGRAM")


class Session:
    """A session that :func:`run` started. Ends it when the block ends. One thread at a time.

    Its log and its report are files in a temporary folder, which goes when this object is collected, at the latest at exit.
    """

    def __init__(self, process: subprocess.Popen[bytes], name: str, folder: str, log: IO[str]) -> None:
        self.name, self._process, self._log = name, process, log
        self._report_file = os.path.join(folder, _REPORT)
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)

    def open(self, topic: str, **options: Any) -> Topic:
        """As :func:`rtbus.open`, in this session."""
        return open(topic, self.name, **options)

    def topics(self) -> list[TopicInfo]:
        """Its topics."""
        return topics(self.name)

    def nodes(self) -> list[Node]:
        """Its nodes."""
        return nodes(self.name)

    def estop(self, reason: str = "") -> None:
        """As :func:`rtbus.estop`, in this session."""
        estop(self.name, reason)

    def rearm(self) -> None:
        """As :func:`rtbus.rearm`."""
        rearm(self.name)

    def adjust(self, key: str, value: float) -> None:
        """As :func:`rtbus.adjust`."""
        adjust(self.name, key, value)

    def mark(self, text: str) -> None:
        """As :func:`rtbus.mark`."""
        mark(self.name, text)

    def orders(self) -> dict[str, Any]:
        """As :func:`rtbus.orders`."""
        return orders(self.name)

    @property
    def running(self) -> bool:
        """`rtbus run` has not ended."""
        return self._process.poll() is None

    @property
    def log(self) -> str:
        """What `rtbus run` and the nodes have said so far."""
        self._log.flush()
        return Path(self._log.name).read_text(errors="replace")

    def wait(self, timeout: float | None = None) -> int:
        """Waits for the session to end by itself (``duration``), at most ``timeout`` seconds.

        Returns the exit status of `rtbus run`. Raises subprocess.TimeoutExpired.
        """
        return self._process.wait(timeout)

    def end(self, timeout: float = 20.0) -> dict[str, Any]:
        """Ends the session as Ctrl-C does: forces go to zero, then the nodes end. Returns the report."""
        if self.running:
            self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(timeout)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        return self.report()

    def report(self) -> dict[str, Any]:
        """The report of a session that has ended (docs/monitoring.md); empty when it failed before it ran."""
        try:
            return json.loads(Path(self._report_file).read_text())
        except (OSError, ValueError):
            return {}

    def __enter__(self) -> Session:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.end()
        self._log.close()


def run(
    session: str,
    *,
    duration: float | None = None,
    set: Mapping[str, object] | None = None,
    name: str | None = None,
    timeout: float = 20.0,
) -> Session:
    """Starts `rtbus run` on a session file, or on one of the installed sessions by name, and waits for its nodes.

    ``set``: keys to change, ``{"physics.rate_hz": 500}``. ``name``: of the session, ``py-PID`` unless given, so that it
    meets no other. Raises RuntimeError with what the nodes said when the session does not start within ``timeout``
    seconds.

        with rtbus.run("wall") as session, session.open("haptic0.telemetry") as topic:
            ...
    """
    name = name or f"py-{os.getpid()}-{time.monotonic_ns() % 100000}"
    folder = tempfile.mkdtemp(prefix="rtbus-")
    report = os.path.join(folder, _REPORT)
    command = [find_program(), "run", session, "--report", report, "--no-plots", "--no-bare-loop"]
    for key, value in {**(set or {}), "session": name}.items():
        command += ["--set", f"{key}={value}"]
    if duration is not None:
        command += ["--duration", str(duration)]
    log = _log_file(folder)
    process = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL)
    made = Session(process, name, folder, log)
    end = time.monotonic() + timeout
    while True:
        if made.running and _all_run(name):
            return made
        if not made.running or time.monotonic() > end:
            said = made.log
            made.end(2.0)
            raise RuntimeError(f"session {session} did not start; it says:\n{said}")
        time.sleep(0.05)


def _all_run(session: str) -> bool:
    """Every node runs: the haptic ones, and physics when the method of one of them needs it."""
    try:
        found = {each.name: each for each in nodes(session)}
        needed = {name for name in found if name != "physics"}
        for name in list(needed):
            with open(f"{name}.node_info", session, presence=False) as topic:
                told = topic.latest()
            if told is None:
                return False
            if told["method"].item().decode() not in _WITHOUT_PHYSICS:
                needed.add("physics")
    except _c.NotFound:
        return False
    return bool(needed) and all(name in found and found[name].state == "running" for name in needed)


def _log_file(folder: str) -> IO[str]:
    return tempfile.NamedTemporaryFile("w", dir=folder, prefix="log-", delete=False)
