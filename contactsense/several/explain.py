"""One, two or three contacts, with or without contacts that are tracked already: which explain a measurement?

Every number of contacts is tried in turn: seeds from the scan, the search from each, and the evidence of each
result. All compete on one scale, with a prior for each further contact, so that a second contact is reported
only where one does not explain the measurement.
"""

import math

from contactsense.cover import clearance, exposed, stands_on
from contactsense.energy import TAIL, Prior, lean_in
from contactsense.refine import CUT
from contactsense.several.cholesky import invert
from contactsense.several.memory import UNKNOWNS, Bodies, Several
from contactsense.several.scan import lay_ground, likely_pushes, scan_places
from contactsense.several.stack import put, settle
from robots.compiled import fused_kernel
from robots.surface import Surfaces

FURTHER = 0.02
"""Prior probability of a further contact, in units of that of no further one."""
WORTH = 8.0
"""Energy that must be left for a further contact to be tried: less than it must gain to be believed in."""
HOPELESS = 30.0
"""Energy above the best at which a search is given up: more than explanations may differ by, as the energy
falls on the way."""
SURE = 1e-4
"""Least standard deviation of a known place [m]."""


@fused_kernel
def explain_more(
    surfaces: Surfaces,
    prior: Prior,
    bodies: Bodies,
    several: Several,
    m: int,
    force: float,
    known: int,
    most: int,
) -> int:
    """Explain a measurement by the known contacts and further ones.

    Args:
        surfaces: Primitives.
        prior: What is known of contacts beforehand.
        bodies: Where the primitives are.
        several: With the measurement in `rows`, all places in the base frame in `scan.place`, and `known`
            filled for that many contacts; explanations are left in `found`, sorted by `order`. Within each,
            the known contacts come first, in their order, then the further ones.
        m: Number of rows.
        force: Size of the forces at work, about [N].
        known: Number of known contacts.
        most: Most contacts of an explanation, the known ones included.

    Returns:
        Number of explanations.
    """
    choice, rows, given, stack, scan, sets = several
    for i in range(known):
        take_known(surfaces, bodies, given, stack, scan.normals[i], force, i)
    lay_ground(surfaces.link, prior.lean, given, known, force, rows, m, scan)
    whole = weigh_known(surfaces, prior, bodies, rows, known, stack)
    stored = 0
    best = math.inf
    for extra in range(0 if known > 0 else 1, most - known + 1):
        if best < WORTH:
            break
        seeds = 1
        if extra > 0:
            seeds = scan_places(choice, prior.lean, extra, force, rows, m, scan)
        level = math.inf
        for t in range(seeds):
            for i in range(known):
                take_known(surfaces, bodies, given, stack, scan.normals[i], force, i)
            if extra > 0:
                likely_pushes(choice, prior.lean, t, extra, force, rows, m, scan, scan.pushes)
                for e in range(extra):
                    _start(surfaces, bodies, choice, scan, stack, scan.seed[t, e], scan.pushes[e], known + e)
            count = known + extra
            energy, score = weigh_set(surfaces, prior, bodies, rows, m, known, count, level + HOPELESS, stack)
            if score > -math.inf:
                _store(stack, prior.offset, count, energy, score - whole, sets, stored)
                stored += 1
                level = min(level, energy)
        best = min(best, level)
    kept: int = _rank_sets(surfaces.link, sets, stored, 2.0 * prior.offset)
    return kept


@fused_kernel
def weigh_known(surfaces, prior, bodies, rows, known, stack):  # type: ignore[no-untyped-def]
    """Log evidence of the known contacts in `stack` before any measurement.

    The search takes every place as one of all the surface and every force as one of all that are usual; what
    is known comes on top, as a factor exp(-d^2 / 2). So that explanations by different known contacts compete
    on one scale, the product of both is brought back to one whole: this is what it adds up to.
    """
    if known == 0:
        return 0.0
    _, score = settle(surfaces, bodies, rows, 0, prior, known, math.inf, stack)
    if score == -math.inf:
        return 0.0
    for i in range(known):
        if stack.prior_stiffness[i] == 0.0:
            # Nothing but the prior says how the force leans, and its peak is sharper than all of it is.
            score += math.log(1.0 + 2.0 / TAIL)
    return score


