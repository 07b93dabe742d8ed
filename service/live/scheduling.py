"""Scheduling of a process: in real time where that is permitted, otherwise with short time slices.

A process that answers within 2 ms must not wait until others have used up their time slices. A real-time
process (SCHED_FIFO) runs before all others; this requires root, CAP_SYS_NICE or LimitRTPRIO. Without these,
Linux 6.12 and later lets any process request a short time slice: the process is scheduled sooner after it
wakes up, but for a shorter time.
"""

import contextlib
import ctypes
import gc
import os
import platform
import struct
import sys
from typing import Literal

Scheduling = Literal["real time", "short slices", "normal"]

PIPELINE, WEB, RECORDER = 2, 1, 1
"""Real-time priorities: of the pipeline, of the web server while a controller waits for its answers, and of a
process that only records."""
SLICE = 100_000
"""The shortest time slice that Linux grants [ns]."""
SWITCH_INTERVAL = 5e-4
"""Longest time for which a thread holds the interpreter while others wait for it [s]."""
_SCHED_SETATTR = {"x86_64": 314, "aarch64": 274}
"""Number of the system call, for which neither Python nor the C library has a function."""
_ATTRIBUTES = struct.Struct("=IIQiIQQQ")
"""Size of this structure, policy, flags, nice value, priority, time slice [ns], and two unused fields."""


def prioritize(priority: int = 0, reset_on_fork: bool = False) -> Scheduling:
    """Give the calling thread the most urgent scheduling that is permitted.

    Args:
        priority: Real-time priority; 0: short time slices only. The kernel still reserves a share for other
            processes (sched_rt_runtime_us).
        reset_on_fork: Whether threads and processes that the thread starts later are scheduled normally.
    """
    if sys.platform != "linux":
        return "normal"
    reset = os.SCHED_RESET_ON_FORK if reset_on_fork else 0
    for found in range(priority, 0, -1):  # LimitRTPRIO may permit a lower one
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO | reset, os.sched_param(found))
            return "real time"
    return "short slices" if _shorten_slices() else "normal"


def deprioritize() -> None:
    """Undo `prioritize`: no real-time scheduling, but short time slices where they are available."""
    if sys.platform == "linux":
        # Only a privileged process may clear the flag that schedules its children normally.
        kept = os.sched_getscheduler(0) & os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, os.SCHED_OTHER | kept, os.sched_param(0))
        _shorten_slices()


def prefer_low_latency() -> None:
    """Reduce delays that are caused by the Python interpreter.

    Objects that exist now are excluded from garbage collection, because traversing all modules takes tens of
    milliseconds. A thread holds the interpreter for at most 0.5 ms at a time instead of 5 ms.
    """
    gc.collect()
    gc.freeze()
    sys.setswitchinterval(SWITCH_INTERVAL)


def _shorten_slices() -> bool:
    number = _SCHED_SETATTR.get(platform.machine())
    if number is None:
        return False
    nice = os.getpriority(os.PRIO_PROCESS, 0)
    reset = int(bool(os.sched_getscheduler(0) & os.SCHED_RESET_ON_FORK))
    attributes = _ATTRIBUTES.pack(_ATTRIBUTES.size, os.SCHED_OTHER, reset, nice, 0, SLICE, 0, 0)
    return bool(ctypes.CDLL(None).syscall(number, 0, attributes, 0) == 0)
