"""Double contacts of the moving ground truth: two pushes on different links of a moving arm's meshes."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from contactsense import Contact, Localizer
from contactsense.benchmarks.multi_contact.measure import WITHIN, localizer_for, match, summary
from contactsense.benchmarks.static_truth.cases import Detail, Noise
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.inverse_dynamics import inverse_dynamics
from contactsense.kinematics.model import Model, build_model, empty_motion

SAMPLE_STEP = 10
"""One of this many samples of a double contact is located."""
MIN_FORCE = 2.0
"""Minimum normal force of both contacts [N]."""
RESAMPLES = 2000
"""Number of bootstrap samples."""


@dataclass(frozen=True)
class Motion:
    """The runs with double contacts; fields as in the file, N samples."""

    q: np.ndarray
    base_wrench: np.ndarray
    torque: np.ndarray
    active: np.ndarray
    point: np.ndarray
    force: np.ndarray
    normal: np.ndarray
    noise_wrench: np.ndarray
    noise_torque: np.ndarray
    run: np.ndarray


def read_pairs(folder: Path, robot: str, model: Model) -> Motion:
    """Samples of the runs with double contacts of `motion_ROBOT.npz`; the dynamics of the arm are
    subtracted.

    Raises:
        click.ClickException: the file cannot be read.
    """
    path = folder / f"motion_{robot}.npz"
    try:
        with np.load(path) as file:
            rows = np.flatnonzero(file["run_multi"][file["run"]])
            data = {
                name: np.asarray(file[name])[rows]
                for name in file.files
                if file[name].shape[:1] == file["t"].shape
            }
            gravity = np.asarray(file["gravity"])
    except (OSError, ValueError, KeyError) as error:
        raise click.ClickException(f"{path}: cannot read ground truth: {error}") from None
    q, qd, qdd = (data[name].astype(np.float64) for name in ("q", "qd", "qdd"))
    own_torque, own_wrench = np.empty_like(q), np.empty((len(q), 6))
    motion = empty_motion(model.joints)
    for i in range(len(q)):
        inverse_dynamics(model, q[i], qd[i], qdd[i], gravity, motion, own_torque[i], own_wrench[i])
    return Motion(
        q=q,
        base_wrench=data["base_wrench"] - own_wrench,
        torque=data["tau"] - own_torque,
        active=data["active"],
        point=data["c_base"],
        force=data["f"],
        normal=data["n_base"].astype(np.float64),
        noise_wrench=data["noise_wrench"].astype(np.float64),
        noise_torque=data["noise_tau"].astype(np.float64),
        run=data["run"],
    )


def measure_pairs(folder: Path, robot: str, noise: Noise, detail: Detail = "fine") -> list[dict[str, Any]]:
    """Rows as from `contactsense.benchmarks.multi_contact.measure.measure`: pairs located together, and with
    the first contact already known. Those that start together, or whose first contact has no estimate, are
    left out of both.

    In addition `pairs` and `left_out`, their numbers, and `success_interval`: a 95 % interval of `success`,
    by bootstrap over the pairs, as the samples of one are alike.
    """
    localizer = localizer_for(robot, noise, detail=detail)
    model = build_model(localizer.scene.robot)
    motion = read_pairs(folder, robot, model)
    pushing = -np.einsum("nki,nki->nk", motion.force, motion.normal) > MIN_FORCE
    both = (motion.active & pushing).all(axis=1)
    rows = []
    intervals = _intervals(both, motion.run)
    first = [_first_contact_alone(localizer, motion, start, pushing, noise) for start, _ in intervals]
    for arriving in ("at once", "one by one, forces free"):
        pairs: list[list[np.ndarray]] = []
        seconds = []
        for (start, stop), before in zip(intervals, first, strict=True):
            if before is None:
                continue
            errors = []
            for i in range(start, stop, SAMPLE_STEP):
                at_once = arriving == "at once"
                known = () if at_once else (moved_with_link(model, before[1], before[0], motion.q[i]),)
                base, torque = _sample(motion, i, noise)
                begin = time.perf_counter()
                estimate = localizer.locate(
                    motion.q[i], base_wrench=base, joint_torque=torque, detect=False, contacts=2, known=known
                )
                seconds.append(time.perf_counter() - begin)
                found = estimate.contacts if estimate.explanations else estimate.contacts[:1]
                errors.append(match(found, list(motion.point[i])))
            pairs.append(errors)
        if pairs:
            counts = {"pairs": len(pairs), "left_out": len(intervals) - len(pairs)}
            found_all = summary([error for errors in pairs for error in errors], seconds, 2)
            interval = {"success_interval": success_interval(pairs)}
            rows.append({"arriving": arriving} | counts | found_all | interval)
    return rows


def success_interval(pairs: Sequence[Sequence[np.ndarray]]) -> tuple[float, float]:
    """Bounds of the share of contacts within `WITHIN` in 95 % of the bootstrap samples of the pairs.

    Args:
        pairs: Distances of both contacts in each sample, shape (2,) [m], of each pair.
    """
    hits = np.array([[np.count_nonzero(np.array(errors) <= WITHIN), 2 * len(errors)] for errors in pairs])
    drawn = np.random.default_rng(0).integers(len(pairs), size=(RESAMPLES, len(pairs)))
    right, counted = hits[drawn].sum(axis=1).T
    low, high = np.quantile(right / counted, (0.025, 0.975))
    return float(low), float(high)


def _intervals(both: np.ndarray, run: np.ndarray) -> list[tuple[int, int]]:
    """First and past-the-last sample of each double contact."""
    edges = np.diff(np.concatenate(([False], both, [False])).astype(int))
    return list(zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True))


def _sample(motion: Motion, i: int, noise: Noise) -> tuple[np.ndarray, np.ndarray]:
    """External base wrench and joint torques."""
    return (
        motion.base_wrench[i] + motion.noise_wrench[i] * np.repeat(noise[:2], 3),
        motion.torque[i] + motion.noise_torque[i] * noise.torque,
    )


def _first_contact_alone(
    localizer: Localizer, motion: Motion, start: int, pushing: np.ndarray, noise: Noise
) -> tuple[np.ndarray, Contact] | None:
    """Posture and estimate of the first contact just before the onset of the second.

    None if both started together.
    """
    for i in range(start - 1, -1, -1):
        if motion.run[i] != motion.run[start] or not motion.active[i].any():
            return None
        if motion.active[i].sum() == 1 and pushing[i].any():
            base, torque = _sample(motion, i, noise)
            found = localizer.locate(motion.q[i], base_wrench=base, joint_torque=torque, detect=False)
            return (motion.q[i], found.contacts[0]) if found.contacts else None
    return None


def moved_with_link(model: Model, contact: Contact, before: np.ndarray, now: np.ndarray) -> Contact:
    """A contact moved with its link from one posture to another."""
    motion = empty_motion(model.joints)
    body = min(contact.link_index, model.joints)
    forward_kinematics(model, before, motion)
    R, o = motion.rotation[body].copy(), motion.origin[body].copy()
    forward_kinematics(model, now, motion)
    rotation = motion.rotation[body] @ R.T
    return replace(
        contact,
        point_base=rotation @ (contact.point_base - o) + motion.origin[body],
        normal_base=rotation @ contact.normal_base,
        force_base=rotation @ contact.force_base,
        covariance=rotation @ contact.covariance @ rotation.T,
    )
