"""Types of samples: the bus's descriptions as numpy dtypes, and back. Any thread."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np

from . import _library as _c

_SCALARS = {1: "<f8", 2: "<u8", 3: "<i8", 4: "<u4", 5: "<i4", 6: "u1"}
_NUMBERS = {np.dtype(text): number for number, text in _SCALARS.items()}
_TEXT = 7


@dataclass(frozen=True)
class SampleType:
    """A type of samples: its name, its numpy dtype, and the units of its fields."""

    name: str
    dtype: np.dtype
    units: dict[str, str]

    def zeros(self) -> np.ndarray:
        """One sample, all zero, as a 0-d structured array: ``sample["position_m"][:] = …``."""
        return np.zeros((), self.dtype)


def from_c(given: _c.Type) -> SampleType:
    """From a filled rtbus_type."""
    fields, units = [], {}
    for i in range(given.field_count):
        field = given.fields[i]
        name = field.name.decode()
        units[name] = field.unit.decode()
        if field.type == _TEXT:
            shape = () if field.inner in (0, 1) else (field.count // field.inner,)
            fields.append((name, f"S{field.count if not shape else field.inner}", shape))
        else:
            shape = () if field.count == 1 else (field.count,)
            if field.inner > 1:
                shape = (field.count // field.inner, field.inner)
            fields.append((name, _SCALARS[field.type], shape))
    name = given.name.decode()
    dtype = np.dtype(fields)
    if dtype.itemsize != given.bytes:
        raise _c.LayoutMismatch(f"{name}: its fields take {dtype.itemsize} bytes and its samples {given.bytes}")
    return SampleType(name, np.dtype(dtype, metadata={"type": name, "units": units}), units)


def to_c(name: str, dtype: np.dtype, units: dict[str, str]) -> tuple[_c.Type, ctypes.Array]:
    """To an rtbus_type. The second value owns the fields: keep it as long as the first."""
    if dtype.names is None:
        raise TypeError(f"{name}: a sample needs a structured dtype, for example [('force_n', 'f8', 3)]; got {dtype}")
    for unknown in units.keys() - set(dtype.names):
        raise ValueError(f"{name}: there is no field '{unknown}' to have a unit; fields are {', '.join(dtype.names)}")
    fields = (_c.Field * len(dtype.names))()
    for field, field_name in zip(fields, dtype.names):
        part, offset = dtype.fields[field_name][:2]
        base, shape = part.subdtype if part.subdtype else (part, ())
        if base.kind == "S":
            field.type, per_element = _TEXT, base.itemsize
        elif base in _NUMBERS:
            field.type, per_element = _NUMBERS[base], 1
        else:
            raise TypeError(
                f"{name}: field '{field_name}' is {base}, which the bus does not carry; "
                "use f8, u8, i8, u4, i4, u1 (little-endian) or S for text"
            )
        field.name = field_name.encode()
        field.unit = units.get(field_name, "" if base.kind == "S" else "1").encode()
        field.offset = offset
        field.count = per_element * int(np.prod(shape, dtype=int))
        if base.kind == "S":
            field.inner = per_element if shape else 1
        else:
            field.inner = shape[-1] if len(shape) > 1 else 1
    out = _c.Type(struct_bytes=ctypes.sizeof(_c.Type), name=name.encode(), bytes=dtype.itemsize)
    out.field_count = len(fields)
    out.fields = fields
    return out, fields


def known_type(name: str) -> SampleType:
    """A type that the nodes exchange, by its name: ``known_type("rtbus/ProxyState")``."""
    given = _c.Type(struct_bytes=ctypes.sizeof(_c.Type))
    _c.check(_c.lib.rtbus_known_type(name.encode(), ctypes.byref(given)))
    return from_c(given)


def known_types() -> list[str]:
    """Names of the types that the nodes exchange."""
    names = []
    while (name := _c.lib.rtbus_known_type_name(len(names))) is not None:
        names.append(name.decode())
    return names


def units(of: object) -> dict[str, str]:
    """Units of the fields of a topic, a sample, a block or a recording's array, by the fields' names."""
    if hasattr(of, "units"):
        return of.units  # a Topic, a Writer, a SampleType
    metadata = getattr(getattr(of, "dtype", of), "metadata", None) or {}
    return dict(metadata.get("units", {}))
