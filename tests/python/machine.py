"""Whether this machine could do what a test in real time asked of it: tools/evaluation/shared/machine_load.hpp for Python.

A figure that misses its bar while the machine stood still says nothing about this program. Such a check is not judged,
and the test says why.
"""

import os
import resource
import threading
import time
import unittest

import numpy as np

PAUSE_S = 0.02  # a thread that does nothing is woken so late only when the machine pauses, or is full
PERIOD_S = 0.002
# As in machine_load.cpp: less was seen to change no figure.
STOLEN, OTHERS, WAITED = 0.01, 0.10, 0.05


class _Sums:
    """Since boot [s]: of the usable CPUs, and of this process with the children that it has waited for."""

    def __init__(self):
        per_s, self.cpus = os.sysconf("SC_CLK_TCK"), os.sched_getaffinity(0)
        names = {f"cpu{cpu}" for cpu in self.cpus}
        with open("/proc/stat") as file:
            rows = [[float(each) for each in line.split()[1:9]] for line in file if line.split()[0] in names]
        user, nice, system, _, _, irq, softirq, stolen = (sum(column) / per_s for column in zip(*rows))
        self.busy_s, self.stolen_s = user + nice + system + irq + softirq, stolen
        used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        self.own_s = sum(each.ru_utime + each.ru_stime for each in used)
        try:
            with open("/proc/pressure/cpu") as file:
                self.waited_s = 1e-6 * float(file.readline().rpartition("total=")[2])
        except OSError:  # the kernel does not tell
            self.waited_s = None
        self.time_s = time.monotonic()


class Machine:
    """Watches while its block runs: an empty loop on each CPU notes when it was woken late.

    What sessions took is not "others": ask after they have ended.
    """

    def __init__(self):
        self._spans, self._end, self._began = [], threading.Event(), _Sums()
        self._loops = [threading.Thread(target=self._watch, args=(cpu,), daemon=True) for cpu in os.sched_getaffinity(0)]

    def _watch(self, cpu):
        os.sched_setaffinity(0, {cpu})  # of this thread
        before = time.monotonic_ns()
        while not self._end.is_set():
            time.sleep(PERIOD_S)
            now = time.monotonic_ns()
            if now - before > 1e9 * (PERIOD_S + PAUSE_S):
                self._spans.append((before, now))
            before = now

    def __enter__(self):
        for loop in self._loops:
            loop.start()
        return self

    def __exit__(self, *_):
        self._end.set()
        for loop in self._loops:
            loop.join()

    @property
    def evidence(self):
        """What stood in the way, for people; "" when nothing did."""
        out, spans, begin, now = [], list(self._spans), self._began, _Sums()
        if spans:
            longest = max(end - begin for begin, end in spans)
            out.append(f"this machine paused {len(spans)} times, for up to {1e-6 * longest:.0f} ms")
        time_s = now.time_s - begin.time_s
        had_s = max(1e-9, time_s * len(now.cpus))
        others = (now.busy_s - begin.busy_s - (now.own_s - begin.own_s)) / had_s
        waited = 1.0 if now.waited_s is None else (now.waited_s - begin.waited_s) / time_s
        if others > OTHERS and waited > WAITED:
            out.append(f"other programs took {100 * others:.0f} % of the CPU time, tasks waited {100 * waited:.0f} % of it")
        stolen = (now.stolen_s - begin.stolen_s) / had_s
        if stolen > STOLEN:
            out.append(f"the hypervisor took {100 * stolen:.1f} % of the CPU time")
        return "; ".join(out)

    def was_quiet(self, stamps_ns, settle_s):
        """Of each stamp: no pause holds it, and none ended less than ``settle_s`` before it."""
        stamps = np.asarray(stamps_ns).astype(np.int64)
        quiet = np.ones(len(stamps), bool)
        for begin, end in list(self._spans):
            quiet &= (stamps < begin) | (stamps > end + int(1e9 * settle_s))
        return quiet

    def judge(self, holds, what):
        """A check that a machine which stood in the way may have spoilt: it ends the test as skipped, with the reason."""
        if holds:
            return
        if evidence := self.evidence:
            said = f"{what.splitlines()[0]} {evidence}"  # without the log
            print(f"NOT JUDGED: {said}", flush=True)
            raise unittest.SkipTest(said)
        raise AssertionError(what)
