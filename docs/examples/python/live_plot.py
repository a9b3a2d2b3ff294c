"""Force and position of a hand while the session runs: live_plot.py [SESSION] [--save FILE.png] (needs matplotlib)."""
import sys

import numpy as np
import rtbus

SECONDS = 5.0


def curves(topic, seconds):
    """Blocks of (time [s], vertical position [mm], vertical force [N])."""
    begin_ns = None
    for block in topic.blocks(timeout=2.0, gather=0.05):
        begin_ns = begin_ns or topic.stamps["stamp_ns"][0]
        time = 1e-9 * (topic.stamps["stamp_ns"] - begin_ns)
        yield time, 1e3 * block["position_m"][:, 1], block["force_n"][:, 1]
        if seconds and time[-1] > seconds:
            return


def main(arguments):
    save = arguments[arguments.index("--save") + 1] if "--save" in arguments else None
    names = [a for a in arguments if not a.startswith("--") and a != save]
    import matplotlib

    if save:
        matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (above, below) = plt.subplots(2, 1, sharex=True)  # takes its time: samples come from open() on
    above.set_ylabel("position y [mm]")
    below.set_xlabel("time [s]")
    lines = above.plot([], [])[0], below.plot([], [])[0]
    with rtbus.open("haptic0.telemetry", names[0] if names else None) as topic:
        below.set_ylabel(f"force y [{topic.units['force_n']}]")
        kept = np.zeros((3, 0))
        for block in curves(topic, SECONDS if save else None):
            kept = np.hstack([kept, block])
            kept = kept[:, kept[0] > kept[0, -1] - SECONDS]
            if save:
                continue
            show(lines, (above, below), kept)
            plt.pause(0.01)
        if save:
            show(lines, (above, below), kept)
            figure.savefig(save)
        print(f"{kept.shape[1]} samples shown, {topic.missed} missed, at most {topic.longest_away:.3f} s between two reads")


def show(lines, axes, kept):
    for line, axis, values in zip(lines, axes, kept[1:]):
        line.set_data(kept[0], values)
        axis.relim()
        axis.autoscale_view()


if __name__ == "__main__":
    main(sys.argv[1:])
