"""For how long a process has been silent although it and we had the chance to talk.

A service under somebody else's load must not kill a healthy process: time in which our own event loop did
not run does not count, nor does time in which the process wanted to run and was not given a processor.
"""

from dataclasses import dataclass
from pathlib import Path

TICK = 0.1
"""How often the silence is measured [s]."""
_STARVED = 0.2
"""A process that is ready to run and gets a smaller share of a processor than this is starved."""


@dataclass(frozen=True, slots=True)
class ProcessState:
    """What the operating system says of a process."""

    letter: str
    """R: runs or wants to; S, D: waits; T: stopped; Z: dead and not yet waited for; empty: unknown."""
    cpu: float
    """Processor time so far [clock ticks]."""


def process_state(pid: int) -> ProcessState:
    """The state of a process, from Linux' /proc; unknown elsewhere."""
    try:
        # The name in parentheses may hold anything.
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return ProcessState("", 0.0)
    return ProcessState(fields[0], float(fields[11]) + float(fields[12]))


class Silence:
    """Silence of one process, measured by ticks.

    Args:
        now: Time on the event loop's clock [s].
        clock_ticks: Clock ticks a second of `ProcessState.cpu`.
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
        """It has sent something."""
        self.seconds = self.stopped = 0.0

    def tick(self, now: float, state: ProcessState) -> None:
        """Some time has passed."""
        passed = now - self._last
        self._last = now
        used, self._cpu = (state.cpu - self._cpu) / self._clock_ticks, state.cpu
        counted = min(passed, 2.0 * TICK)  # the rest of a late tick is our own lateness
        if state.letter in ("T", "t", "Z", "X"):
            self.stopped += counted
        else:
            self.stopped = 0.0
        if not (state.letter == "R" and used < _STARVED * passed):
            self.seconds += counted
