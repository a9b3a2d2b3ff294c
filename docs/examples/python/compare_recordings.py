"""How far two recordings of the same motion differ in force: compare_recordings.py A.h5 B.h5 [TOPIC] (needs h5py)."""
import sys

import numpy as np
import rtbus


def force_over_time(path, topic):
    """Seconds since the first contact, and force [N], of a recording."""
    with rtbus.Recording(path) as recording:
        samples = recording[topic]
    force = samples["force_n"]
    touched = np.flatnonzero(np.linalg.norm(force, axis=1) > 0.05)
    begin = touched[0] if len(touched) else 0
    stamps = samples["stamp_ns"].astype(np.int64)
    return 1e-9 * (stamps - stamps[begin]), force


def main(first, second, topic="haptic0.telemetry"):
    time_a, force_a = force_over_time(first, topic)
    time_b, force_b = force_over_time(second, topic)
    begin, end = max(time_a[0], time_b[0]), min(time_a[-1], time_b[-1])
    time = np.arange(begin, end, 1e-3)
    at = [np.stack([np.interp(time, t, f[:, axis]) for axis in range(3)], 1) for t, f in ((time_a, force_a), (time_b, force_b))]
    difference = np.linalg.norm(at[0] - at[1], axis=1)
    print(f"{len(time)} ms in common: RMS {np.sqrt(np.mean(difference**2)):.4f} N, largest {difference.max():.4f} N")


if __name__ == "__main__":
    main(*sys.argv[1:])