@fused_kernel
def weigh_set(surfaces, prior, bodies, rows, m, known, count, limit, stack):  # type: ignore[no-untyped-def]
    """Search from the contacts in `stack`, the known ones first; energy, and log evidence with the priors of
    the further ones. Arguments as for `contactsense.several.stack.settle`."""
    energy, score = settle(surfaces, bodies, rows, m, prior, count, limit, stack)
    if energy < math.inf:
        score += (count - known) * math.log(FURTHER)
        score += _room(surfaces, bodies, prior, stack, known, count)
    return energy, score


@fused_kernel
def take_known(surfaces, bodies, given, stack, n, force, i):  # type: ignore[no-untyped-def]
    """Known contact i as a first guess, with its force before, or a push of the likely size; and its priors.

    n: filled with its outward normal."""
    c, f = given.point[i], given.force[i]
    put(surfaces, bodies, stack, i, given.primitive[i], c[0], c[1], c[2], f[0], f[1], f[2])
    n[0], n[1], n[2] = stack.frame[i, 0, 0], stack.frame[i, 1, 0], stack.frame[i, 2, 0]
    fx, fy, fz = f[0], f[1], f[2]
    stack.prior_stiffness[i] = 0.0
    if given.drift[i] < math.inf:
        stack.prior_stiffness[i] = 1.0 / given.drift[i] ** 2
    else:
        fx, fy, fz = -force * n[0], -force * n[1], -force * n[2]
    for k in range(3):
        stack.prior_point[i, k] = stack.point[i, k]
        stack.prior_force[i, k] = f[k]
    stack.force[i, 0], stack.force[i, 1], stack.force[i, 2] = lean_in(fx, fy, fz, n[0], n[1], n[2])
    _sharpen(stack.frame[i], given.covariance[i], stack.prior_sharpness[i])


@fused_kernel
def _sharpen(T, C, out):  # type: ignore[no-untyped-def]
    """Information on a place: the inverse of its covariance C in the tangent plane of the frame T."""
    aa, ab, bb = SURE * SURE, 0.0, SURE * SURE
    for i in range(3):
        for k in range(3):
            aa += T[i, 1] * C[i, k] * T[k, 1]
            ab += T[i, 1] * C[i, k] * T[k, 2]
            bb += T[i, 2] * C[i, k] * T[k, 2]
    det = aa * bb - ab * ab
    for i in range(3):
        for k in range(3):
            out[i, k] = (
                bb * T[i, 1] * T[k, 1] - ab * (T[i, 1] * T[k, 2] + T[i, 2] * T[k, 1]) + aa * T[i, 2] * T[k, 2]
            ) / det


@fused_kernel
def _start(surfaces, bodies, choice, scan, stack, place, push, i):  # type: ignore[no-untyped-def]
    """Contact i at a place, with a likely push: a first guess."""
    c = scan.place[place]
    put(surfaces, bodies, stack, i, choice.primitive[place], c[0], c[1], c[2], 0.0, 0.0, 0.0)
    T = stack.frame[i]
    fx, fy, fz = lean_in(push[0], push[1], push[2], T[0, 0], T[1, 0], T[2, 0])
    stack.force[i, 0], stack.force[i, 1], stack.force[i, 2] = fx, fy, fz
    stack.prior_sharpness[i] = 0.0
    stack.prior_stiffness[i] = 0.0


@fused_kernel
def _room(surfaces, bodies, prior, stack, known, count):  # type: ignore[no-untyped-def]
    """Log of how far the places of the further contacts count as ones that can be touched."""
    score = 0.0
    for i in range(known, count):
        c, p, T = stack.point[i], stack.primitive[i], stack.frame[i]
        if stands_on(surfaces.link[p], c[2], T[2, 0], prior.offset):
            return -math.inf
        room = prior.room
        x, y, z = c[0] + room * T[0, 0], c[1] + room * T[1, 0], c[2] + room * T[2, 0]
        score += math.log(exposed(clearance(surfaces, bodies, p, x, y, z, 0.0), prior))
    return score


