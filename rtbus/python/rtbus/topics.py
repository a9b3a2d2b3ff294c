"""Reading topics."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Iterator
from dataclasses import dataclass
from types import TracebackType

import numpy as np

from . import _library as _c
from .types import SampleType, from_c

_PRESENCE, _FROM_OLDEST, _ANY_OWNER = 1, 2, 4
_STAMP = np.dtype([("sequence", "<u8"), ("stamp_ns", "<u8")])
_ROUND_S = 0.1  # Ctrl-C waits no longer than this


@dataclass(frozen=True)
class TopicInfo:
    """A topic, as ``rtbus list`` shows it."""

    session: str
    topic: str
    type: str
    alive: bool
    published: int
    capacity: int
    sample_bytes: int
    writer_pid: int
    problem: str


def topics(session: str | None = None) -> list[TopicInfo]:
    """All topics, or those of one session, sorted. Any thread."""
    wanted = None if session is None else session.encode()
    count = _c.check(_c.lib.rtbus_list(wanted, None, 0, 0))
    entries = (_c.Topic * (count + 16))()  # some may have come meanwhile
    count = _c.check(_c.lib.rtbus_list(wanted, entries, ctypes.sizeof(_c.Topic), len(entries)))
    return [
        TopicInfo(
            each.session.decode(),
            each.topic.decode(),
            each.type_name.decode(),
            bool(each.writer_alive),
            each.published,
            each.capacity,
            each.sample_bytes,
            each.writer_pid,
            each.problem.decode(),
        )
        for each in entries[: min(count, len(entries))]
    ]


def sessions(alive: bool = True) -> list[str]:
    """Names of the sessions that have a live writer; all that have topics with ``alive=False``."""
    return sorted({each.session for each in topics() if each.alive or not alive})


def the_session(name: str | None) -> str:
    """The name, or that of the only live session."""
    if name is not None:
        return name
    live = sessions()
    if len(live) == 1:
        return live[0]
    if not live:
        raise _c.NotFound("no session is live; start one, for example with `rtbus run wall`")
    raise _c.NotFound(f"several sessions are live ({', '.join(live)}); name one: session=\"{live[0]}\"")


class Topic:
    """The reading end of a topic; made by :func:`open`. One thread at a time; others run while it waits.

    While it is open with ``presence`` the node knows that somebody looks, and publishes what it leaves out otherwise
    (telemetry, poses of bodies).
    """

    def __init__(self, session: str, name: str, presence: bool, from_oldest: bool, any_owner: bool) -> None:
        self.session, self.name = session, name
        flags = _PRESENCE * presence + _FROM_OLDEST * from_oldest + _ANY_OWNER * any_owner
        handle = ctypes.c_void_p()
        self._handle = None
        _c.check(_c.lib.rtbus_reader_open(session.encode(), name.encode(), flags, ctypes.byref(handle)))
        self._handle = handle
        given = _c.Type(struct_bytes=ctypes.sizeof(_c.Type))
        _c.check(_c.lib.rtbus_reader_type(handle, ctypes.byref(given)))
        self.type: SampleType = from_c(given)
        self._latest = np.zeros((), self.dtype)
        self._stamp = np.zeros((), _STAMP)
        self._latest_at, self._stamp_at = self._latest.ctypes.data, self._stamp.ctypes.data
        self._has_latest = False
        self._read_at = time.monotonic()
        self.longest_away: float = 0.0
        """Longest time between two reads of blocks [s]; what is more than the ring holds is missed."""
        self.stamps: np.ndarray = np.zeros(0, _STAMP)
        """Of the last block, shape (count,): ``sequence`` from 1, and ``stamp_ns`` [ns], of each sample."""

    @property
    def dtype(self) -> np.dtype:
        """numpy dtype of a sample."""
        return self.type.dtype

    @property
    def units(self) -> dict[str, str]:
        """Units of the fields, by their names."""
        return self.type.units

    @property
    def sequence(self) -> int:
        """Number of the last latest(), from 1."""
        return int(self._stamp["sequence"])

    @property
    def stamp_ns(self) -> int:
        """Stamp of the last latest() [ns]."""
        return int(self._stamp["stamp_ns"])

    @property
    def missed(self) -> int:
        """Samples that follow() and blocks() lost because they were too slow."""
        return _c.lib.rtbus_missed(self._open())

    @property
    def refused(self) -> int:
        """Samples that were not sane: not finite, or impossible."""
        return _c.lib.rtbus_refused(self._open())

    @property
    def alive(self) -> bool:
        """The writer's process lives and keeps the topic."""
        return bool(_c.lib.rtbus_writer_alive(self._open()))

    def latest(self) -> np.ndarray | None:
        """The newest sample: shape (), of ``dtype``, a copy of its own; None before the first."""
        handle = self._open()
        status = _c.check(_c.lib.rtbus_read_latest(handle, self._latest_at, self._latest.nbytes, self._stamp_at))
        self._has_latest |= status == _c.FRESH
        return self._latest.copy() if self._has_latest else None

    def wait(self, timeout: float | None = None) -> bool:
        """Sleeps until something newer than what was read last is there (True), or ``timeout`` seconds have passed.

        Follows a writer that died and was started again. Other Python threads run meanwhile.
        """
        end_ns = None if timeout is None else _c.now_ns() + int(timeout * 1e9)
        while True:
            round_ns = _c.now_ns() + int(_ROUND_S * 1e9)
            deadline_ns = round_ns if end_ns is None else min(round_ns, end_ns)
            if _c.check(_c.lib.rtbus_wait(self._open(), deadline_ns)) == _c.FRESH:
                return True
            if end_ns is not None and _c.now_ns() >= end_ns:
                return False

    def read(self, most: int = 4096) -> np.ndarray:
        """What came since the last read, in order and without waiting: shape (count,), count from 0 to ``most``.

        The first call begins with the next sample that is published, or with the oldest one still held
        (``from_oldest``). ``stamps`` holds their numbers and times.
        """
        block = np.empty(most, self.dtype)
        stamps = np.empty(most, _STAMP)
        before, self._read_at = self._read_at, time.monotonic()
        self.longest_away = max(self.longest_away, self._read_at - before)
        count = _c.check(
            _c.lib.rtbus_read_next(self._open(), block.ctypes.data, block.nbytes, stamps.ctypes.data, most)
        )
        self.stamps = stamps[:count]
        if count and stamps["sequence"][count - 1] > self.sequence:  # for latest(): what is read now is not new later
            self._latest[()], self._stamp[()], self._has_latest = block[count - 1], stamps[count - 1], True
        return block[:count]

    def blocks(self, timeout: float | None = None, gather: float = 0.01, most: int = 4096) -> Iterator[np.ndarray]:
        """Everything that is published from now on, as structured arrays of shape (count,), count from 1 to ``most``.

        Ends when nothing came for ``timeout`` seconds (None: never). ``gather``: seconds to let samples come together
        before they are taken; longer costs less.
        """
        while True:
            block = self.read(most)
            if len(block):
                yield block
                if len(block) < most and gather > 0:
                    time.sleep(gather)
            elif not self.wait(timeout):
                return

    def follow(self, timeout: float | None = None, gather: float = 0.01) -> Iterator[np.void]:
        """The same sample by sample, each of shape (). ``gather=0`` [s]: each as soon as it is there."""
        for block in self.blocks(timeout, gather):
            yield from block

    def close(self) -> None:
        """Lets go of the topic; may be called again."""
        if self._handle is not None:
            _c.lib.rtbus_reader_close(self._handle)
            self._handle = None

    def _open(self) -> ctypes.c_void_p:
        if self._handle is None:
            raise _c.Ended(f"the topic {self.name} has been closed")
        return self._handle

    def __enter__(self) -> Topic:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __del__(self) -> None:
        if getattr(self, "_handle", None) is not None:
            self.close()

    def __repr__(self) -> str:
        return f"<rtbus.Topic {self.name} of {self.session}: {self.type.name}>"


def open(
    topic: str,
    session: str | None = None,
    *,
    presence: bool = True,
    from_oldest: bool = False,
    any_owner: bool = False,
    timeout: float = 0.0,
) -> Topic:
    """Opens a topic, for example ``open("haptic0.telemetry", session="wall")``.

    ``session`` may be left out while only one is live. ``timeout``: seconds to wait for the topic to come into being.
    Raises NotFound, PermissionError and others with the name and the remedy. Any thread.
    """
    end = time.monotonic() + timeout
    while True:
        try:
            return Topic(the_session(session), topic, presence, from_oldest, any_owner)
        except _c.NotFound:
            if time.monotonic() >= end:
                raise
            time.sleep(0.02)
