"""rtbus from Python: topics of haptic sessions as numpy arrays.

    import rtbus

    with rtbus.open("haptic0.telemetry") as topic:        # while `rtbus run wall` runs
        print(topic.latest()["force_n"], topic.units["force_n"])
        for sample in topic.follow(timeout=1.0):
            print(sample["position_m"])

Everything here works on the C library librtbus.so.1; numpy is all that is needed besides. SI units, times are
nanoseconds of CLOCK_MONOTONIC (``time.monotonic_ns()``).
"""

from ._library import (
    AlreadyOwned,
    Ended,
    LayoutMismatch,
    NotFound,
    OrderRefused,
    RtbusError,
    TimedOut,
    UnfitValue,
    library_version,
    now_ns,
)
from .engine import ConfigError, Engine, Hand, Step
from .recording import Recording
from .session import Node, Session, adjust, estop, mark, nodes, orders, rearm, run
from .topics import Topic, TopicInfo, open, sessions, topics
from .types import SampleType, known_type, known_types, units
from .writer import Writer, publisher

__all__ = [
    "AlreadyOwned",
    "ConfigError",
    "Ended",
    "Engine",
    "Hand",
    "LayoutMismatch",
    "Node",
    "NotFound",
    "OrderRefused",
    "Recording",
    "RtbusError",
    "SampleType",
    "Session",
    "Step",
    "TimedOut",
    "Topic",
    "TopicInfo",
    "UnfitValue",
    "Writer",
    "adjust",
    "estop",
    "known_type",
    "known_types",
    "library_version",
    "mark",
    "nodes",
    "now_ns",
    "open",
    "orders",
    "publisher",
    "rearm",
    "run",
    "sessions",
    "topics",
    "units",
]
