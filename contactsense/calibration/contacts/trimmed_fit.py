"""A fit to the quietest part of the recordings, from which contacts stand out.

Huber's weights bound the influence of a single residual, but not that of a push that lasts: a fit with them
leans towards it and hides it. Here the linearized equations are solved for the fraction of the samples with
the smallest energy, and that fraction is chosen again, until it stays the same (the concentration steps of P.
J. Rousseeuw, K. Van Driessen, "Computing LTS regression for large data sets", Data Mining and Knowledge
Discovery 2006). Up to the remaining fraction of the time may be contact.

What was not fitted may differ from the model by the uncertainty of its parameters. Where a motion repeats
itself, or is short, this is more than the model error.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from contactsense.calibration.calibration_model import CalibrationModel
from contactsense.calibration.fit.robust_least_squares import RobustFit, fit_robust
from contactsense.calibration.fit.sandwich_covariance import sandwich_covariance
from contactsense.calibration.free_motion import FreeMotion
from contactsense.calibration.parameters import NOT_NEGATIVE, Entry, apply_step, value
from contactsense.calibration.residuals.equations import channels, linearize_all
from contactsense.calibration.residuals.recording_residuals import samples_of_rows
from contactsense.calibration.residuals.residual_jacobian import Rows

QUIET = 0.6
"""Fraction of the samples that is fitted, of all recordings with the same sensors: with fewer sensors the
energy is lower."""
WINDOW = 0.3
"""Residuals are averaged over this time [s]."""
_STEPS = 10
"""Steps after which the fit ends, even if the samples that it uses still change."""


@dataclass(frozen=True)
class TrimmedFit:
    """Result of `trimmed_fit`. C equations."""

    arm: CalibrationModel
    uncertainty: list[np.ndarray]
    """Standard deviation of each sample's residual, averaged over `WINDOW`, that follows from that of the
    parameters, shape (N, C) for each recording [Nm, or N and Nm]."""


def trimmed_fit(
    arm: CalibrationModel,
    start: CalibrationModel,
    recordings: list[FreeMotion],
    selected: tuple[Entry, ...],
    free: np.ndarray,
) -> TrimmedFit:
    """The arm that explains the quietest part of the recordings; `arm` if that part does not determine the
    parameters.

    Args:
        arm: A fit to all of them, about which the equations are linearized.
        start: The scene's values.
        recordings: The motion, as it was given; samples that they leave out do not count.
        selected: The parameters.
        free: Which of them are estimated, shape (k,), bool.
    """
    bandwidth = start.scene.bandwidth
    everything = [linearize_all(arm, recording, selected, bandwidth) for recording in recordings]
    usable = np.concatenate([part.usable[samples_of_rows(part, bandwidth)] for part in recordings])
    offset = np.array([value(arm, entry) - value(start, entry) for entry in selected])
    prior = np.array([entry.prior_std for entry in selected])
    count = channels(start.scene)
    # Friction and rotors are not negative.
    lowest = np.array([-value(arm, x) if x.group in NOT_NEGATIVE else -np.inf for x in selected])
    fit: RobustFit | None = None
    quiet: np.ndarray | None = None
    sensors = [(part.torque is not None, *sorted(part.readings)) for part in recordings]
    lengths = [len(rows[0].residual) for rows in everything]
    group = np.repeat([sensors.index(own) for own in sensors], lengths)
    for _ in range(_STEPS):
        step = np.zeros(len(selected)) if fit is None else fit.step
        chosen = _quietest(everything, usable, group, step, count, quiet)
        if quiet is not None and np.mean(chosen != quiet) < 0.01:
            break
        quiet = chosen
        masks = np.split(quiet, np.cumsum(lengths)[:-1])
        fitted = [
            replace(row, moving=row.moving & mask)
            for part, mask in zip(everything, masks, strict=True)
            for row in part
        ]
        try:
            fit = _fit(fitted, prior, offset, free, count, lowest)
        except np.linalg.LinAlgError:
            break
        rows = fitted
    if fit is None:
        return TrimmedFit(arm, [np.zeros((len(recording.t), count)) for recording in recordings])
    covariance = sandwich_covariance(rows, fit, prior, free)
    uncertainty = []
    for part, recording in zip(everything, recordings, strict=True):
        samples = np.arange(len(recording.t))
        of_rows = samples[samples_of_rows(recording, bandwidth)]
        uncertainty.append(_uncertainty(part, covariance, samples, of_rows, count))
    return TrimmedFit(apply_step(arm, selected, fit.step), uncertainty)


def _uncertainty(
    rows: list[Rows], covariance: np.ndarray, samples: np.ndarray, of_rows: np.ndarray, equations: int
) -> np.ndarray:
    """`TrimmedFit.uncertainty` of one recording; `of_rows`: sample of each row."""
    found = np.zeros((len(samples), equations))
    for row in rows:
        mean = uniform_filter1d(row.slope, max(1, round(WINDOW / row.dt)), axis=0)
        variance = np.einsum("ni,ij,nj->n", mean, covariance[np.ix_(row.columns, row.columns)], mean)
        found[:, row.channel] = np.interp(samples, of_rows, np.sqrt(np.maximum(variance, 0.0)))
    return found


def _fit(
    rows: list[Rows],
    prior: np.ndarray,
    offset: np.ndarray,
    free: np.ndarray,
    count: int,
    lowest: np.ndarray,
) -> RobustFit:
    """Solve for the free parameters. No step is below `lowest`, shape (k,).

    The quiet samples alone may not tell two parts of friction apart: a negative one and a large other one
    then cancel there, and nowhere else.
    """
    free, bound = free.copy(), np.zeros(len(free))
    while True:
        moved = [replace(row, residual=row.residual + row.slope @ bound[row.columns]) for row in rows]
        fit = fit_robust(moved, prior, offset + bound, free, count)
        step = bound + fit.step
        below = np.where(free, step - lowest, 0.0) / prior
        worst = int(np.argmin(below))
        if below[worst] >= 0.0:
            return replace(fit, step=step)
        # One at a time, as the others follow it.
        free[worst], bound[worst] = False, lowest[worst]


def _quietest(
    everything: list[list[Rows]],
    usable: np.ndarray,
    group: np.ndarray,
    step: np.ndarray,
    equations: int,
    quiet: np.ndarray | None,
) -> np.ndarray:
    """The usable rows with the smallest energy after a step, of all recordings in turn, bool: the same
    fraction of the rows of each `group`."""
    count = sum(len(rows[0].residual) for rows in everything)
    size = np.zeros((count, equations))
    first = 0
    for rows in everything:
        last = first + len(rows[0].residual)
        for row in rows:
            residual = row.residual + row.slope @ step[row.columns]
            mean = uniform_filter1d(residual, max(1, round(WINDOW / row.dt)))
            size[first:last, row.channel] = np.where(row.moving, np.abs(mean), 0.0)
        first = last
    known = usable if quiet is None else quiet
    spread = np.array([_median(size[known & (size[:, c] > 0.0), c]) for c in range(equations)])
    energy = np.sum((size / spread) ** 2, axis=1)
    chosen = np.zeros(count, dtype=bool)
    for number in np.unique(group[usable]):
        own = usable & (group == number)
        chosen |= own & (energy <= np.quantile(energy[own], QUIET))
    return chosen


def _median(values: np.ndarray) -> float:
    return max(float(np.median(values)), 1e-9) if len(values) else 1.0
