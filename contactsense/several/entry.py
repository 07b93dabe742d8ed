"""The compiled function that Python calls for several contacts."""

import math

import numpy as np

from contactsense.locate import place_primitives
from contactsense.pipeline import residual_gain, tell
from contactsense.report import LEAST_PROBABILITY, write_row
from contactsense.several.explain import explain_more
from contactsense.several.memory import MOST, Bodies, Several
from contactsense.several.rows import fill_rows, rank_of
from contactsense.several.scan import likely_force, place_places
from contactsense.unfold import unfold
from robots.compiled import kernel
from robots.grid import Grids


@kernel
def explain_sets(
    floats: np.ndarray,
    integers: np.ndarray,
    sizes: tuple[int, int, int, int, int],
    skin: Grids,
    several: Several,
    present: tuple[bool, bool, bool],
    bandwidth: float,
    known: int,
    most: int,
    rows: np.ndarray,
) -> tuple[int, int]:
    """Explain the sample that the workspace has taken last by sets of simultaneous contacts.

    Args:
        floats, integers, sizes, skin: The workspace, after `contactsense.entry.once` or `step`, and the skin.
        several: With the known contacts.
        present: Which of base wrench, joint torques and wrist wrench were measured.
        bandwidth: Cut-off of the observers [Hz]; infinite for an arm at rest, whose external parts come as
            they are.
        known, most: Number of known contacts, and most contacts of an explanation, those included.
        rows: Filled: contact i of the k-th explanation goes into row k * MOST + i, as in
            `contactsense.report`, shape (LISTED * MOST, WIDTH).

    Returns:
        Number of explanations that are probable enough to be listed, and how many independent numbers the
        sensors say about the wrenches of the first one's contacts.
    """
    arm, memory = unfold(floats, integers, sizes)
    scale, lag = 1.0, 0.0
    parts = (memory.base_wrench, memory.torque, memory.wrist_wrench)
    if bandwidth < math.inf:
        # The observers' own residuals, not those that were averaged for a single contact.
        lag = 1.0 / (2.0 * math.pi * bandwidth)
        parts = (memory.base.residual[:6], memory.joints.residual, memory.wrist.residual)
        scale = residual_gain(memory, present)
    tell(arm, memory, scale)
    depth, choice, found = arm.sensors.depth, several.choice, several.found
    place_primitives(arm.surfaces, depth, memory.motion, memory.found)
    place_places(arm.places, depth, memory.motion, choice, several.scan)
    m = fill_rows(
        arm.sensors, memory.motion, parts, memory.base_information, memory.torque_variance,
        memory.wrist_origin, present, scale, lag, several.rows,
    )  # fmt: skip
    bodies = Bodies(memory.found.rotation, memory.found.origin)
    force = likely_force(parts, present)
    count = explain_more(arm.surfaces, arm.prior, bodies, several, m, force, known, most)
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
        rank = rank_of(several.rows, m, links, found.contacts[t], several.stack.jacobian)
    return listed, rank
