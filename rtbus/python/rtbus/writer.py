"""Publishing topics."""

from __future__ import annotations

import ctypes
from types import TracebackType

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from . import _library as _c
from .types import SampleType, known_type, to_c


class Writer:
    """The writing end of a topic; made by :func:`publisher`. One thread at a time. Ends the topic when it is closed."""

    def __init__(self, session: str, name: str, type: SampleType, capacity: int, doorbell: bool, mode: int) -> None:
        self.session, self.name, self.type = session, name, type
        self._handle = None
        given, fields = to_c(type.name, type.dtype, type.units)
        options = _c.WriterOptions(ctypes.sizeof(_c.WriterOptions), capacity, int(doorbell), mode)
        handle = ctypes.c_void_p()
        _c.check(
            _c.lib.rtbus_writer_create(
                session.encode(), name.encode(), ctypes.byref(given), ctypes.byref(options), ctypes.byref(handle)
            )
        )
        del fields
        self._handle = handle
        self.sample: np.ndarray = type.zeros()
        """A sample to fill and publish: ``writer.sample["position_m"][:] = p; writer.publish()``."""
        self._sample_at = self.sample.ctypes.data

    @property
    def dtype(self) -> np.dtype:
        """numpy dtype of a sample."""
        return self.type.dtype

    @property
    def units(self) -> dict[str, str]:
        """Units of the fields, by their names."""
        return self.type.units

    def publish(self, sample: np.ndarray | np.void | None = None, stamp_ns: int = 0, **fields: ArrayLike) -> None:
        """Publishes ``sample``, or this writer's own one after setting ``fields`` in it.

        ``sample``: one, of ``dtype``. ``stamp_ns``: time that it belongs to [ns]; 0: now. Raises UnfitValue with the
        field's name when a number is not finite or impossible, or a time lies in the future; TypeError for an array of
        another dtype.
        """
        if self._handle is None:
            raise _c.Ended(f"the topic {self.name} has been closed")
        at = self._sample_at
        if sample is not None:
            if fields:
                raise TypeError("give either a sample or fields")
            sample = self._fitting(sample)
            at = sample.ctypes.data
        for name, value in fields.items():
            self._set(name, value)
        _c.check(_c.lib.rtbus_publish(self._handle, at, self.dtype.itemsize, stamp_ns))

    @property
    def observed(self) -> bool:
        """Somebody reads who asked to be noticed (``presence``)."""
        return bool(_c.check(_c.lib.rtbus_observed(self._handle)))

    def close(self) -> None:
        """Ends the topic; may be called again."""
        if self._handle is not None:
            _c.lib.rtbus_writer_close(self._handle)
            self._handle = None

    def _set(self, name: str, value: ArrayLike) -> None:
        if name not in self.dtype.names:
            raise TypeError(f"{self.type.name} has no field '{name}'; it has {', '.join(self.dtype.names)}")
        base, array = self.dtype[name].base, np.asarray(value)
        field = f"field '{name}' of {self.type.name}"
        carried = {"f": "fiub", "u": "iub", "i": "iub", "S": "SU"}[base.kind]
        if array.dtype.kind not in carried:
            raise TypeError(f"{field} is {base}, and got an array of {array.dtype}")
        if base.kind in "ui" and array.size and not np.all(
            (array >= np.iinfo(base).min) & (array <= np.iinfo(base).max)
        ):
            raise ValueError(f"{field} is {base}, from {np.iinfo(base).min} to {np.iinfo(base).max}, and got {value!r}")
        if base.kind == "S" and array.size and int(np.char.str_len(array).max()) > base.itemsize:
            raise ValueError(f"{field} holds a text of {base.itemsize} bytes, and got {value!r}")
        try:
            self.sample[name] = array
        except (TypeError, ValueError) as error:
            shape = self.sample[name].shape
            raise type(error)(f"{field} takes {shape or 'a number'}: {error}") from None

    def _fitting(self, sample: np.ndarray | np.void) -> np.ndarray:
        dtype = getattr(sample, "dtype", None)
        if dtype != self.dtype or np.size(sample) != 1:
            differing = ""
            if dtype is not None and dtype.names is not None:
                wrong = [n for n in self.dtype.names if n not in dtype.names or dtype[n] != self.dtype[n]]
                differing = f"; field '{wrong[0]}' differs" if wrong else ""
            raise TypeError(
                f"topic {self.name} takes one sample of {self.type.name} (writer.dtype), not "
                f"{'an array of ' + str(dtype) if dtype is not None else type(sample).__name__}{differing}"
            )
        return np.ascontiguousarray(sample)

    def __enter__(self) -> Writer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __del__(self) -> None:
        if getattr(self, "_handle", None) is not None:
            self.close()


def publisher(
    topic: str,
    type: str | SampleType | DTypeLike,
    session: str = "default",
    *,
    units: dict[str, str] | None = None,
    type_name: str = "",
    capacity: int = 64,
    doorbell: bool = False,
    mode: int = 0o600,
) -> Writer:
    """Creates a topic, or takes over that of a dead writer.

    ``type``: the name of a known type (``known_types()``), a SampleType, or a structured dtype; ``units`` and
    ``type_name`` (default: the topic's name) belong to the last. ``capacity``: samples that the ring holds, a power of
    two. ``doorbell``: readers that wait are woken at once. ``mode``: permissions of the shared memory. Any thread.
    """
    if isinstance(type, str):
        made = known_type(type)
    elif isinstance(type, SampleType):
        made = type
    else:
        made = SampleType(type_name or "user/" + topic, np.dtype(type), dict(units or {}))
    return Writer(session, topic, made, capacity, doorbell, mode)
