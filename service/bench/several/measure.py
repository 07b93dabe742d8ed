"""Answers for many trials, and how far they are from the truth."""

import time
from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np
from scipy.optimize import linear_sum_assignment

from contactsense import Contact, JointTorqueSensor, Localizer, Scene, WrenchSensor
from service.bench.several.trials import Lean, Links, Trials
from service.bench.static_cases import ASSUMED, Noise

Arrival = Literal["at_once", "one_by_one"]

WITHIN = 0.0225
"""Distance within which a contact counts as found: that of MCP-EP [m]."""


def localizer_for(robot: str, noise: Noise, gravity: float = 9.81, contacts: int = 1) -> Localizer:
    """A localizer that knows the noise, for streams with so many contacts; sensors without noise are given a
    small one."""
    told = Noise(*(max(level, floor) for level, floor in zip(noise, ASSUMED, strict=True)))
    return Localizer(
        Scene(
            robot=robot,
            gravity=gravity,
            contacts=contacts,
            base_wrench=WrenchSensor(force_noise=told.force, moment_noise=told.moment),
            joint_torque=JointTorqueSensor(noise=told.torque),
        )
    )


def measure(
    localizer: Localizer,
    noise: Noise,
    number: int,
    contacts: int,
    *,
    force: float = 20.0,
    arrival: Arrival = "one_by_one",
    drift: float | None = None,
    links: Links = "different",
    lean: Lean = "cone",
    seed: int = 1,
    tick: Callable[[], object] = lambda: None,
) -> dict[str, Any]:
    """Locate the contacts of `number` trials.

    Args:
        localizer: See `localizer_for`.
        noise: Added to every sample, anew for each.
        number: Number of trials.
        contacts: Number of contacts in each.
        force: Size of each [N].
        arrival: `one_by_one`: one sample for each number of contacts; what was found before is known, with
            its own covariance. `at_once`: one sample with all of them, nothing known.
        drift: How much the forces that were there before change when a contact comes, which the localizer is
            told; None: they become other ones, and it is told nothing [N].
        links, lean: See `Trials.draw`.
        seed: Settles what is drawn.
        tick: Called after each trial.

    Returns:
        Plain numbers for a table or JSON, see `summary`.
    """
    trials = Trials(localizer.scene, seed)
    chance = np.random.default_rng(seed + 1)
    errors, seconds = [], []
    for _ in range(number):
        trial = trials.draw(contacts, force, links, lean)
        acting = list(trial.pushes)
        found: tuple[Contact, ...] = ()
        spent = 0.0
        for count in range(1, contacts + 1) if arrival == "one_by_one" else (contacts,):
            if arrival == "one_by_one":
                acting[: count - 1] = [trials.changed(push, drift, lean) for push in acting[: count - 1]]
            base, torque = trial.measure(acting[:count])
            base = base + chance.standard_normal(6) * np.repeat(noise[:2], 3)
            torque = torque + chance.standard_normal(len(torque)) * noise.torque
            start = time.perf_counter()
            estimate = localizer.locate(
                trial.q,
                base_wrench=base,
                joint_torque=torque,
                detect=False,
                contacts=count,
                known=found,
                drift=drift,
            )
            spent = time.perf_counter() - start
            found = estimate.contacts
            if not estimate.explanations:
                # Alternatives of one contact, not contacts at the same time.
                found = found[:1]
        errors.append(match(found, [push.point for push in trial.pushes]))
        seconds.append(spent)
        tick()
    return summary(errors, seconds, contacts)


def match(found: Sequence[Contact], truth: Sequence[np.ndarray]) -> np.ndarray:
    """Distances of the contacts found from the true ones, paired so that their sum is least [m].

    Infinite for those that were missed, and for all where more contacts were found than are true.
    """
    errors = np.full(len(truth), np.inf)
    if len(found) > len(truth) or not found:
        return errors
    distance = np.array([[np.linalg.norm(c.point_base - point) for point in truth] for c in found])
    rows, columns = linear_sum_assignment(distance)
    errors[columns] = distance[rows, columns]
    return errors


def summary(errors: Sequence[np.ndarray], seconds: Sequence[float], contacts: int) -> dict[str, Any]:
    """Plain numbers.

    `success`: share of the contacts within `WITHIN`; `all`: share of the trials with all contacts within it;
    `counted`: share with the right number; `median`, `p95` and `rmse` of the contacts that were matched [mm].
    """
    every = np.array(errors).reshape(-1, contacts)
    matched = 1e3 * every[np.isfinite(every)]
    return {
        "contacts": contacts,
        "trials": len(every),
        "success": float((every <= WITHIN).mean()),
        "all": float((every <= WITHIN).all(axis=1).mean()),
        "counted": float(np.isfinite(every).all(axis=1).mean()),
        "median_mm": float(np.quantile(every, 0.5, method="higher") * 1e3),
        "p95_mm": float(np.quantile(every, 0.95, method="higher") * 1e3),
        "rmse_mm": float(np.sqrt(np.mean(matched**2))) if len(matched) else None,
        "median_ms": float(1e3 * np.median(seconds)),
        "p95_ms": float(1e3 * np.quantile(seconds, 0.95)),
    }
