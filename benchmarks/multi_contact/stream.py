"""Two contacts in a simulated live stream: the second starts after the first and ends before it."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from contactsense import Estimate, Localizer, Sample
from contactsense.benchmarks.multi_contact.measure import WITHIN, match
from contactsense.benchmarks.multi_contact.trials import Push, Trial, Trials
from contactsense.benchmarks.static_truth.cases import Noise
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.inverse_dynamics import inverse_dynamics
from contactsense.kinematics.model import build_model, empty_motion

STEP = 0.002
"""Sample time [s]."""
RAMP = 0.03
"""Rise and fall time of a force [s]."""
FIRST, SECOND = (0.3, 2.2), (1.2, 1.8)
"""Intervals in which the contacts act [s]."""
DURATION = 2.1
SETTLING_TIME = 0.15
"""Time after an onset or release from which estimates are evaluated [s]."""
MODULATION = 0.4
"""Relative amplitude of the modulation of the first force."""
RATES = np.array([2.0, 1.5, 2.5, 3.0, 2.0, 1.0])
"""Angular frequencies of the motions of the joints [rad/s]."""


def measure_stream(
    localizer: Localizer,
    noise: Noise,
    streams: int,
    speed: float,
    *,
    force: float = 20.0,
    seed: int = 1,
    tick: Callable[[], object] = lambda: None,
) -> dict[str, Any]:
    """Track two contacts on different links in many streams.

    Args:
        localizer: Of a scene with several contacts.
        noise: Added to every sample.
        streams: Number of streams.
        speed: Maximum speed of each joint [rad/s].
        force: Magnitude of each force [N].
        seed: Random seed.
        tick: Called after each stream.

    Returns:
        Plain numbers: `found`: share of the streams in which the median error of both contacts is within
        `WITHIN`; `median_mm`, `p95_mm`: error of the worse contact of a stream; `delay_ms`: median time
        until the second contact is reported; `never`: share in which it never is; `false`: share in which
        several contacts are reported while there is one; `back`: share in which the first contact is
        within `WITHIN` again after the release of the second; `ms`: 99th percentile of the time of a step.
    """
    trials = Trials(localizer.scene, seed)
    errors, delays, false, recovered, seconds = [], [], [], [], []
    for k in range(streams):
        trial = trials.draw(2, force, "different")
        worst_errors, false_multiple, after_errors, delay = [], [], [], np.inf
        localizer.reset()
        for sample, points in samples(localizer, trial, noise, speed, seed + k):
            start = time.perf_counter()
            estimate = localizer.step(sample)
            seconds.append(time.perf_counter() - start)
            t = sample.t
            if t < SECOND[0]:
                false_multiple.append(estimate.status == "multiple")
            elif t < SECOND[1] and estimate.status == "multiple":
                delay = min(delay, t - SECOND[0])
            if SECOND[0] + SETTLING_TIME < t < SECOND[1] - RAMP:
                worst_errors.append(_worst(estimate, points))
            elif t > SECOND[1] + SETTLING_TIME:
                after_errors.append(_worst(estimate, points))
        errors.append(np.median(worst_errors))
        delays.append(delay)
        false.append(any(false_multiple))
        recovered.append(np.median(after_errors) <= WITHIN)
        tick()
    return {
        "speed": speed,
        "streams": streams,
        "found": float(np.mean(np.array(errors) <= WITHIN)),
        "median_mm": float(1e3 * np.quantile(errors, 0.5, method="higher")),
        "p95_mm": float(1e3 * np.quantile(errors, 0.95, method="higher")),
        "delay_ms": float(1e3 * np.quantile(delays, 0.5, method="higher")),
        "never": float(np.mean(np.isinf(delays))),
        "false": float(np.mean(false)),
        "back": float(np.mean(recovered)),
        "ms": float(1e3 * np.quantile(seconds, 0.99)),
    }


def _worst(estimate: Estimate, points: list[np.ndarray]) -> float:
    found = estimate.contacts if estimate.status == "multiple" else estimate.contacts[:1]
    return float(match(found, points).max())


def samples(
    localizer: Localizer, trial: Trial, noise: Noise, speed: float, seed: int
) -> Iterator[tuple[Sample, list[np.ndarray]]]:
    """Samples of one stream, and the points of the active contacts, base frame."""
    scene = localizer.scene
    model, motion = build_model(scene.robot), empty_motion(len(trial.q))
    torque, wrench = np.empty(len(trial.q)), np.empty(6)
    rng = np.random.default_rng(seed)
    rates = np.resize(RATES, len(trial.q))
    forward_kinematics(model, trial.q, motion)
    rotations = [motion.rotation[push.link].copy() for push in trial.pushes]
    local = [
        (R.T @ (push.point - motion.origin[push.link]), R.T @ push.force, R.T @ push.normal)
        for R, push in zip(rotations, trial.pushes, strict=True)
    ]
    for t in np.arange(0.0, DURATION, STEP):
        q = trial.q + speed / rates * np.sin(rates * t)
        qd, qdd = speed * np.cos(rates * t), -speed * rates * np.sin(rates * t)
        inverse_dynamics(model, q, qd, qdd, scene.gravity_base, motion, torque, wrench)
        points = []
        for push, (point, force, normal), (start, stop) in zip(
            trial.pushes, local, (FIRST, SECOND), strict=True
        ):
            if not start <= t < stop:
                continue
            R, o = motion.rotation[push.link], motion.origin[push.link]
            factor = min((t - start) / RAMP, 1.0, (stop - t) / RAMP)
            if (start, stop) == FIRST:
                factor *= 1.0 + MODULATION * np.sin(2.0 * np.pi * (t - start))
            current = Push(push.link, R @ point + o, R @ normal, factor * (R @ force), factor * push.torsion)
            torque[: push.link] -= motion.screw[: push.link] @ current.wrench
            wrench += current.wrench
            points.append(current.point)
        yield (
            Sample(
                float(t), q, qd,
                torque + noise.torque * rng.standard_normal(len(torque)),
                wrench + rng.standard_normal(6) * np.repeat(noise[:2], 3),
            ),
            points,
        )  # fmt: skip
