"""How urgently a process is scheduled: in real time where that is permitted, else with short time slices.

A process that answers within 2 ms must not wait until others have used up their time slices. In real time
(SCHED_FIFO) it runs before all that are not; this takes root, CAP_SYS_NICE or LimitRTPRIO. Without it, Linux
from 6.12 lets any process ask for a short time slice: it is chosen sooner when it wakes up, for less at a
time.
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

PIPELINE, WEB = 2, 1
"""Priorities in real time: where samples are worked off, and of the web server while a controller is waiting
for its answers."""
SLICE = 100_000
"""The shortest time slice that Linux grants [ns]."""
SWITCH_INTERVAL = 5e-4
"""For how long a thread holds the interpreter while others wait for it [s]."""
_SCHED_SETATTR = {"x86_64": 314, "aarch64": 274}
"""Number of the system call, for which neither Python nor the C library has a function."""
_ATTRIBUTES = struct.Struct("=IIQiIQQQ")
"""Size of this, policy, flags, nice value, priority, time slice [ns], and two that are not used here."""


def hurry(priority: int = 0, alone: bool = False) -> Scheduling:
    """Have the calling thread scheduled as urgently as permitted.

    Args:
        priority: In real time; 0: short time slices only. The kernel leaves others a share all the same
            (sched_rt_runtime_us).
        alone: Whether threads and processes that it starts later are to be scheduled normally.
    """
    if sys.platform != "linux":
        return "normal"
    reset = os.SCHED_RESET_ON_FORK if alone else 0
    for found in range(priority, 0, -1):  # LimitRTPRIO may permit a lower one
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO | reset, os.sched_param(found))
            return "real time"
    return "short slices" if _shorten_slices() else "normal"


def relax() -> None:
    """Take back what `hurry` did: no real time any more, short slices where they are to be had."""
    if sys.platform == "linux":
        # Only a privileged process may take back that its children are scheduled normally.
        kept = os.sched_getscheduler(0) & os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, os.SCHED_OTHER | kept, os.sched_param(0))
        _shorten_slices()


def favour_latency() -> None:
    """Keep Python itself from holding up whoever waits for an answer.

    Garbage collection leaves out what exists by now, as walking through all modules takes tens of
    milliseconds. Another thread holds the interpreter for 0.5 ms instead of 5 ms at a time.
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
