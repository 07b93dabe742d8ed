"""Where the arm is touched: every touchable primitive is tried, and link and place are decided together.

Where the fused wrench says where to look, the search on a primitive starts where the wrench axis enters it
and ends at the most probable place (`contactsense.aim`). Where it says little, all places of the surface are
weighed (`contactsense.wide`). The explanations on all links compete on one scale, the log evidence: fit of
the torques and of the base wrench, plausibility of force and torsion, and how sharply the place is determined
(theory, sections 3 to 5). So does "none of these": a wrench that no single push on a touchable link has
caused.
"""

import math

import numpy as np

from contactsense.aim import moment_variance, search_along
from contactsense.candidates import Candidates
from contactsense.cells import Cells
from contactsense.cover import cover_place, stands_on
from contactsense.energy import Prior, Work
from contactsense.isolation import Hypotheses
from contactsense.ldl import solve
from contactsense.places import Parts, Places
from contactsense.refine import CUT
from contactsense.wide import search_over
from kinematics.model import Motion
from robots.compiled import fused_kernel
from robots.surface import Surfaces

WIDE = 0.008
"""Where the wrench axis is known less well than this, standard deviation, it does not tell where to look
[m]."""
FAR = 4.0
"""How many times its usual offset the real surface may be off in few places: at ribs, steps, screw heads."""
RARE = 0.1
"""Share of such places."""
UNEXPLAINED = 0.01
"""Probability, before any measurement, that what acts on the arm is no single push on a touchable link: a
pull, a couple, several contacts."""
OTHER_FORCE = 2.0
"""Force of such a cause, standard deviation of each component in units of what is usual for contacts."""
OTHER_LEVER = 0.5
"""Its moment about the base origin per force, standard deviation of each component [m]."""


@fused_kernel
def locate(
    surfaces: Surfaces,
    places: Places,
    parts: Parts,
    touchable: np.ndarray,
    depth: np.ndarray,
    motion: Motion,
    hypotheses: Hypotheses,
    aimed: bool,
    prior: Prior,
    work: Work,
    cells: Cells,
    found: Candidates,
    link_probability: np.ndarray,
) -> int:
    """Find all places on all links that explain the measurement.

    Args:
        surfaces: Primitives in the frames of the bodies that carry them.
        places, parts: Places that stand for their surface, and the parts of their cells.
        touchable: 1 for links that can be touched, else 0, shape (links,), int64.
        depth: Number of joints between the base and each link, shape (links,), int64.
        motion: Poses, see `kinematics.core.place`.
        hypotheses: One fused wrench per link, see `contactsense.isolation.isolate`.
        aimed: Whether all six components of the wrench were measured.
        prior: What is known of contacts beforehand.
        work, cells: Scratch.
        found: Filled: the explanations, sorted by `order`.
        link_probability: Filled: probability that each link is the touched one, shape (links,). What they
            lack to one is that of "none of these".

    Returns:
        Number of explanations; 0 where no link can explain the measurement by a push.
    """
    link = _best_link(touchable, hypotheses)
    if link < 0:
        link_probability[:] = 0.0
        return 0
    place_primitives(surfaces, depth, motion, found)
    sharp = aimed and _is_sharp(
        hypotheses.wrench[link], hypotheses.covariance[link], motion.origin[depth[link]]
    )
    other = _unexplained(hypotheses, link, prior, work)
    offset, share = prior.offset, 0.0
    for _ in range(2):
        assumed = Prior(prior.lean, prior.lever, offset, prior.force, prior.room, prior.area)
        if sharp:
            count = search_along(surfaces, touchable, hypotheses, assumed, work, found)
            _cover(surfaces, found, count, assumed)
            cells.rest[:] = -math.inf
        else:
            count = search_over(
                surfaces,
                places,
                parts,
                touchable,
                depth,
                motion,
                hypotheses,
                aimed,
                assumed,
                work,
                cells,
                found,
                cells.rest,
            )
        if _lower(found, count, cells.rest, share) >= other:
            break
        # Nothing explains it where the surface is as near as it mostly is.
        offset, share = FAR * prior.offset, math.log(RARE)
    kept: int = _rank(surfaces, found, count, 2.0 * prior.offset, cells.rest, other, link_probability)
    return kept


@fused_kernel
def _lower(found, count, rest, share):  # type: ignore[no-untyped-def]
    """Add the logarithm of a share to all log evidence; the best explanation's then."""
    best = -math.inf
    for i in range(count):
        row = found.order[i]
        found.score[row] += share
        best = max(best, found.score[row])
    for link in range(rest.shape[0]):
        rest[link] += share
    return best


@fused_kernel
def _best_link(touchable, hypotheses):  # type: ignore[no-untyped-def]
    """Touchable link whose hypothesis fits best, -1 without any."""
    best = -1
    for link in range(touchable.shape[0]):
        if touchable[link] and (best < 0 or hypotheses.energy[link] < hypotheses.energy[best]):
            best = link
    return best


