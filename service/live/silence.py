"""Measures how long a process has been silent although both it and the service had processor time.

When other programs load the computer, the service must not kill a healthy process. Therefore, time in which
the service's own event loop did not run does not count, nor does time in which the process was ready to run
but was not scheduled.
"""

from dataclasses import dataclass
from pathlib import Path

TICK = 0.1
"""Interval at which the silence is measured [s]."""
_STARVED = 0.2
"""A process that is ready to run but gets a smaller share of a processor than this is starved."""


@dataclass(frozen=True, slots=True)
class ProcessState:
    """State of a process as the operating system reports it."""

    letter: str
    """R: running or runnable; S, D: sleeping; T: stopped; Z: zombie; empty: unknown."""
    cpu: float
    """Processor time used so far [clock ticks]."""


def process_state(pid: int) -> ProcessState:
    """State of a process, from /proc on Linux; unknown on other systems."""
    try:
        # The name in parentheses may contain any character.
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return ProcessState("", 0.0)
    return ProcessState(fields[0], float(fields[11]) + float(fields[12]))


class Silence:
    """Silence of one process, measured in ticks.

    Args:
        now: Time on the event loop's clock [s].
        clock_ticks: Clock ticks per second of `ProcessState.cpu`.
    """

    def __init__(self, now: float, clock_ticks: float = 100.0) -> None:
        self._last = now
        self._cpu = 0.0
        self._clock_ticks = clock_ticks
        self.seconds = 0.0
        """Silence that counts [s]."""
        self.stopped = 0.0
        """Time in which the process was stopped or dead [s]."""

    def reset(self) -> None:
        """The process has sent a message."""
        self.seconds = self.stopped = 0.0

    def tick(self, now: float, state: ProcessState) -> None:
        """Update the times; called at every tick."""
        passed = now - self._last
        self._last = now
        used, self._cpu = (state.cpu - self._cpu) / self._clock_ticks, state.cpu
        counted = min(passed, 2.0 * TICK)  # the rest is a delay of our own event loop
        if state.letter in ("T", "t", "Z", "X"):
            self.stopped += counted
        else:
            self.stopped = 0.0
        if not (state.letter == "R" and used < _STARVED * passed):
            self.seconds += counted
