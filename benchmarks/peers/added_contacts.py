"""Further contacts in the postures of the static ground truth, for methods that find several."""

from pathlib import Path

import numpy as np

from contactsense import Scene
from contactsense.benchmarks.peers.cases import TRUTH, weight
from contactsense.benchmarks.peers.skin_table import Table
from contactsense.benchmarks.peers.touches import Toucher, Touches
from contactsense.benchmarks.static_truth.points import StaticPoints, read
from contactsense.benchmarks.truth_arms import STATIC, file_of

FORCE = 20.0
"""Magnitude of each further force [N]."""


def add(points: StaticPoints, further: int, folder: Path = TRUTH, seed: int = 0) -> Touches:
    """The contacts of the ground truth, each combined with further ones in the same posture on other links.

    The further contacts are at places that the ground truth touches in other postures and that are
    accessible; links are equally probable, forces uniform within friction.

    Args:
        points: The first contacts.
        further: Number of further contacts after each.
        folder: Folder of the ground truth of that arm, for the places.
        seed: Seed for the further contacts.
    """
    toucher = Toucher(Scene(robot=points.robot), _contact_table(folder, points.robot), seed)
    rest = [toucher.beside(q, link, further, FORCE) for q, link in zip(points.q, points.link, strict=True)]
    after = Touches(*(np.concatenate(parts) for parts in zip(*rest, strict=True)))
    own_wrench, own_torque = weight(points)
    wrench, torque = points.base_wrench - own_wrench, points.torque - own_torque
    # For the first contact, the ground truth as it is read here has no normal.
    first = (points.link, points.point_base, np.full_like(points.point_base, np.nan), wrench[:, :3])
    return Touches(
        points.q,
        *(
            np.concatenate((part[:, None], more), axis=1)
            for part, more in zip((*first, wrench, torque), after[1:], strict=True)
        ),
    )


def _contact_table(folder: Path, robot: str) -> Table:
    """Contact points of the ground truth, in the frames of the links."""
    read(folder, robot)  # raises a clear error if the file is unusable
    with np.load(file_of(folder, STATIC, robot)) as file:
        order = np.argsort(file["link"], kind="stable")
        link = file["link"][order].astype(np.int64)
        point, normal = file["c_link"][order], file["n_link"][order].astype(np.float64)
    return Table(point, normal, link, np.bincount(link).astype(np.float64))
