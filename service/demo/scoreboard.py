"""Compares the estimates of each scripted contact with the ground truth."""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from contactsense.service.api.messages import EstimateOut
from contactsense.service.mock.arm.simulated_arm import Motion, Touch

SETTLE = 0.2
"""Time for which the observer may still report a contact after its end [s]."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """Result for one scripted contact."""

    touch: Touch
    """Ground truth of the contact."""
    link: str | None
    """The link reported most often under full force; None if no contact was reported then."""
    share: float
    """Fraction of the samples under full force in which the true link was ranked first."""
    error: float
    """Distance of the estimated point from the true one under full force, median over samples with the true
    link [m]; NaN if there are none."""
    force_error: float
    """Magnitude of the difference between estimated and true force, median over the same samples [N]."""
    onset: float
    """Time from the onset of the force to the first estimate with the true link [s]; NaN if there is none."""

    @property
    def right(self) -> bool:
        """Whether the link is correct."""
        return self.link == self.touch.link


@dataclass(slots=True)
class _Entry:
    touch: Touch
    samples: int = 0
    links: Counter[str] = field(default_factory=Counter)
    errors: list[float] = field(default_factory=list)
    force_errors: list[float] = field(default_factory=list)
    onset: float = float("nan")


class Scoreboard:
    """Processes estimates one by one, and returns a verdict as soon as a contact has ended.

    Contacts of the script must not overlap in time.
    """

    def __init__(self, motion: Motion) -> None:
        self._rate = motion.rate
        self._open = [_Entry(touch) for touch in sorted(motion.touches, key=lambda touch: touch.start)]
        self.seen = 0
        """Number of processed estimates."""
        self.false_alarms = 0
        """Number of estimates with a contact while the script has none."""
        self.degraded: Counter[str] = Counter()
        """Number of degraded estimates, by their reason."""
        self._free_from = 0.0

    @property
    def done(self) -> bool:
        """Whether all contacts have ended."""
        return not self._open

    def take(self, estimate: EstimateOut) -> Verdict | None:
        """Process an estimate; returns the verdict on a contact that has ended, if there is one."""
        self.seen += 1
        if estimate.status == "degraded":
            self.degraded[estimate.reason] += 1
        t = estimate.t
        best = estimate.contacts[0] if estimate.contacts else None
        entry = self._open[0] if self._open else None
        if entry is None or t < entry.touch.start:
            if best is not None and t > self._free_from:
                self.false_alarms += 1
            return None
        touch = entry.touch
        if t > touch.stop:
            self._open.pop(0)
            self._free_from = touch.stop + SETTLE
            return _verdict(entry)
        right = best is not None and best.link == touch.link
        if right and np.isnan(entry.onset):
            entry.onset = t - touch.start
        index = min(max(round(t * self._rate) - touch.first, 0), len(touch.torsion) - 1)
        force = touch.force_base[index]
        if np.linalg.norm(force) > 0.99 * np.linalg.norm(touch.force_base, axis=1).max():
            entry.samples += 1
            if best is not None:
                entry.links[best.link] += 1
            if best is not None and right:
                entry.errors.append(float(np.linalg.norm(touch.point_base[index] - best.point_base)))
                entry.force_errors.append(float(np.linalg.norm(force - best.force_base)))
        return None


def _verdict(entry: _Entry) -> Verdict:
    named = entry.links.most_common(1)
    return Verdict(
        touch=entry.touch,
        link=named[0][0] if named else None,
        share=entry.links[entry.touch.link] / max(entry.samples, 1),
        error=float(np.median(entry.errors)) if entry.errors else float("nan"),
        force_error=float(np.median(entry.force_errors)) if entry.force_errors else float("nan"),
        onset=entry.onset,
    )
