"""Estimates for many trials, and their errors."""

import time
from collections.abc import Callable, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from contactsense import Contact, JointTorqueSensor, Localizer, Scene, WrenchSensor
from contactsense.benchmarks.arms import arm
from contactsense.benchmarks.multi_contact.trials import Links, Trials
from contactsense.benchmarks.static_truth.cases import ASSUMED, SENSORS, Detail, Noise

Arrival = Literal["at_once", "one_by_one"]

WITHIN = 0.0225
"""Distance within which a contact counts as found: that of MCP-EP [m]."""


class Scenario(NamedTuple):
    """How contacts start."""

    arrival: Arrival
    """`one_by_one`: one sample for each number of contacts, the contacts found before are known. `at_once`:
    one sample with all of them, none known."""
    drift: float | None
    """Change of the other forces when a contact starts, known to the localizer [N]; None: these forces change
    arbitrarily, and the localizer assumes nothing about them."""


def localizer_for(
    robot: str,
    noise: Noise,
    gravity: float = 9.81,
    contacts: int = 1,
    detail: Detail = "fine",
    sensors: str = "all",
) -> Localizer:
    """A localizer configured for the noise, for streams with up to `contacts` contacts.

    Sensors without noise are assigned a small one. `sensors`: a key of `SENSORS`.
    """
    has_base, has_torque = SENSORS[sensors]
    assumed = Noise(*(max(level, floor) for level, floor in zip(noise, ASSUMED, strict=True)))
    return Localizer(
        Scene(
            robot=arm(robot),
            gravity=gravity,
            contacts=contacts,
            detail=detail,
            base_wrench=(
                WrenchSensor(force_noise=assumed.force, moment_noise=assumed.moment) if has_base else None
            ),
            joint_torque=JointTorqueSensor(noise=assumed.torque) if has_torque else None,
        )
    )


def measure(
    localizer: Localizer,
    noise: Noise,
    trials_count: int,
    contacts: int,
    scenario: Scenario,
    *,
    force: float = 20.0,
    links: Links = "different",
    seed: int = 1,
    tick: Callable[[], object] = lambda: None,
) -> dict[str, Any]:
    """Locate the contacts of many trials.

    Args:
        localizer: See `localizer_for`.
        noise: Added to every sample.
        trials_count: Number of trials.
        contacts: Number of contacts in each.
        scenario: How they start.
        force: Magnitude of each force [N].
        links: See `Trials.draw`.
        seed: Random seed.
        tick: Called after each trial.

    Returns:
        Plain numbers for a table or JSON, see `summary`.
    """
    arrival, drift = scenario
    trials = Trials(localizer.scene, seed)
    rng = np.random.default_rng(seed + 1)
    errors, seconds = [], []
    for _ in range(trials_count):
        trial = trials.draw(contacts, force, links)
        pushes = list(trial.pushes)
        contacts_found: tuple[Contact, ...] = ()
        duration = 0.0
        for count in range(1, contacts + 1) if arrival == "one_by_one" else (contacts,):
            if arrival == "one_by_one":
                pushes[: count - 1] = [trials.changed(push, drift) for push in pushes[: count - 1]]
            base, torque = trial.measure(pushes[:count])
            base = base + rng.standard_normal(6) * np.repeat(noise[:2], 3)
            torque = torque + rng.standard_normal(len(torque)) * noise.torque
            start = time.perf_counter()
            estimate = localizer.locate(
                trial.q,
                base_wrench=base,
                joint_torque=torque,
                detect=False,
                contacts=count,
                known=contacts_found,
                drift=drift,
            )
            duration = time.perf_counter() - start
            contacts_found = estimate.contacts
            if not estimate.explanations:
                # Alternative candidates of one contact, not simultaneous contacts.
                contacts_found = contacts_found[:1]
        errors.append(match(contacts_found, [push.point for push in trial.pushes]))
        seconds.append(duration)
        tick()
    return summary(errors, seconds, contacts)


def match(found: Sequence[Contact], truth: Sequence[np.ndarray]) -> np.ndarray:
    """Distances of the contacts found from the true ones, in the assignment with the smallest sum [m].

    Infinite for missed contacts, and for all if more contacts were found than exist.
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
    all_errors = np.array(errors).reshape(-1, contacts)
    matched = 1e3 * all_errors[np.isfinite(all_errors)]
    return {
        "contacts": contacts,
        "trials": len(all_errors),
        "success": float((all_errors <= WITHIN).mean()),
        "all": float((all_errors <= WITHIN).all(axis=1).mean()),
        "counted": float(np.isfinite(all_errors).all(axis=1).mean()),
        "median_mm": float(np.quantile(all_errors, 0.5, method="higher") * 1e3),
        "p95_mm": float(np.quantile(all_errors, 0.95, method="higher") * 1e3),
        "rmse_mm": float(np.sqrt(np.mean(matched**2))) if len(matched) else None,
        "median_ms": float(1e3 * np.median(seconds)),
        "p95_ms": float(1e3 * np.quantile(seconds, 0.95)),
    }
