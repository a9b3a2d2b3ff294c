"""The C library: finds and loads it, declares its functions, turns its statuses into exceptions. Private."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

ABI_VERSION = 1
SONAME = "librtbus.so.1"

FRESH, SAME, LAPPED, REFUSED = 1, 2, 3, 4


class RtbusError(Exception):
    """A call failed. ``status`` is the number of the C interface (rtbus.h)."""

    status = 0


class NotFound(RtbusError, LookupError):
    """No such session, topic or type yet."""


class AlreadyOwned(RtbusError):
    """A live writer holds the topic."""


class LayoutMismatch(RtbusError):
    """The type differs from what was expected."""


class UnfitValue(RtbusError, ValueError):
    """Readers would refuse the sample: not finite, or impossible. It was not published."""


class TimedOut(RtbusError, TimeoutError):
    """Nobody answered in time."""


class OrderRefused(RtbusError):
    """The session refused the order."""


class Ended(RtbusError):
    """The session, or what the object stood for, has ended."""


class BadArgument(RtbusError, ValueError):
    """An argument makes no sense."""


_CLASSES = {
    -1: NotFound,
    -2: AlreadyOwned,
    -3: LayoutMismatch,
    -4: PermissionError,
    -5: BadArgument,
    -8: BadArgument,
    -9: UnfitValue,
    -10: TimedOut,
    -11: OrderRefused,
    -12: MemoryError,
    -13: Ended,
}


class Field(ctypes.Structure):
    """rtbus_field"""

    _fields_ = [
        ("name", ctypes.c_char * 40),
        ("unit", ctypes.c_char * 16),
        ("type", ctypes.c_uint32),
        ("offset", ctypes.c_uint32),
        ("count", ctypes.c_uint32),
        ("inner", ctypes.c_uint32),
    ]


class Type(ctypes.Structure):
    """rtbus_type"""

    _fields_ = [
        ("struct_bytes", ctypes.c_size_t),
        ("name", ctypes.c_char * 48),
        ("hash", ctypes.c_uint64),
        ("bytes", ctypes.c_uint32),
        ("field_count", ctypes.c_uint32),
        ("fields", ctypes.POINTER(Field)),
    ]


class Topic(ctypes.Structure):
    """rtbus_topic_info"""

    _fields_ = [
        ("session", ctypes.c_char * 40),
        ("topic", ctypes.c_char * 104),
        ("type_name", ctypes.c_char * 48),
        ("problem", ctypes.c_char * 160),
        ("published", ctypes.c_uint64),
        ("segment_bytes", ctypes.c_uint64),
        ("sample_bytes", ctypes.c_uint32),
        ("capacity", ctypes.c_uint32),
        ("writer_pid", ctypes.c_uint32),
        ("writer_alive", ctypes.c_uint32),
    ]


class Node(ctypes.Structure):
    """rtbus_node"""

    _fields_ = [
        ("name", ctypes.c_char * 40),
        ("pid", ctypes.c_uint32),
        ("alive", ctypes.c_uint32),
        ("state", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
        ("beat_age_ns", ctypes.c_uint64),
        ("work_age_ns", ctypes.c_uint64),
        ("work_period_ns", ctypes.c_uint64),
    ]


class WriterOptions(ctypes.Structure):
    """rtbus_writer_options"""

    _fields_ = [
        ("struct_bytes", ctypes.c_size_t),
        ("capacity", ctypes.c_uint32),
        ("doorbell", ctypes.c_uint32),
        ("mode", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
    ]


def places(soname: str) -> list[str]:
    """Where a library of ours is looked for, in this order."""
    here = Path(__file__).resolve()
    found = [os.environ.get("RTBUS_LIBRARY_DIR", ""), str(here.parent)]
    if len(here.parents) > 3 and (here.parents[3] / "tools" / "build").is_file():  # in the source tree
        found.append(str(here.parents[3] / "build" / "lib"))
    return [str(Path(each) / soname) for each in found if each] + [soname]


def load(soname: str) -> ctypes.CDLL:
    """Loads one of our libraries, or says what to install."""
    for place in places(soname):
        if os.sep in place and not os.path.exists(place):
            continue
        try:
            return ctypes.CDLL(place)
        except OSError as error:
            reason = str(error)
    raise ImportError(
        f"{soname} could not be loaded ({reason}); install the package librtbus1, "
        "build it in the source tree (tools/build rtbus_c rtbus_engine), "
        "or let RTBUS_LIBRARY_DIR name the folder that it was built in"
    )


_P, _U32, _U64, _SIZE, _TEXT = ctypes.c_void_p, ctypes.c_uint32, ctypes.c_uint64, ctypes.c_size_t, ctypes.c_char_p
_SIGNATURES = {
    "rtbus_strerror": (_TEXT, [ctypes.c_int]),
    "rtbus_last_error": (_TEXT, []),
    "rtbus_abi_version": (_U32, []),
    "rtbus_version": (_TEXT, []),
    "rtbus_now_ns": (_U64, []),
    "rtbus_known_type": (ctypes.c_int, [_TEXT, ctypes.POINTER(Type)]),
    "rtbus_known_type_name": (_TEXT, [_SIZE]),
    "rtbus_list": (ctypes.c_int, [_TEXT, ctypes.POINTER(Topic), _SIZE, _SIZE]),
    "rtbus_session_nodes": (ctypes.c_int, [_TEXT, ctypes.POINTER(Node), _SIZE, _SIZE]),
    "rtbus_reader_open": (ctypes.c_int, [_TEXT, _TEXT, _U32, ctypes.POINTER(_P)]),
    "rtbus_reader_close": (None, [_P]),
    "rtbus_reader_type": (ctypes.c_int, [_P, ctypes.POINTER(Type)]),
    "rtbus_read_latest": (ctypes.c_int, [_P, _P, _SIZE, _P]),
    "rtbus_read_next": (ctypes.c_int, [_P, _P, _SIZE, _P, _SIZE]),
    "rtbus_wait": (ctypes.c_int, [_P, _U64]),
    "rtbus_missed": (_U64, [_P]),
    "rtbus_refused": (_U64, [_P]),
    "rtbus_writer_alive": (ctypes.c_int, [_P]),
    "rtbus_writer_create": (
        ctypes.c_int,
        [_TEXT, _TEXT, ctypes.POINTER(Type), ctypes.POINTER(WriterOptions), ctypes.POINTER(_P)],
    ),
    "rtbus_writer_close": (None, [_P]),
    "rtbus_publish": (ctypes.c_int, [_P, _P, _SIZE, _U64]),
    "rtbus_observed": (ctypes.c_int, [_P]),
    "rtbus_order": (ctypes.c_int, [_TEXT, _TEXT, ctypes.c_char_p, _SIZE, ctypes.c_double]),
    "rtbus_estop": (ctypes.c_int, [_TEXT, _TEXT]),
    "rtbus_rearm": (ctypes.c_int, [_TEXT]),
    "rtbus_adjust": (ctypes.c_int, [_TEXT, _TEXT, ctypes.c_double]),
    "rtbus_mark": (ctypes.c_int, [_TEXT, _TEXT]),
}


def declare(library: ctypes.CDLL, signatures: Mapping[str, tuple[Any, list[Any]]]) -> None:
    """Gives the functions their types. ctypes releases the GIL during each call."""
    for name, (result, arguments) in signatures.items():
        function = getattr(library, name)
        function.restype = result
        function.argtypes = arguments


lib = load(SONAME)
declare(lib, {"rtbus_abi_version": _SIGNATURES["rtbus_abi_version"]})
if lib.rtbus_abi_version() < ABI_VERSION:
    raise ImportError(f"{SONAME} is older than this package; install librtbus1 and python3-rtbus of one version")
declare(lib, _SIGNATURES)


def check(status: int) -> int:
    """Passes a status that is no failure; raises the others with the library's sentence."""
    if status >= 0:
        return status
    sentence = lib.rtbus_last_error().decode(errors="replace") or lib.rtbus_strerror(status).decode()
    error = _CLASSES.get(status, RtbusError)(sentence)
    try:
        error.status = status
    except AttributeError:
        pass
    raise error


def now_ns() -> int:
    """Now, on the clock of all stamps: CLOCK_MONOTONIC [ns]."""
    return lib.rtbus_now_ns()


def library_version() -> str:
    """Version of librtbus that was loaded."""
    return lib.rtbus_version().decode()
