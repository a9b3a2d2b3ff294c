"""Recordings (`rtbus record`) as numpy arrays. Needs h5py (Debian: python3-h5py)."""

from __future__ import annotations

import os
from dataclasses import dataclass
from types import TracebackType

import numpy as np


@dataclass(frozen=True)
class Mark:
    """An event that was noted during the recording."""

    stamp_ns: int
    text: str


class Recording:
    """A recording, open for reading; also one that was cut off. One thread at a time.

        with rtbus.Recording("trial1.h5") as recording:
            samples = recording["haptic0.telemetry"]
            samples["stamp_ns"], samples["force_n"], rtbus.units(samples)["force_n"]
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        try:
            import h5py
        except ImportError:
            raise ImportError("reading recordings needs h5py: install python3-h5py, or `pip install h5py`") from None
        self.path = str(path)
        self._file = h5py.File(path, "r")
        schema = self._file.attrs.get("schema", b"")
        if _text(schema) != "rtbus-recording/1":
            self._file.close()
            raise ValueError(f"{path}: not a recording of rtbus (schema is '{_text(schema)}')")

    @property
    def session(self) -> str:
        """Name of the session that was recorded."""
        return _text(self._file.attrs["session"])

    @property
    def topics(self) -> list[str]:
        """Names of the recorded topics."""
        return sorted(self._file["topics"])

    @property
    def marks(self) -> list[Mark]:
        """Events that were noted, in order of time."""
        group = self._file.get("marks")
        if group is None:
            return []
        return [Mark(int(s), _text(t)) for s, t in zip(group["stamp_ns"][:], group["text"][:])]

    @property
    def started_monotonic_ns(self) -> int:
        """When the recording began, on the clock of the stamps [ns]."""
        return int(self._file.attrs["started_monotonic_ns"])

    def __getitem__(self, topic: str) -> np.ndarray:
        """All samples of a topic: shape (samples,), with the fields ``sequence`` and ``stamp_ns`` [ns] before its own."""
        if topic not in self._file["topics"]:
            raise KeyError(f"{self.path} has no topic '{topic}'; it has {', '.join(self.topics)}")
        group = self._file["topics"][topic]
        columns = {name: each for name, each in group.items() if each.shape and name != "dropped"}
        order = sorted(columns, key=lambda n: (n != "sequence", n != "stamp_ns", int(columns[n].attrs.get("offset", 0))))
        rows = min((len(each) for each in columns.values()), default=0)  # the last row of a cut file may be incomplete
        units = {name: _text(columns[name].attrs.get("unit", b"")) for name in order}
        units.update({"sequence": "1", "stamp_ns": "ns"})
        dtype = np.dtype(
            [(name, columns[name].dtype, columns[name].shape[1:]) for name in order],
            metadata={"type": _text(group.attrs.get("type", b"")), "units": units},
        )
        out = np.empty(rows, dtype)
        for name in order:
            out[name] = columns[name][:rows]
        return out

    def seconds(self, topic: str) -> np.ndarray:
        """Stamps of a topic's samples: shape (samples,), seconds since the recording began."""
        return 1e-9 * (self._file["topics"][topic]["stamp_ns"][:].astype(np.int64) - self.started_monotonic_ns)

    def close(self) -> None:
        """Closes the file."""
        self._file.close()

    def __enter__(self) -> Recording:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _text(value: object) -> str:
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)
