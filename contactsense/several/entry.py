"""The compiled function that Python calls for several contacts of an arm at rest."""

import numpy as np

from contactsense.locate import place_primitives
from contactsense.pipeline import rest
from contactsense.report import LEAST_PROBABILITY, write_row
from contactsense.several.explain import explain_more
from contactsense.several.memory import MOST, Several
from contactsense.several.rows import rank_of
from contactsense.workspace import unfold
from robots.compiled import kernel
from robots.grid import Grids


@kernel
def explain_rest(
    floats: np.ndarray,
    integers: np.ndarray,
    sizes: tuple[int, int, int, int],
    skin: Grids,
    several: Several,
    q: np.ndarray,
    torque: np.ndarray,
    base_wrench: np.ndarray,
    wrist_wrench: np.ndarray,
    external: bool,
    has_base: bool,
    has_torque: bool,
    has_wrist: bool,
    known: int,
    most: int,
    rows: np.ndarray,
) -> tuple[int, int]:
    """One sample of an arm at rest: `rest` and `explain_more`.

    Args:
        rows: Filled: contact i of the k-th explanation goes into row k * MOST + i, as in
            `contactsense.report`, shape (LISTED * MOST, WIDTH).

    Returns:
        Number of explanations that are probable enough to be listed, and how many independent numbers the
        sensors say about the wrenches of the first one's contacts.
    """
    arm, memory = unfold(floats, integers, sizes)
    rest(arm, memory, q, torque, base_wrench, wrist_wrench, external)
    place_primitives(arm.surfaces, arm.sensors.depth, memory.motion, memory.found)
    count = explain_more(arm, memory, several, has_base, has_torque, has_wrist, 1.0, known, most)
    found = several.found
    listed = 0
    for k in range(count):
        t = found.order[k]
        if found.probability[t] < LEAST_PROBABILITY:
            break
        for i in range(found.contacts[t]):
            write_row(
                arm,
                memory,
                skin,
                found.primitive[t, i],
                found.probability[t],
                found.torsion[t, i],
                found.point[t, i],
                found.normal[t, i],
                found.force[t, i],
                found.covariance[t, i],
                rows[k * MOST + i],
            )
        listed += 1
    rank = 0
    if listed > 0:
        t = found.order[0]
        links = several.stack.primitive
        for i in range(found.contacts[t]):
            links[i] = arm.surfaces.link[found.primitive[t, i]]
        m = 6 * has_base + q.shape[0] * has_torque + 6 * has_wrist
        rank = rank_of(several.rows, m, links, found.contacts[t], several.stack.jacobian)
    return listed, rank
