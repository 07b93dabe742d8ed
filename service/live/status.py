"""State of the whole service, computed from ages and counters by a pure function."""

from dataclasses import dataclass
from typing import Literal

Status = Literal["ok", "degraded", "starting", "waiting", "failing", "idle"]

STALE = 1.0
"""Reports, samples and estimates that are older than this are not current [s]."""


@dataclass(frozen=True, slots=True)
class Facts:
    """What is known about the pipeline; all ages refer to the present."""

    process: Literal["none", "starting", "running", "ended"]
    """none: no robot is configured; starting: nothing has been received yet; ended: it will be restarted."""
    end: str = ""
    """How the previous process ended; empty if there was none, or while the present one is healthy."""
    loading: str = ""
    """Progress of the compilation of its kernels; empty while nothing is compiled."""
    report_age: float = 0.0
    """Time since its latest message [s]."""
    sample_age: float | None = None
    """Time since the latest sample [s]; None before the first."""
    estimate_age: float | None = None
    """Time since the latest estimate arrived here [s]; None before the first."""
    connected: bool = False
    """Whether the robot's stream is connected, as last reported."""
    trouble: tuple[str, ...] = ()
    """Problems that the source of samples reports."""
    estimate: str = ""
    """Why the latest estimate is degraded; empty if it is not."""
    doubt: str = ""
    """Why the scene is in doubt; empty if it is not."""
    others: tuple[str, ...] = ()
    """Other problems in the service, such as a task that was restarted recently."""


def assess(facts: Facts) -> tuple[Status, tuple[str, ...]]:
    """Return the status and at least one reason for it, each a sentence for a technician."""
    if facts.process == "none":
        return "idle", ("no robot is configured: only POST /v1/locate and WS /v1/track work",)
    if facts.process == "ended" or (facts.process == "starting" and facts.end):
        return "failing", (f"the pipeline {facts.end}; it is being restarted", *facts.others)
    if facts.process == "starting":
        return "starting", (facts.loading or "the pipeline is loading its kernels", *facts.others)
    if facts.report_age > STALE:
        text = f"the pipeline has not reported for {facts.report_age:.1f} s; it is restarted if that lasts"
        return "failing", (text, *facts.others)
    if not facts.connected:
        found = facts.trouble or ("no data from the robot yet",)
        return "waiting", (*found, *facts.others)
    if facts.sample_age is None or facts.sample_age > STALE:
        age = "yet" if facts.sample_age is None else f"for {facts.sample_age:.1f} s"
        return "waiting", (
            f"no usable sample from the robot {age}",
            *facts.trouble,
            *facts.others,
        )
    if facts.estimate_age is None or facts.estimate_age > STALE:
        age = "yet" if facts.estimate_age is None else f"for {facts.estimate_age:.1f} s"
        return "failing", (
            f"samples arrive, but no estimate {age}; is this computer overloaded?",
            *facts.others,
        )
    estimate = (f"the latest estimate is degraded: {facts.estimate}",) if facts.estimate else ()
    if facts.trouble or facts.others:
        # Most degraded estimates follow from the trouble; an implausible value has a cause of its own.
        own = estimate if ": expected " in facts.estimate else ()
        doubt = (facts.doubt,) if facts.doubt and not own else ()
        return "degraded", (*facts.trouble, *facts.others, *own, *doubt)
    if estimate or facts.doubt:
        return "degraded", estimate or (facts.doubt,)
    return "ok", ("samples arrive and are estimated",)
