"""Demonstrations for robot learning: a recording cut into episodes, an HDF5 group each.

    python3 -m rtbus.episodes trial1.h5 -o demos.h5                # an episode between each two marks
    python3 -m rtbus.episodes trial1.h5 -o demos.h5 --button 0     # one for each time that button 0 is held

docs/recording.md has the layout. Needs h5py.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .recording import Recording

if TYPE_CHECKING:
    import h5py

SCHEMA = "rtbus-episodes/1"
_ACTIONS = ("position_m", "velocity_m_s", "buttons")
_OBSERVATIONS = ("proxy_position_m", "proxy_velocity_m_s")
_FORCES = ("force_n", "rendered_force_n")


@dataclass(frozen=True)
class Span:
    """An episode's time [ns], and its name: the text of the mark that begins it, or "button"."""

    begin_ns: int
    end_ns: int
    name: str


def spans_of_marks(recording: Recording) -> list[Span]:
    """From each mark to the next; what is before the first and after the last mark belongs to none."""
    marks = recording.marks
    return [Span(a.stamp_ns, b.stamp_ns, a.text) for a, b in zip(marks, marks[1:]) if b.stamp_ns > a.stamp_ns]


def spans_of_button(samples: np.ndarray, button: int) -> list[Span]:
    """While the button is held. ``samples``: shape (ticks,), of the telemetry."""
    held = (samples["buttons"] >> np.uint32(button)) & 1 == 1
    edges = np.flatnonzero(np.diff(np.concatenate([[False], held, [False]]).astype(np.int8)))
    stamps = samples["stamp_ns"]
    return [
        Span(int(stamps[a]), int(stamps[min(b, len(stamps) - 1)]), "button") for a, b in zip(edges[::2], edges[1::2])
    ]


def bodies_over_time(recording: Recording) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """(stamps (frames,) [ns], positions (frames, bodies, 3) [m], orientations (frames, bodies, 4)); None: not recorded."""
    if "physics.body_poses" not in recording.topics:
        return None
    samples = recording["physics.body_poses"]
    if not len(samples):
        return None
    bodies = int(samples["bodies"].max())
    frames, first = np.unique(samples["frame"], return_index=True)
    positions, turns = np.full((len(frames), bodies, 3), np.nan), np.full((len(frames), bodies, 4), np.nan)
    index = {int(frame): i for i, frame in enumerate(frames)}
    for sample in samples:
        begin, count = int(sample["first_body"]), int(sample["count"])
        positions[index[int(sample["frame"])], begin : begin + count] = sample["position_m"].reshape(-1, 3)[:count]
        turns[index[int(sample["frame"])], begin : begin + count] = sample["orientation_wxyz"].reshape(-1, 4)[:count]
    whole = ~np.isnan(positions).any(axis=(1, 2))
    return samples["stamp_ns"][first][whole].astype(np.int64), positions[whole], turns[whole]


def write_episode(
    group: h5py.Group,
    samples: np.ndarray,
    bodies: tuple[np.ndarray, np.ndarray, np.ndarray] | None,
    units: dict[str, str],
) -> None:
    """One episode: a row per tick of the haptic loop. ``samples``: shape (ticks,); ``bodies``: of bodies_over_time()."""
    stamps = samples["stamp_ns"].astype(np.int64)
    group.attrs["num_samples"] = len(samples)
    group.create_dataset("time_s", data=1e-9 * (stamps - stamps[0])).attrs["unit"] = "s"
    for name, fields in (("observations", _OBSERVATIONS), ("actions", _ACTIONS), ("forces", _FORCES)):
        part = group.create_group(name)
        for field in fields:
            part.create_dataset(field, data=samples[field]).attrs["unit"] = units[field]
    ages = group.create_group("ages")
    ages.create_dataset("proxy_age_s", data=1e-9 * samples["proxy_age_ns"]).attrs["unit"] = "s"
    if bodies is None:
        return
    body_stamps, positions, turns = bodies
    newest = np.searchsorted(body_stamps, stamps, side="right") - 1  # what was known at that tick
    known = np.clip(newest, 0, None)
    group["observations"].create_dataset("body_position_m", data=positions[known]).attrs["unit"] = "m"
    group["observations"].create_dataset("body_orientation_wxyz", data=turns[known]).attrs["unit"] = "1"
    age = np.where(newest >= 0, 1e-9 * (stamps - body_stamps[known]), np.nan)
    ages.create_dataset("body_age_s", data=age).attrs["unit"] = "s"


def export(source: str, target: str, button: int | None = None, haptic: str = "haptic0") -> int:
    """Writes the episodes of a recording. Returns how many. Raises ValueError when there is none."""
    import h5py

    with Recording(source) as recording:
        samples = recording[f"{haptic}.telemetry"]
        spans = spans_of_marks(recording) if button is None else spans_of_button(samples, button)
        bodies = bodies_over_time(recording)
        cut = [(span, samples[(samples["stamp_ns"] >= span.begin_ns) & (samples["stamp_ns"] < span.end_ns)]) for span in spans]
        cut = [(span, part) for span, part in cut if len(part) > 1]
        if not cut:
            how = "has fewer than two marks" if button is None else f"never has button {button} held"
            raise ValueError(f"{source} {how}: nothing to cut into episodes")
        units = dict(samples.dtype.metadata["units"])
        with h5py.File(target, "w") as out:
            out.attrs.update({"schema": SCHEMA, "session": recording.session, "source": str(source), "haptic": haptic})
            for i, (span, part) in enumerate(cut):
                group = out.create_group(f"data/episode_{i:04d}")
                group.attrs["name"] = span.name
                write_episode(group, part, bodies, units)
        return len(cut)


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python3 -m rtbus.episodes", description="Cuts a recording into episodes.")
    parser.add_argument("recording")
    parser.add_argument("-o", "--output", required=True, help="HDF5 file to write")
    parser.add_argument("--button", type=int, help="an episode is while this button is held (default: from mark to mark)")
    parser.add_argument("--haptic", default="haptic0", help="haptic node [haptic0]")
    given = parser.parse_args()
    try:
        count = export(given.recording, given.output, given.button, given.haptic)
    except (ValueError, KeyError, OSError) as error:
        print(f"rtbus.episodes: {error}")
        return 1
    print(f"{count} episodes written to {given.output}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
