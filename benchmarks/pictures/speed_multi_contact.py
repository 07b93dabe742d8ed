"""Time of one answer against its error with two and three simultaneous contacts: marks that
`contactsense.benchmarks.speed_error` draws next to those of one contact."""

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

import numpy as np

from contactsense import Scene
from contactsense.benchmarks.mcp_ep import HELD, pair, sequence
from contactsense.benchmarks.peers.added_contacts import add
from contactsense.benchmarks.peers.cases import Case
from contactsense.benchmarks.peers.exploration_filter import ExplorationFilter, Found
from contactsense.benchmarks.peers.one_by_one import OneByOne, TrackedAnswers
from contactsense.benchmarks.peers.touches import Touches
from contactsense.benchmarks.pictures.mark import DETAILS, QUANTILES, Mark

CONTACTS = 3
SEED = 1
"""Seed of the further contacts and of the noise."""


class Follower(Protocol):
    """A method for contacts that are added one after another."""

    def __call__(self, q: np.ndarray, base_wrench: np.ndarray, joint_torque: np.ndarray) -> TrackedAnswers:
        """Answers after each contact: see `contactsense.benchmarks.peers.one_by_one.OneByOne.follow`."""
        ...


def followers(scene: Scene, folder: Path) -> Iterator[tuple[str, Follower]]:
    """The methods, each created when it is needed, under their names for one contact; `folder` has the visual
    meshes."""
    for detail in DETAILS:
        meshes = folder / scene.robot.name if detail == "skin" else None
        own = scene.model_copy(update={"detail": detail, "meshes": meshes})
        yield f"contactsense, {detail}", OneByOne(own, CONTACTS, HELD).follow
    yield "contactsense, fine, forces free", OneByOne(scene, CONTACTS, None).follow
    yield "exploring particle filter", _exploring(scene)


def _exploring(scene: Scene) -> Follower:
    method = ExplorationFilter(scene, contacts=CONTACTS)

    def follow(q: np.ndarray, base_wrench: np.ndarray, joint_torque: np.ndarray) -> TrackedAnswers:
        start = time.perf_counter()
        found = method.follow(q, base_wrench, joint_torque)
        # A filter takes the same time for each measurement.
        each = (time.perf_counter() - start) / base_wrench.shape[0] / base_wrench.shape[1]
        return TrackedAnswers(found, np.full(base_wrench.shape[1], each))

    return follow


def several(case: Case, truth: Path, meshes: Path) -> Iterator[Mark]:
    """Marks of all methods for two and three contacts that start one after another in the case's postures.

    The first contact is the case's own. Each error is that of one contact; it is infinite for a missed
    contact.

    Args:
        case: The first contacts.
        truth: Folder of the ground truth, for the places of the further contacts.
        meshes: Folder of the visual meshes, ROBOT/LINK.ply.
    """
    touches = add(case.points, CONTACTS - 1, truth, SEED)
    measured = sequence(touches, case.noise, SEED + 1)
    one = touches.q[:1], *(part[:1] for part in measured)
    for name, follow in followers(case.scene, meshes):
        follow(*one)
        found, seconds = follow(touches.q, *measured)
        for step in range(1, CONTACTS):
            yield _mark(name, case, found, seconds, touches, step)


def _mark(name: str, case: Case, found: Found, seconds: np.ndarray, touches: Touches, step: int) -> Mark:
    distance, right = pair(found, touches, step)
    quantiles = np.quantile(distance, QUANTILES, method="higher")
    return Mark(
        method=name,
        robot=case.points.robot,
        noise=case.noise,
        contacts=step + 1,
        microseconds=1e6 * float(seconds[step]),
        error=tuple(float(value) for value in quantiles),
        link_right=float(right.mean()),
    )
