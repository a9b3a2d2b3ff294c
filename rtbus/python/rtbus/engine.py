"""Physics of your own behind a haptic device: docs/your-own-physics.md.

    with rtbus.Engine() as engine:
        for step in engine:                  # one turn per step of the session's rate
            for hand in step.hands:
                ...                          # advance your world by step.dt; then
                hand.move(position, velocity, contact_force)

Frame W: right-handed, y up. SI units. Quaternions are (w, x, y, z). The heartbeat and the clock live in threads of the
library: a slow step, the garbage collector or a thread that holds the interpreter cannot make the engine look dead.
"""

from __future__ import annotations

import ctypes
import gc
import sys
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from . import _library as _c

SONAME = "librtbus_engine.so.1"
_GIVES_BODIES = 1
_ENDED, _CONFIG = -13, -14
_D = ctypes.c_double
_U = ctypes.c_uint32


class ConfigError(_c.RtbusError):
    """The session file is wrong, or asks for what this engine does not give."""


class _Options(ctypes.Structure):
    _fields_ = [
        ("struct_bytes", ctypes.c_size_t),
        ("config", ctypes.c_char_p),
        ("set", ctypes.c_char_p),
        ("gives", _U),
        ("bodies", _U),
    ]


class _Info(ctypes.Structure):
    _fields_ = [
        ("struct_bytes", ctypes.c_size_t),
        ("session", ctypes.c_char * 40),
        ("step_s", _D),
        ("gravity_m_s2", _D * 3),
        ("hands", _U),
        ("bodies", _U),
    ]


class _Step(ctypes.Structure):
    _fields_ = [
        ("struct_bytes", ctypes.c_size_t),
        ("step_s", _D),
        ("step_index", ctypes.c_uint64),
        ("due", _U),
        ("reserved", _U),
    ]


class _Push(ctypes.Structure):
    _fields_ = [("body", _U), ("reserved", _U), ("force_n", _D * 3), ("torque_n_m", _D * 3)]


class _Hand(ctypes.Structure):
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
        ("push", _Push * 4),
    ]


class _Tool(ctypes.Structure):
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


class _Body(ctypes.Structure):
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


class _Contact(ctypes.Structure):
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


class _Support(ctypes.Structure):
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


class _Shape(ctypes.Structure):
    _fields_ = [
        ("struct_bytes", ctypes.c_size_t),
        ("kind", _U),
        ("reserved", _U),
        ("size_m", _D * 3),
        ("position_m", _D * 3),
        ("orientation_wxyz", _D * 4),
    ]


_SHAPES = {"plane": (1, 0), "sphere": (2, 1), "box": (3, 3), "capsule": (4, 2), "cylinder": (5, 2)}  # number, sizes

_P, _I = ctypes.c_void_p, ctypes.c_int
_SIGNATURES = {
    "rtbus_engine_last_error": (ctypes.c_char_p, []),
    "rtbus_engine_abi_version": (_U, []),
    "rtbus_engine_open": (_I, [ctypes.POINTER(_Options), ctypes.POINTER(_P)]),
    "rtbus_engine_close": (None, [_P]),
    "rtbus_engine_get_info": (_I, [_P, ctypes.POINTER(_Info)]),
    "rtbus_engine_begin": (_I, [_P, ctypes.POINTER(_Step)]),
    "rtbus_engine_get_hand": (_I, [_P, _U, ctypes.POINTER(_Hand)]),
    "rtbus_engine_set_tool": (_I, [_P, _U, ctypes.POINTER(_Tool)]),
    "rtbus_engine_set_body": (_I, [_P, _U, ctypes.POINTER(_Body)]),
    "rtbus_engine_add_shape": (_I, [_P, _U, ctypes.POINTER(_Shape)]),
    "rtbus_engine_clear_shapes": (_I, [_P]),
    "rtbus_engine_add_contact": (_I, [_P, _U, ctypes.POINTER(_Contact)]),
    "rtbus_engine_add_support": (_I, [_P, ctypes.POINTER(_Support)]),
    "rtbus_engine_finish": (_I, [_P]),
}
_lib = None


def _library() -> ctypes.CDLL:
    global _lib
    if _lib is None:
        loaded = _c.load(SONAME)
        _c.declare(loaded, _SIGNATURES)
        _lib = loaded
    return _lib