@fused_kernel
def _store(stack, offset, count, energy, score, sets, t):  # type: ignore[no-untyped-def]
    """Write the contacts in `stack` as explanation t."""
    sets.contacts[t] = count
    sets.energy[t] = energy
    sets.score[t] = score
    invert(stack, count * UNKNOWNS)
    for k in range(6):
        sets.wrench[t, k] = 0.0
    for i in range(count):
        sets.primitive[t, i] = stack.primitive[i]
        sets.torsion[t, i] = stack.torsion[i]
        for k in range(3):
            sets.point[t, i, k] = stack.point[i, k]
            sets.normal[t, i, k] = stack.frame[i, k, 0]
            sets.force[t, i, k] = stack.force[i, k]
        for k in range(6):
            sets.wrench[t, k] += stack.wrench[i, k]
        _spread_contact(stack, i, offset, sets.covariance[t, i], sets.force_covariance[t, i])
    _spread_wrench(stack, count * UNKNOWNS, sets.wrench_covariance[t])


@fused_kernel
def _spread_contact(stack, i, offset, place, force):  # type: ignore[no-untyped-def]
    """Covariance of place and force of contact i."""
    at = i * UNKNOWNS
    V, G, T = stack.inverse, stack.wrench_map, stack.kept_frame[i]
    for k in range(3):
        for a in range(3):
            place[k, a] = offset * offset * T[k, 0] * T[a, 0]
            for b in range(2):
                for d in range(2):
                    place[k, a] += T[k, 1 + b] * V[at + 4 + b, at + 4 + d] * T[a, 1 + d]
            force[k, a] = 0.0
            for b in range(3):
                for d in range(3):
                    force[k, a] += G[k, at + b] * V[at + b, at + d] * G[a, at + d]


@fused_kernel
def _spread_wrench(stack, size, out):  # type: ignore[no-untyped-def]
    """Covariance of the sum of all wrenches."""
    V, G = stack.inverse, stack.wrench_map
    for a in range(6):
        for b in range(a + 1):
            x = 0.0
            for i in range(size):
                for k in range(size):
                    x += G[a, i] * V[i, k] * G[b, k]
            out[a, b] = x
            out[b, a] = x


@fused_kernel
def _rank_sets(link, found, stored, apart):  # type: ignore[no-untyped-def]
    """Sort, drop doubles and the hopeless, turn scores into probabilities; how many are left."""
    order = found.order
    for i in range(stored):
        order[i] = i
    kept = 0
    best = 0.0
    total = 0.0
    for i in range(stored):
        for k in range(i + 1, stored):
            if found.score[order[k]] > found.score[order[i]]:
                order[i], order[k] = order[k], order[i]
        t = order[i]
        if i == 0:
            best = found.score[t]
        if not found.score[t] >= best - CUT:
            break
        if not _is_double_set(link, found, t, kept, apart):
            order[kept] = t
            found.probability[t] = math.exp(found.score[t] - best)
            total += found.probability[t]
            kept += 1
    for i in range(kept):
        found.probability[order[i]] /= total
    return kept


@fused_kernel
def _is_double_set(link, found, t, kept, apart):  # type: ignore[no-untyped-def]
    """Whether a better explanation, among the first `kept`, has the same contacts, in any order, closer than
    `apart`."""
    for i in range(kept):
        u = found.order[i]
        if found.contacts[u] != found.contacts[t]:
            continue
        near = 0
        for a in range(found.contacts[t]):
            for b in range(found.contacts[t]):
                dx = found.point[u, b, 0] - found.point[t, a, 0]
                dy = found.point[u, b, 1] - found.point[t, a, 1]
                dz = found.point[u, b, 2] - found.point[t, a, 2]
                if (
                    link[found.primitive[u, b]] == link[found.primitive[t, a]]
                    and dx * dx + dy * dy + dz * dz < apart * apart
                ):
                    near += 1
                    break
        if near == found.contacts[t]:
            return True
    return False
