"""A hypothesis at its best values."""

from dataclasses import dataclass

from contactsense.setup_check.findings.sensor_findings import rms
from contactsense.setup_check.fit.fitter import Fit, Fitter
from contactsense.setup_check.hypotheses.hypothesis import Hypothesis
from contactsense.setup_check.setup import Setup

_MIN_DROP = 0.1
"""The residual of a sensor must fall by this fraction: what leaves it as it is does not explain it."""
_REFINED = 2
"""Starts from which continuous parameters are fitted."""


@dataclass(frozen=True)
class Candidate:
    """A hypothesis, fitted."""

    hypothesis: Hypothesis
    fit: Fit
    start: Setup
    """Where the fit began."""
    others: tuple[Fit, ...] = ()
    """Fits from other starts."""

    @classmethod
    def of(cls, fitter: Fitter, hypothesis: Hypothesis) -> "Candidate":
        """The best of the hypothesis' starts; whatever else was estimated keeps its value."""
        fits = [(fitter.fit(start), start) for _, start in hypothesis.starts]
        fits.sort(key=lambda found: fitter.cost(found[0]))
        if hypothesis.free:
            fits = [(fitter.fit(start, hypothesis.free), start) for _, start in fits[:_REFINED]]
            fits.sort(key=lambda found: fitter.cost(found[0]))
        (best, start), *others = fits
        return cls(hypothesis, best, start, tuple(fit for fit, _ in others))

    def explains(self, before: Fit) -> bool:
        """Whether the residual of a sensor, or of the joint that the hypothesis is about, falls markedly."""
        if self.hypothesis.absorbed:
            return True
        count, joint = before.residual.shape[1], self.hypothesis.joint
        n = count - 6 * len(before.setup.sensors)
        groups = [slice(0, n), *(slice(first, first + 3) for first in range(n, count, 3))]
        if joint is not None:
            groups = [slice(joint, joint + 1)]
        pairs = [[rms(fit.residual[:, group]) for fit in (before, self.fit)] for group in groups]
        return any(b < (1.0 - _MIN_DROP) * a for a, b in pairs if a is not None and b is not None)
