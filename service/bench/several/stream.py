"""Two contacts in a live stream, constructed truth: the second comes while the first is on, and goes before
it."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from contactsense import Estimate, Localizer, Sample
from kinematics.core import inverse_dynamics, place
from kinematics.model import build_model, empty_motion
from service.bench.several.measure import WITHIN, match
from service.bench.several.trials import Lean, Push, Trial, Trials
from service.bench.static_cases import Noise

STEP = 0.002
"""Sample time [s]."""
RAMP = 0.03
"""Time in which a force comes and goes [s]."""
FIRST, SECOND = (0.3, 2.2), (1.2, 1.8)
"""When the contacts are on [s]."""
END = 2.1
SETTLED = 0.15
"""Time after a contact has come or gone from which answers are judged [s]."""
SWING = 0.4
"""The first force swings by this share of its size while it is alone and later."""
RATES = np.array([2.0, 1.5, 2.5, 3.0, 2.0, 1.0])
"""Angular frequencies of the joints' motions, in turn [rad/s]."""


def measure_stream(
    localizer: Localizer,
    noise: Noise,
    number: int,
    speed: float,
    *,
    force: float = 20.0,
    lean: Lean = "cone",
    seed: int = 1,
    tick: Callable[[], object] = lambda: None,
) -> dict[str, Any]:
    """Follow two contacts on different links in each of `number` streams.

    Args:
        localizer: Of a scene that looks for several contacts.
        noise: Added to every sample.
        number: Number of streams.
        speed: Largest speed of each joint [rad/s].
        force: Size of each force [N].
        lean: See `Trials.draw`.
        seed: Settles what is drawn.
        tick: Called after each stream.

    Returns:
        Plain numbers: `found`: share of the streams in which both contacts are within `WITHIN` in the median;
        `median_mm`, `p95_mm`: of the worse contact of a stream; `delay_ms`: until the second is told from the
        first, in the median; `never`: share where it never is; `false`: share of the streams with several
        contacts while there is one; `back`: share in which the first is within `WITHIN` again, alone, after
        the second has gone; `ms`: 99 % quantile of the time of a step.
    """
    trials = Trials(localizer.scene, seed)
    errors, delays, false, back, seconds = [], [], [], [], []
    for k in range(number):
        trial = trials.draw(2, force, "different", lean)
        worse, alone, after, seen = [], [], [], np.inf
        localizer.reset()
        for sample, points in samples(localizer, trial, noise, speed, seed + k):
            start = time.perf_counter()
            estimate = localizer.step(sample)
            seconds.append(time.perf_counter() - start)
            t = sample.t
            if t < SECOND[0]:
                alone.append(estimate.status == "multiple")
            elif t < SECOND[1] and estimate.status == "multiple":
                seen = min(seen, t - SECOND[0])
            if SECOND[0] + SETTLED < t < SECOND[1] - RAMP:
                worse.append(_worst(estimate, points))
            elif t > SECOND[1] + SETTLED:
                after.append(_worst(estimate, points))
        errors.append(np.median(worse))
        delays.append(seen)
        false.append(any(alone))
        back.append(np.median(after) <= WITHIN)
        tick()
    return {
        "speed": speed,
        "streams": number,
        "found": float(np.mean(np.array(errors) <= WITHIN)),
        "median_mm": float(1e3 * np.quantile(errors, 0.5, method="higher")),
        "p95_mm": float(1e3 * np.quantile(errors, 0.95, method="higher")),
        "delay_ms": float(1e3 * np.quantile(delays, 0.5, method="higher")),
        "never": float(np.mean(np.isinf(delays))),
        "false": float(np.mean(false)),
        "back": float(np.mean(back)),
        "ms": float(1e3 * np.quantile(seconds, 0.99)),
    }


def _worst(estimate: Estimate, points: list[np.ndarray]) -> float:
    found = estimate.contacts if estimate.status == "multiple" else estimate.contacts[:1]
    return float(match(found, points).max())


def samples(
    localizer: Localizer, trial: Trial, noise: Noise, speed: float, seed: int
) -> Iterator[tuple[Sample, list[np.ndarray]]]:
    """Samples of one stream, and the places of the contacts that are on, base frame."""
    scene = localizer.scene
    model, motion = build_model(scene.robot), empty_motion(len(trial.q))
    torque, wrench = np.empty(len(trial.q)), np.empty(6)
    chance = np.random.default_rng(seed)
    rates = np.resize(RATES, len(trial.q))
    place(model, trial.q, motion)
    bodies = [motion.rotation[push.link].copy() for push in trial.pushes]
    local = [
        (R.T @ (push.point - motion.origin[push.link]), R.T @ push.force, R.T @ push.normal)
        for R, push in zip(bodies, trial.pushes, strict=True)
    ]
    for t in np.arange(0.0, END, STEP):
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
            share = min((t - start) / RAMP, 1.0, (stop - t) / RAMP)
            if (start, stop) == FIRST:
                share *= 1.0 + SWING * np.sin(2.0 * np.pi * (t - start))
            now = Push(push.link, R @ point + o, R @ normal, share * (R @ force), share * push.torsion)
            torque[: push.link] -= motion.screw[: push.link] @ now.wrench
            wrench += now.wrench
            points.append(now.point)
        yield (
            Sample(
                float(t), q, qd,
                torque + noise.torque * chance.standard_normal(len(torque)),
                wrench + chance.standard_normal(6) * np.repeat(noise[:2], 3),
            ),
            points,
        )  # fmt: skip
