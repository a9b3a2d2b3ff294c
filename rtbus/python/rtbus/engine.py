"""Physics of your own behind a haptic device: docs/your-own-physics.md.

    with rtbus.Engine() as engine:
        for step in engine:                  # one turn per step of the session's rate
            for hand in step.hands:
                ...                          # advance your world by step.dt; then
                hand.move(position, velocity, contact_force)

Frame W: right-handed, y up. SI units. Quaternions are (w, x, y, z). The heartbeat and the clock live in threads of the
library: a slow step, the garbage collector or a thread that holds the interpreter cannot make the engine look dead.

Threads: an engine, its hands and its steps belong to one thread at a time. Other Python threads run while the engine
waits for its next step. A world that computes in threads of its own collects their results before the turn ends.
"""

from __future__ import annotations

import ctypes
import gc
import sys
from collections.abc import Iterator, Mapping
from types import TracebackType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _engine_library as _e
from . import _library as _c
from ._engine_library import ConfigError

__all__ = ["ConfigError", "Engine", "Hand", "Step"]

Vector = NDArray[np.float64]
"""Shape (3,); of a quaternion (4,)."""
_ZERO = (0.0, 0.0, 0.0)
_NOT_TURNED = (1.0, 0.0, 0.0, 0.0)


class Hand:
    """A hand in one step. Its arrays are views, valid until the next step. The engine's thread."""

    def __init__(self, engine: Engine, index: int) -> None:
        self._engine, self._index = engine, index
        self._in, self._out, self._near = _e.make(_e.Hand), _e.make(_e.Tool), _e.make(_e.Contact)
        self.target: Vector = np.frombuffer(self._in.target_position_m)
        """Where the spring pulls the tool to, p_WT: (3,) [m]."""
        self.target_velocity: Vector = np.frombuffer(self._in.target_velocity_m_s)
        """v_WT: (3,) [m/s]."""
        self.force: Vector = np.frombuffer(self._in.force_n)
        """On the tool besides the spring: (3,) [N]; zero but with ``form: paper``."""
        self.position: Vector = np.zeros(3)
        """The tool, as move() left it or, after a reset, at the target: (3,) [m]."""
        self.velocity: Vector = np.zeros(3)
        """Of the tool: (3,) [m/s]."""

    def _refresh(self) -> None:
        _e.check(_e.library().rtbus_engine_get_hand(self._engine._handle, self._index, ctypes.byref(self._in)))
        if self.reset or self.placed:
            self.position[:] = self.target
            self.velocity[:] = self.target_velocity if self.placed else 0.0

    @property
    def name(self) -> str:
        """ "haptic0"."""
        return self._in.name.decode()

    @property
    def away(self) -> bool:
        """Nobody holds the device: the tool touches nothing."""
        return self._in.tool == 0

    @property
    def spring(self) -> bool:
        """The tool is a mass on a spring: advance it, then move()."""
        return self._in.tool == 1

    @property
    def placed(self) -> bool:
        """The haptic loop simulates the tool: give contact()s, and apply pushes to the bodies."""
        return self._in.tool == 2

    @property
    def reset(self) -> bool:
        """The tool was put at the target, at rest."""
        return bool(self._in.reset)

    @property
    def mass(self) -> float:
        """Of the tool [kg]."""
        return self._in.mass_kg

    @property
    def radius(self) -> float:
        """Of the tool, a sphere [m]; 0: a point."""
        return self._in.radius_m

    @property
    def friction(self) -> float:
        """Coefficient of the tool [1]; multiply it with the body's."""
        return self._in.friction

    @property
    def stiffness(self) -> float:
        """Of the spring [N/m]."""
        return self._in.stiffness_n_per_m

    @property
    def damping(self) -> float:
        """Of the spring, on the relative velocity [N s/m]."""
        return self._in.damping_n_s_per_m

    @property
    def reach(self) -> float:
        """Give contacts with a gap up to this [m]."""
        return self._in.contact_reach_m

    @property
    def pushes(self) -> list[tuple[int, Vector, Vector]]:
        """(body, force [N], torque [N m]) of this hand on bodies, constant over the step, at their centres of mass.

        Force and torque: (3,), copies that stay.
        """
        rows = self._in.push[: self._in.pushes]
        return [(row.body, np.array(row.force_n), np.array(row.torque_n_m)) for row in rows]

    def free_step(self, dt: float) -> tuple[Vector, float]:
        """The tool's velocity (3,) [m/s] after ``dt`` seconds without contacts, and the mass [kg] that a contact meets.

        The spring is solved implicitly, so no stiffness and no step is too large: a = m + dt·b + dt²·k. A contact that
        changes the velocity by Δv takes the force a·Δv/dt.
        """
        mass = self.mass + dt * self.damping + dt * dt * self.stiffness
        pull = self.stiffness * (self.target - self.position) + self.damping * self.target_velocity + self.force
        return (self.mass * self.velocity + dt * pull) / mass, mass

    def move(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        contact_force: ArrayLike = _ZERO,
        orientation: ArrayLike = _NOT_TURNED,
        spring_force: ArrayLike | None = None,
    ) -> None:
        """Where the tool is after the step, and the force of the world on it.

        ``position`` (3,) [m], ``velocity`` (3,) [m/s], ``contact_force`` (3,): mean over the step [N], ``orientation``
        (4,): w, x, y, z. ``spring_force`` (3,): of the spring on it, mean over the step [N]; needed only where your
        step has several parts. Raises UnfitValue, ValueError or TypeError with the argument's name; nothing is taken.
        """
        out = self._out
        _e.put(out, position_m=position, velocity_m_s=velocity, contact_force_n=contact_force,
               orientation_wxyz=orientation, spring_force_n=_ZERO if spring_force is None else spring_force)
        out.contacts = int(any(out.contact_force_n))
        out.tells_spring_force = int(spring_force is not None)
        _e.check(_e.library().rtbus_engine_set_tool(self._engine._handle, self._index, ctypes.byref(out)))
        self.position[:] = out.position_m
        self.velocity[:] = out.velocity_m_s

    def contact(
        self,
        body: int,
        point: ArrayLike,
        normal: ArrayLike,
        gap: float,
        friction: float = 0.0,
        curvature: float = 0.0,
    ) -> None:
        """A place where the tool touches ``body`` or may soon.

        ``point`` (3,): on the body's surface [m]. ``normal`` (3,): unit, towards the tool. ``gap`` [m] from surface to
        surface, ``friction`` of the pair [1], not negative, ``curvature`` [1/m] of a ball's surface. Raises UnfitValue,
        ValueError or TypeError with the argument's name.
        """
        near = self._near
        near.body = _e.body_of("contact: body", body, self._engine.bodies)
        _e.put(near, point_m=point, normal=normal, gap_m=gap, friction=friction, curvature_per_m=curvature)
        _e.check(_e.library().rtbus_engine_add_contact(self._engine._handle, self._index, ctypes.byref(near)))