def _check(status: int) -> int:
    if status >= 0:
        return status
    sentence = _library().rtbus_engine_last_error().decode(errors="replace")
    classes = {-2: _c.AlreadyOwned, -8: _c.BadArgument, -9: _c.UnfitValue, -12: MemoryError, _ENDED: _c.Ended}
    raise {**classes, _CONFIG: ConfigError}.get(status, _c.RtbusError)(sentence)


def _set(struct: ctypes.Structure, field: str, value) -> None:
    """Copies a vector into a field; a wrong shape names the field."""
    target = getattr(struct, field)
    array = np.asarray(value)
    if array.dtype.kind not in "fiub":
        raise TypeError(f"{field} takes {len(target)} numbers, and got an array of {array.dtype}")
    if array.shape != (len(target),):
        raise ValueError(f"{field} takes {len(target)} numbers, and got an array of shape {array.shape}")
    target[:] = array.tolist()


def _make(kind: type[ctypes.Structure]) -> ctypes.Structure:
    return kind(struct_bytes=ctypes.sizeof(kind))


class Hand:
    """A hand in one step. Its arrays are views that hold until the next step."""

    def __init__(self, engine: Engine, index: int):
        self._engine, self._index = engine, index
        self._in, self._out, self._near = _make(_Hand), _make(_Tool), _make(_Contact)
        self.target = np.frombuffer(self._in.target_position_m)
        """Where the spring pulls the tool to, p_WT [m]."""
        self.target_velocity = np.frombuffer(self._in.target_velocity_m_s)
        """[m/s]"""
        self.force = np.frombuffer(self._in.force_n)
        """On the tool besides the spring [N]; zero but with ``form: paper``."""
        self.position = np.zeros(3)
        """The tool, as move() left it or, after a reset, at the target [m]."""
        self.velocity = np.zeros(3)
        """[m/s]"""

    def _refresh(self) -> None:
        _check(_library().rtbus_engine_get_hand(self._engine._handle, self._index, ctypes.byref(self._in)))
        if self.reset or self.placed:
            self.position[:] = self.target
            self.velocity[:] = self.target_velocity if self.placed else 0.0

    name = property(lambda self: self._in.name.decode(), doc="\"haptic0\".")
    away = property(lambda self: self._in.tool == 0, doc="Nobody holds the device: the tool touches nothing.")
    spring = property(lambda self: self._in.tool == 1, doc="The tool is a mass on a spring: advance it, then move().")
    placed = property(
        lambda self: self._in.tool == 2,
        doc="The haptic loop simulates the tool: give contact()s, and apply pushes to the bodies.",
    )
    reset = property(lambda self: bool(self._in.reset), doc="The tool was put at the target, at rest.")
    mass = property(lambda self: self._in.mass_kg, doc="Of the tool [kg].")
    radius = property(lambda self: self._in.radius_m, doc="Of the tool, a sphere [m].")
    friction = property(lambda self: self._in.friction, doc="Of the tool; multiply it with the body's.")
    stiffness = property(lambda self: self._in.stiffness_n_per_m, doc="Of the spring [N/m].")
    damping = property(lambda self: self._in.damping_n_s_per_m, doc="Of the spring, on the relative velocity [N s/m].")
    reach = property(lambda self: self._in.contact_reach_m, doc="Give contacts with a gap up to this [m].")

    @property
    def pushes(self) -> list[tuple[int, np.ndarray, np.ndarray]]:
        """(body, force [N], torque [N m]) of this hand on bodies, constant over the step, at their centres of mass."""
        rows = self._in.push[: self._in.pushes]
        return [(row.body, np.array(row.force_n), np.array(row.torque_n_m)) for row in rows]

    def free_step(self, dt: float) -> tuple[np.ndarray, float]:
        """The tool's velocity after ``dt`` seconds without contacts, and the mass that a contact then meets.

        The spring is solved implicitly, so no stiffness and no step is too large: a = m + dt·b + dt²·k. A contact that
        changes the velocity by Δv takes the force a·Δv/dt.
        """
        mass = self.mass + dt * self.damping + dt * dt * self.stiffness
        pull = self.stiffness * (self.target - self.position) + self.damping * self.target_velocity + self.force
        return (self.mass * self.velocity + dt * pull) / mass, mass

    def move(
        self,
        position: Sequence[float],
        velocity: Sequence[float],
        contact_force: Sequence[float] = (0.0, 0.0, 0.0),
        orientation: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
        spring_force: Sequence[float] | None = None,
    ) -> None:
        """Where the tool is after the step, and the force of the world on it, mean over the step [N].

        ``spring_force``: of the spring on it, mean over the step [N]; needed only where your step has several parts.
        """
        for field, value in (
            ("position_m", position),
            ("velocity_m_s", velocity),
            ("contact_force_n", contact_force),
            ("orientation_wxyz", orientation),
        ):
            _set(self._out, field, value)
        self._out.contacts = int(any(self._out.contact_force_n))
        self._out.tells_spring_force = int(spring_force is not None)
        _set(self._out, "spring_force_n", (0.0, 0.0, 0.0) if spring_force is None else spring_force)
        _check(_library().rtbus_engine_set_tool(self._engine._handle, self._index, ctypes.byref(self._out)))
        self.position[:] = position
        self.velocity[:] = velocity

    def contact(
        self,
        body: int,
        point: Sequence[float],
        normal: Sequence[float],
        gap: float,
        friction: float = 0.0,
        curvature: float = 0.0,
    ) -> None:
        """A place where the tool touches ``body`` or may soon: point on its surface, unit normal towards the tool.

        ``gap`` [m] from surface to surface, ``friction`` of the pair, ``curvature`` [1/m] of a ball's surface.
        """
        near = self._near
        near.body, near.gap_m, near.friction, near.curvature_per_m = body, gap, friction, curvature
        _set(near, "point_m", point)
        _set(near, "normal", normal)
        _check(_library().rtbus_engine_add_contact(self._engine._handle, self._index, ctypes.byref(near)))


