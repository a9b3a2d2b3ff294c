"""The C library of external engines: loads it, declares its functions and structures, turns its statuses into exceptions.

Private. The structures are those of rtbus_engine.h; a test holds them against the pinned layout.
"""

from __future__ import annotations

import ctypes
import operator
import re
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from . import _library as _c

SONAME = "librtbus_engine.so.1"
GIVES_BODIES = 1
_D = ctypes.c_double
_U = ctypes.c_uint32


class ConfigError(_c.RtbusError):
    """The session file is wrong, or asks for what this engine does not give."""


class Options(ctypes.Structure):
    """rtbus_engine_options"""

    _fields_ = [
        ("struct_bytes", ctypes.c_size_t),
        ("config", ctypes.c_char_p),
        ("set", ctypes.c_char_p),
        ("gives", _U),
        ("bodies", _U),
    ]


class Info(ctypes.Structure):
    """rtbus_engine_info"""

    _fields_ = [
        ("struct_bytes", ctypes.c_size_t),
        ("session", ctypes.c_char * 40),
        ("step_s", _D),
        ("gravity_m_s2", _D * 3),
        ("hands", _U),
        ("bodies", _U),
    ]


class Step(ctypes.Structure):
    """rtbus_engine_step"""

    _fields_ = [
        ("struct_bytes", ctypes.c_size_t),
        ("step_s", _D),
        ("step_index", ctypes.c_uint64),
        ("due", _U),
        ("reserved", _U),
    ]


class Push(ctypes.Structure):
    """rtbus_engine_push"""

    _fields_ = [("body", _U), ("reserved", _U), ("force_n", _D * 3), ("torque_n_m", _D * 3)]


class Hand(ctypes.Structure):
    """rtbus_engine_hand"""

    _fields_ = [
        ("struct_bytes", ctypes.c_size_t),
        ("name", ctypes.c_char * 16),
        ("tool", _U),
        ("reset", _U),
        ("mass_kg", _D),
        ("radius_m", _D),
        ("friction", _D),
        ("target_position_m", _D * 3),
        ("target_velocity_m_s", _D * 3),
        ("stiffness_n_per_m", _D),
        ("damping_n_s_per_m", _D),
        ("force_n", _D * 3),
        ("wants_contacts", _U),
        ("pushes", _U),
        ("contact_reach_m", _D),
        ("push", Push * 4),
    ]


class Tool(ctypes.Structure):
    """rtbus_engine_tool"""

    _fields_ = [
        ("struct_bytes", ctypes.c_size_t),
        ("position_m", _D * 3),
        ("velocity_m_s", _D * 3),
        ("orientation_wxyz", _D * 4),
        ("angular_velocity_rad_s", _D * 3),
        ("contact_force_n", _D * 3),
        ("contacts", _U),
        ("tells_spring_force", _U),
        ("spring_force_n", _D * 3),
    ]


class Body(ctypes.Structure):
    """rtbus_engine_body"""

    _fields_ = [
        ("struct_bytes", ctypes.c_size_t),
        ("kind", _U),
        ("reserved", _U),
        ("position_m", _D * 3),
        ("orientation_wxyz", _D * 4),
        ("velocity_m_s", _D * 3),
        ("angular_velocity_rad_s", _D * 3),
        ("mass_kg", _D),
        ("inertia_kg_m2", _D * 3),
        ("external_force_n", _D * 3),
        ("external_torque_n_m", _D * 3),
        ("friction_force_n", _D * 3),
        ("friction_torque_n_m", _D * 3),
        ("friction_bound_n", _D),
    ]


class Contact(ctypes.Structure):
    """rtbus_engine_contact"""

    _fields_ = [
        ("struct_bytes", ctypes.c_size_t),
        ("body", _U),
        ("reserved", _U),
        ("point_m", _D * 3),
        ("normal", _D * 3),
        ("gap_m", _D),
        ("friction", _D),
        ("curvature_per_m", _D),
    ]


class Support(ctypes.Structure):
    """rtbus_engine_support"""

    _fields_ = [
        ("struct_bytes", ctypes.c_size_t),
        ("body", _U),
        ("points", _U),
        ("point_m", _D * 3),
        ("normal", _D * 3),
        ("force_n", _D),
        ("friction", _D),
        ("surface_velocity_m_s", _D * 3),
        ("inverse_mass_per_kg", _D),
    ]


class Shape(ctypes.Structure):
    """rtbus_engine_shape"""

    _fields_ = [
        ("struct_bytes", ctypes.c_size_t),
        ("kind", _U),
        ("reserved", _U),
        ("size_m", _D * 3),
        ("position_m", _D * 3),
        ("orientation_wxyz", _D * 4),
    ]


SHAPES = {"plane": (1, 0), "sphere": (2, 1), "box": (3, 3), "capsule": (4, 2), "cylinder": (5, 2)}  # number, sizes