class Step:
    """One step: advance the world by ``dt`` seconds. Valid until the next one. The engine's thread."""

    def __init__(self, hands: list[Hand]) -> None:
        self.hands: list[Hand] = hands
        """The same objects in each step."""
        self.dt: float = 0.0
        """[s]"""
        self.index: int = 0
        """From 1."""


class Engine:
    """The engine's end of a session. One per process; one thread at a time.

    ``config``: session file; left out, `rtbus run` has named it. ``set``: keys to change. ``gives_bodies``: this
    engine tells bodies and contacts, so it serves the method local_contact. ``bodies``: how many; 0: those of the
    session's scene. Raises ConfigError for a wrong session file, AlreadyOwned when another engine serves the session.
    """

    def __init__(
        self,
        config: str | None = None,
        *,
        set: Mapping[str, object] | None = None,
        gives_bodies: bool = False,
        bodies: int = 0,
    ) -> None:
        self._handle: ctypes.c_void_p | None = None
        options = _e.make(_e.Options)
        options.config = None if config is None else str(config).encode()
        if set is not None:
            options.set = "\n".join(f"{key}={value}" for key, value in set.items()).encode()
        self._supervised = config is None
        options.gives = _e.GIVES_BODIES if gives_bodies else 0
        options.bodies = _e.whole("bodies", bodies)
        handle = ctypes.c_void_p()
        _e.check(_e.library().rtbus_engine_open(ctypes.byref(options), ctypes.byref(handle)))
        self._handle = handle
        info = _e.make(_e.Info)
        _e.check(_e.library().rtbus_engine_get_info(handle, ctypes.byref(info)))
        self.session: str = info.session.decode()
        """Its name."""
        self.dt: float = info.step_s
        """Length of a step [s]; with ``pace: free`` the longest."""
        self.gravity: Vector = np.array(info.gravity_m_s2)
        """Of the session's scene: (3,) [m/s²]."""
        self.bodies: int = info.bodies
        """How many there may be."""
        self.hands: list[Hand] = [Hand(self, i) for i in range(info.hands)]
        """Before the first step their name, mass, radius and friction are known."""
        for hand in self.hands:
            hand._refresh()
        self._body, self._support = _e.make(_e.Body), _e.make(_e.Support)

    def __iter__(self) -> Iterator[Step]:
        """A turn per step; what the turn before has set is published when the next one begins. Ends with the session.

        Other Python threads run while it waits. A full collection of garbage stops Python for as long as it takes: what
        exists at the first step is left alone.
        """
        step, raw = Step(self.hands), _e.make(_e.Step)
        gc.collect()
        gc.freeze()
        while self._handle is not None:
            try:
                _e.check(_e.library().rtbus_engine_begin(self._handle, ctypes.byref(raw)))
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
            _e.check(_e.library().rtbus_engine_finish(self._handle))

    def body(
        self,
        index: int,
        position: ArrayLike,
        orientation: ArrayLike = _NOT_TURNED,
        velocity: ArrayLike = _ZERO,
        angular_velocity: ArrayLike = _ZERO,
        *,
        kind: str = "static",
        mass: float = 0.0,
        inertia: ArrayLike = _ZERO,
        force: ArrayLike = _ZERO,
        torque: ArrayLike = _ZERO,
        friction_force: ArrayLike = _ZERO,
        friction_torque: ArrayLike = _ZERO,
        friction_bound: float = 0.0,
    ) -> None:
        """A body after the step, and what acts on it besides tools. Kept until it is set again.

        ``position`` (3,): of its centre of mass [m]. ``orientation`` (4,): w, x, y, z. ``velocity`` (3,) [m/s],
        ``angular_velocity`` (3,) [rad/s]. ``kind``: "static", "kinematic" or "dynamic". ``mass`` [kg]. ``inertia``
        (3,): principal moments [kg m²] about the axes that ``orientation`` turns. ``force`` (3,) [N], ``torque`` (3,)
        [N m]: gravity and normal forces of its contacts; ``friction_force``, ``friction_torque`` likewise of their
        friction, ``friction_bound`` [N] the sum of μ·N. Raises UnfitValue, ValueError or TypeError with the argument's
        name; the body stays as it was.
        """
        kinds = ("static", "kinematic", "dynamic")
        if kind not in kinds:
            raise ValueError(f"kind = {kind!r} is unknown; choose {', '.join(kinds)}")
        raw = self._body
        raw.kind = kinds.index(kind)
        _e.put(raw, position_m=position, orientation_wxyz=orientation, velocity_m_s=velocity,
               angular_velocity_rad_s=angular_velocity, mass_kg=mass, inertia_kg_m2=inertia, external_force_n=force,
               external_torque_n_m=torque, friction_force_n=friction_force, friction_torque_n_m=friction_torque,
               friction_bound_n=friction_bound)
        _e.check(_e.library().rtbus_engine_set_body(self._handle, _e.body_of("body", index, self.bodies), ctypes.byref(raw)))

    def shape(
        self,
        body: int,
        kind: str,
        size: ArrayLike = (),
        position: ArrayLike = _ZERO,
        orientation: ArrayLike = _NOT_TURNED,
    ) -> None:
        """What a body looks like, for viewers; once is enough. A body may have several shapes.

        ``kind``: "plane" (y = 0), "sphere", "box", "capsule" or "cylinder" (along y). ``size`` [m]: radius of a sphere;
        half edges (3,) of a box; (radius, length) of a capsule, with both caps, and of a cylinder. ``position`` (3,) [m]
        and ``orientation`` (4,): of the shape in the frame of the body.
        """
        if kind not in _e.SHAPES:
            raise ValueError(f"kind = {kind!r} is unknown; choose {', '.join(_e.SHAPES)}")
        number, sizes = _e.SHAPES[kind]
        given = np.atleast_1d(np.asarray(size))
        if given.shape != (sizes,):
            raise ValueError(f"size of a {kind} takes {sizes} numbers, and got an array of shape {given.shape}")
        raw = _e.make(_e.Shape)
        raw.kind = number
        _e.put(raw, size_m=[*given.tolist(), *[0.0] * (3 - sizes)], position_m=position, orientation_wxyz=orientation)
        at = _e.body_of("shape: body", body, self.bodies)
        _e.check(_e.library().rtbus_engine_add_shape(self._handle, at, ctypes.byref(raw)))

    def clear_shapes(self) -> None:
        """Forgets all shapes: the world will look otherwise."""
        _e.check(_e.library().rtbus_engine_clear_shapes(self._handle))

    def support(
        self,
        body: int,
        point: ArrayLike,
        normal: ArrayLike,
        force: float,
        friction: float = 0.0,
        points: int = 4,
        velocity: ArrayLike = _ZERO,
        inverse_mass: float = 0.0,
    ) -> None:
        """What holds a body up.

        ``point`` (3,): mean of the contact points [m]. ``normal`` (3,): unit, towards the body. ``force`` > 0 [N].
        ``friction`` [1], not negative. ``points``: contact points that carry. ``velocity`` (3,): of what holds, at the
        point [m/s]. ``inverse_mass``: of what holds [1/kg]; 0: no force moves it.
        """
        raw = self._support
        raw.body = _e.body_of("support: body", body, self.bodies)
        raw.points = _e.whole("support: points", points)
        _e.put(raw, point_m=point, normal=normal, force_n=force, friction=friction, surface_velocity_m_s=velocity,
               inverse_mass_per_kg=inverse_mass)
        _e.check(_e.library().rtbus_engine_add_support(self._handle, ctypes.byref(raw)))

    def close(self) -> None:
        """Ends the engine: its topics go, and the hand's force fades. May be called again."""
        if self._handle is not None:
            _e.library().rtbus_engine_close(self._handle)
            self._handle = None

    def __enter__(self) -> Engine:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __del__(self) -> None:
        if getattr(self, "_handle", None) is not None:
            self.close()