class Step:
    """One step: advance the world by ``dt`` seconds."""

    def __init__(self, hands: list[Hand]):
        self.hands = hands
        self.dt = 0.0
        self.index = 0


class Engine:
    """The engine's end of a session. One per process, one thread.

    ``config``: session file; left out, `rtbus run` has named it. ``set``: keys to change. ``gives_bodies``: this
    engine tells bodies and contacts, so it serves the method local_contact. ``bodies``: how many; 0: those of the
    session's scene.
    """

    def __init__(
        self,
        config: str | None = None,
        *,
        set: Mapping[str, object] | None = None,
        gives_bodies: bool = False,
        bodies: int = 0,
    ):
        self._handle = None
        options = _make(_Options)
        options.config = None if config is None else str(config).encode()
        if set is not None:
            options.set = "\n".join(f"{key}={value}" for key, value in set.items()).encode()
        self._supervised = config is None
        options.gives = _GIVES_BODIES if gives_bodies else 0
        options.bodies = bodies
        handle = _P()
        _check(_library().rtbus_engine_open(ctypes.byref(options), ctypes.byref(handle)))
        self._handle = handle
        info = _make(_Info)
        _check(_library().rtbus_engine_get_info(handle, ctypes.byref(info)))
        self.session: str = info.session.decode()
        self.dt: float = info.step_s
        """Length of a step [s]; with ``pace: free`` the longest."""
        self.gravity: np.ndarray = np.array(info.gravity_m_s2)
        """Of the session's scene [m/s²]."""
        self.bodies: int = info.bodies
        self.hands: list[Hand] = [Hand(self, i) for i in range(info.hands)]
        """Before the first step their name, mass, radius and friction are known."""
        for hand in self.hands:
            hand._refresh()
        self._body, self._support = _make(_Body), _make(_Support)

    def __iter__(self) -> Iterator[Step]:
        """A turn per step; what the turn before has set is published when the next one begins. Ends with the session.

        A full collection of garbage stops Python for as long as it takes: what exists at the first step is left alone.
        """
        step, raw = Step(self.hands), _make(_Step)
        gc.collect()
        gc.freeze()
        while self._handle is not None:
            try:
                _check(_library().rtbus_engine_begin(self._handle, ctypes.byref(raw)))
            except _c.Ended:
                return
            except ConfigError as error:
                if not self._supervised:
                    raise
                print(error, file=sys.stderr)
                raise SystemExit(2) from None  # tells `rtbus run` that another start would not change it
            if not raw.due:
                continue
            step.dt, step.index = raw.step_s, raw.step_index
            for hand in self.hands:
                hand._refresh()
            yield step
            _check(_library().rtbus_engine_finish(self._handle))

    def body(
        self,
        index: int,
        position: Sequence[float],
        orientation: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
        velocity: Sequence[float] = (0.0, 0.0, 0.0),
        angular_velocity: Sequence[float] = (0.0, 0.0, 0.0),
        *,
        kind: str = "static",
        mass: float = 0.0,
        inertia: Sequence[float] = (0.0, 0.0, 0.0),
        force: Sequence[float] = (0.0, 0.0, 0.0),
        torque: Sequence[float] = (0.0, 0.0, 0.0),
        friction_force: Sequence[float] = (0.0, 0.0, 0.0),
        friction_torque: Sequence[float] = (0.0, 0.0, 0.0),
        friction_bound: float = 0.0,
    ) -> None:
        """A body after the step: its centre of mass, and what acts on it besides tools. Kept until it is set again.

        ``kind``: "static", "kinematic" or "dynamic". ``inertia``: principal moments [kg m²] about the axes that
        ``orientation`` turns. ``force``: gravity and normal forces of its contacts [N]; friction of them apart.
        """
        kinds = ("static", "kinematic", "dynamic")
        if kind not in kinds:
            raise ValueError(f"kind = {kind!r} is unknown; choose {', '.join(kinds)}")
        raw = self._body
        raw.kind, raw.mass_kg, raw.friction_bound_n = kinds.index(kind), mass, friction_bound
        for field, value in (
            ("position_m", position),
            ("orientation_wxyz", orientation),
            ("velocity_m_s", velocity),
            ("angular_velocity_rad_s", angular_velocity),
            ("inertia_kg_m2", inertia),
            ("external_force_n", force),
            ("external_torque_n_m", torque),
            ("friction_force_n", friction_force),
            ("friction_torque_n_m", friction_torque),
        ):
            _set(raw, field, value)
        _check(_library().rtbus_engine_set_body(self._handle, index, ctypes.byref(raw)))

    def shape(
        self,
        body: int,
        kind: str,
        size: float | Sequence[float] = (),
        position: Sequence[float] = (0.0, 0.0, 0.0),
        orientation: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
    ) -> None:
        """What a body looks like, for viewers; once is enough. A body may have several shapes.

        ``kind``: "plane" (y = 0), "sphere", "box", "capsule" or "cylinder" (along y). ``size`` [m]: radius of a sphere;
        half edges of a box; (radius, length) of a capsule, with both caps, and of a cylinder. ``position`` and
        ``orientation``: of the shape in the frame of the body.
        """
        if kind not in _SHAPES:
            raise ValueError(f"kind = {kind!r} is unknown; choose {', '.join(_SHAPES)}")
        number, sizes = _SHAPES[kind]
        size = np.atleast_1d(np.asarray(size))
        if size.shape != (sizes,):
            raise ValueError(f"size of a {kind} takes {sizes} numbers, and got an array of shape {size.shape}")
        raw = _make(_Shape)
        raw.kind = number
        _set(raw, "size_m", [*size.tolist(), *[0.0] * (3 - sizes)])
        _set(raw, "position_m", position)
        _set(raw, "orientation_wxyz", orientation)
        _check(_library().rtbus_engine_add_shape(self._handle, body, ctypes.byref(raw)))

    def clear_shapes(self) -> None:
        """Forgets all shapes: the world will look otherwise."""
        _check(_library().rtbus_engine_clear_shapes(self._handle))

    def support(
        self,
        body: int,
        point: Sequence[float],
        normal: Sequence[float],
        force: float,
        friction: float = 0.0,
        points: int = 4,
        velocity: Sequence[float] = (0.0, 0.0, 0.0),
        inverse_mass: float = 0.0,
    ) -> None:
        """What holds a body: mean point, unit normal towards the body, force > 0 [N], contact points that carry."""
        raw = self._support
        raw.body, raw.points, raw.force_n, raw.friction, raw.inverse_mass_per_kg = (
            body, points, force, friction, inverse_mass,
        )
        _set(raw, "point_m", point)
        _set(raw, "normal", normal)
        _set(raw, "surface_velocity_m_s", velocity)
        _check(_library().rtbus_engine_add_support(self._handle, ctypes.byref(raw)))

    def close(self) -> None:
        """Ends the engine: its topics go, and the hand's force fades. May be called again."""
        if self._handle is not None:
            _library().rtbus_engine_close(self._handle)
            self._handle = None

    def __enter__(self) -> Engine:
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def __del__(self) -> None:
        if getattr(self, "_handle", None) is not None:
            self.close()