_P, _I = ctypes.c_void_p, ctypes.c_int
_SIGNATURES = {
    "rtbus_engine_last_error": (ctypes.c_char_p, []),
    "rtbus_engine_abi_version": (_U, []),
    "rtbus_engine_open": (_I, [ctypes.POINTER(Options), ctypes.POINTER(_P)]),
    "rtbus_engine_close": (None, [_P]),
    "rtbus_engine_get_info": (_I, [_P, ctypes.POINTER(Info)]),
    "rtbus_engine_begin": (_I, [_P, ctypes.POINTER(Step)]),
    "rtbus_engine_get_hand": (_I, [_P, _U, ctypes.POINTER(Hand)]),
    "rtbus_engine_set_tool": (_I, [_P, _U, ctypes.POINTER(Tool)]),
    "rtbus_engine_set_body": (_I, [_P, _U, ctypes.POINTER(Body)]),
    "rtbus_engine_add_shape": (_I, [_P, _U, ctypes.POINTER(Shape)]),
    "rtbus_engine_clear_shapes": (_I, [_P]),
    "rtbus_engine_add_contact": (_I, [_P, _U, ctypes.POINTER(Contact)]),
    "rtbus_engine_add_support": (_I, [_P, ctypes.POINTER(Support)]),
    "rtbus_engine_finish": (_I, [_P]),
}
_ERRORS = {
    -2: _c.AlreadyOwned,
    -8: _c.BadArgument,
    -9: _c.UnfitValue,
    -12: MemoryError,
    -13: _c.Ended,
    -14: ConfigError,
}
_loaded: list[ctypes.CDLL] = []  # at the first use: topics work without this library

# What the C fields are called in Python, where they have another name.
_PYTHON_NAMES = {
    "position_m": "position",
    "velocity_m_s": "velocity",
    "orientation_wxyz": "orientation",
    "angular_velocity_rad_s": "angular_velocity",
    "contact_force_n": "contact_force",
    "spring_force_n": "spring_force",
    "point_m": "point",
    "gap_m": "gap",
    "curvature_per_m": "curvature",
    "mass_kg": "mass",
    "inertia_kg_m2": "inertia",
    "external_force_n": "force",
    "external_torque_n_m": "torque",
    "friction_force_n": "friction_force",
    "friction_torque_n_m": "friction_torque",
    "friction_bound_n": "friction_bound",
    "force_n": "force",
    "surface_velocity_m_s": "velocity",
    "inverse_mass_per_kg": "inverse_mass",
    "size_m": "size",
    "rtbus_engine_set_tool": "Hand.move",
}
_C_NAME = re.compile(r"\b(" + "|".join(_PYTHON_NAMES) + r")\b")
_Struct = TypeVar("_Struct", bound=ctypes.Structure)


def library() -> ctypes.CDLL:
    """The library, loaded at the first call. Raises ImportError that says what to install."""
    if not _loaded:
        found = _c.load(SONAME)
        _c.declare(found, _SIGNATURES)
        _loaded.append(found)
    return _loaded[0]


def check(status: int) -> int:
    """Passes a status that is no failure; raises the others with the library's sentence, in Python's names."""
    if status >= 0:
        return status
    sentence = library().rtbus_engine_last_error().decode(errors="replace")
    if _ERRORS.get(status) is _c.UnfitValue:
        sentence = _C_NAME.sub(lambda found: _PYTHON_NAMES[found[1]], sentence)
    raise _ERRORS.get(status, _c.RtbusError)(sentence)


def put(struct: ctypes.Structure, **values: ArrayLike) -> None:
    """Copies numbers and vectors into fields. A wrong shape or type names the field as Python calls it."""
    for field, value in values.items():
        target = getattr(struct, field)
        array = np.asarray(value)
        name, length = _PYTHON_NAMES.get(field, field), len(target) if isinstance(target, ctypes.Array) else None
        wanted = "a number" if length is None else f"{length} numbers"
        if array.dtype.kind not in "fiub":
            raise TypeError(f"{name} takes {wanted}, and got {value!r}" if length is None
                            else f"{name} takes {wanted}, and got an array of {array.dtype}")
        if array.shape != (() if length is None else (length,)):
            raise ValueError(f"{name} takes {wanted}, and got an array of shape {array.shape}")
        if length is None:
            setattr(struct, field, array.item())
        else:
            target[:] = array.tolist()


def whole(name: str, value: int) -> int:
    """A whole number from 0 on, for a field that would wrap around silently."""
    try:
        number = operator.index(value)
    except TypeError:
        raise TypeError(f"{name} takes a whole number, and got {value!r}") from None
    if not 0 <= number < 1 << 32:
        raise _c.UnfitValue(f"{name} = {number} is negative or too large")
    return number


def body_of(name: str, body: int, bodies: int) -> int:
    """The number of a body: one of ``bodies``."""
    try:
        return whole(name, body)
    except _c.UnfitValue:
        raise _c.UnfitValue(f"{name} = {body} does not exist; this session has {bodies} (0…{max(0, bodies - 1)})") from None


def make(kind: type[_Struct]) -> _Struct:
    """A structure that knows its size, all else zero."""
    return kind(struct_bytes=ctypes.sizeof(kind))