@fused_kernel
def _is_sharp(w, P, o):  # type: ignore[no-untyped-def]
    """Whether the wrench axis is known well enough near the point o to tell where to look."""
    ff = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    return moment_variance(P, o[0], o[1], o[2]) < WIDE * WIDE * ff


@fused_kernel
def _unexplained(hypotheses, link, prior, work):  # type: ignore[no-untyped-def]
    """Log evidence of "none of these": any wrench, as far as that is usual, where `link` is."""
    w, L = hypotheses.wrench[link], hypotheses.information[link]
    H, g = work.normal_equations, work.gradient
    force = (OTHER_FORCE * prior.force) ** -2.0
    moment = (OTHER_LEVER * OTHER_FORCE * prior.force) ** -2.0
    fit = 0.0
    for i in range(6):
        g[i] = 0.0
        for k in range(6):
            g[i] += L[i, k] * w[k]
            H[i, k] = L[i, k]
        fit += 0.5 * w[i] * g[i]
        H[i, i] += force if i < 3 else moment
    log_det, gain, _, _, _ = solve(H, g)
    scale = 3.0 * (math.log(force) + math.log(moment))
    odds = math.log(UNEXPLAINED / (1.0 - UNEXPLAINED))
    return odds - hypotheses.energy[link] - (fit - gain) + 0.5 * (scale - log_det)


@fused_kernel
def place_primitives(surfaces, depth, motion, found):  # type: ignore[no-untyped-def]
    """Body frames of all primitives in the base frame."""
    for p in range(surfaces.kind.shape[0]):
        body = depth[surfaces.link[p]]
        R, o = motion.rotation[body], motion.origin[body]
        S, s = surfaces.rotation[p], surfaces.origin[p]
        for i in range(3):
            found.origin[p, i] = o[i] + R[i, 0] * s[0] + R[i, 1] * s[1] + R[i, 2] * s[2]
            for k in range(3):
                found.rotation[p, i, k] = R[i, 0] * S[0, k] + R[i, 1] * S[1, k] + R[i, 2] * S[2, k]


@fused_kernel
def _cover(surfaces, found, count, prior):  # type: ignore[no-untyped-def]
    """Lower the score of places that cannot be touched."""
    best = -math.inf
    for i in range(count):
        best = max(best, found.score[found.order[i]])
    # The best so far of those with nothing near them: what is worse than that by enough needs no closer look.
    free = -math.inf
    for i in range(count):
        p = found.order[i]
        if found.score[p] < best - CUT:
            continue
        if stands_on(surfaces.link[p], found.point[p, 2], found.normal[p, 2], prior.offset):
            found.score[p] = -math.inf
        elif cover_place(surfaces, found, p, prior, free - CUT):
            free = max(free, found.score[p])


@fused_kernel
def _rank(surfaces, found, count, apart, rest, other, link_probability):  # type: ignore[no-untyped-def]
    """Sort the explanations, drop doubles and the hopeless, turn scores into probabilities; how many are
    left."""
    for i in range(count):
        for k in range(i + 1, count):
            if found.score[found.order[k]] > found.score[found.order[i]]:
                found.order[i], found.order[k] = found.order[k], found.order[i]
    best = max(other, found.score[found.order[0]]) if count > 0 else other
    for link in range(rest.shape[0]):
        best = max(best, rest[link])
    if best == -math.inf:
        link_probability[:] = 0.0
        return 0
    total = math.exp(other - best)
    for link in range(link_probability.shape[0]):
        link_probability[link] = math.exp(rest[link] - best)
        total += link_probability[link]
    kept = 0
    for i in range(count):
        row = found.order[i]
        if not found.score[row] >= best - CUT:
            break
        if not _is_double(surfaces, found, row, kept, apart):
            found.order[kept] = row
            found.probability[row] = math.exp(found.score[row] - best)
            link_probability[surfaces.link[found.primitive[row]]] += found.probability[row]
            total += found.probability[row]
            kept += 1
    for i in range(kept):
        found.probability[found.order[i]] /= total
    for link in range(link_probability.shape[0]):
        link_probability[link] /= total
    return kept


@fused_kernel
def _is_double(surfaces, found, p, kept, apart):  # type: ignore[no-untyped-def]
    """Whether a better explanation on the same link, among the first `kept`, lies closer than `apart`."""
    link = surfaces.link[found.primitive[p]]
    for i in range(kept):
        q = found.order[i]
        if surfaces.link[found.primitive[q]] == link:
            dx = found.point[q, 0] - found.point[p, 0]
            dy = found.point[q, 1] - found.point[p, 1]
            dz = found.point[q, 2] - found.point[p, 2]
            if dx * dx + dy * dy + dz * dz < apart * apart:
                return True
    return False
