"""The most probable places of a single further contact, where the joint optimization starts.

With the noise and the other contacts in one covariance, the measurement of a further contact is its wrench and
the information about it on each link (`contactsense.multi_contact.link_information`). That is the problem of a
single contact, with six unknowns instead of seven for each contact, and many seeds end in one mode.
"""

import math

import numpy as np

from contactsense.isolation.link_hypotheses import PRIOR_STD
from contactsense.kinematics.linalg.ldl import ldl_solve
from contactsense.kinematics.wrench_information import to_body_frame
from contactsense.multi_contact.buffers import (
    FX,
    FY,
    FZ,
    PrimitiveFrames,
    SeedingBuffers,
    SingleContactModes,
)
from contactsense.multi_contact.seed_samples import SeedSamples
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.surface.convex_primitives import Surfaces, project
from contactsense.robots.vectors import Vector
from contactsense.solvers.posterior import Contact, Prior, pushing_force
from contactsense.solvers.posterior_mode import find_posterior_mode

MODE_MARGIN = 15.0
"""Energy above the lowest at which a mode is dropped: in it, the forces of known contacts have a normal prior
only, so that the energy is an approximation."""


@fused_kernel
def refine_seeds(
    surfaces: Surfaces,
    prior: Prior,
    frames: PrimitiveFrames,
    seed_samples: SeedSamples,
    seeds: int,
    seeding: SeedingBuffers,
) -> int:
    """Fill `seeding.modes` with the most probable contacts near the seeds.

    Args:
        surfaces, prior, frames: As for `contactsense.multi_contact.joint_optimization.find_joint_mode`.
        seed_samples: The samples.
        seeds: Number of seeds.
        seeding: After `find_seeds` for one further contact.

    Returns:
        Number of different modes.
    """
    modes = seeding.modes
    _most_likely_wrenches(seeding)
    lowest_energy = math.inf
    count = 0
    for s in range(seeds):
        sample = seeding.seed[s, 0]
        p, link = seed_samples.primitive[sample], seed_samples.link[sample]
        R, o, c = frames.rotation[p], frames.origin[p], seeding.point_normal[sample]
        block, lane = seeding.block[seed_samples.block[sample]], seed_samples.lane[sample]
        to_body_frame(
            seeding.link_wrench[link], seeding.link_information[link], R, o, modes.wrench, modes.information
        )
        kind, size = surfaces.kind[p], surfaces.size[p]
        x, y, z = _to_body(R, (c[0] - o[0], c[1] - o[1], c[2] - o[2]))
        _, x, y, z, n1, n2, n3 = project(kind, size, x, y, z)
        normal = (n1, n2, n3)
        force = _to_body(R, (block[FX + lane], block[FY + lane], block[FZ + lane]))
        start = Contact((x, y, z), normal, pushing_force(force, normal), 0.0)
        limit = lowest_energy + MODE_MARGIN - seeding.link_energy[link]
        mode = find_posterior_mode(
            kind, size, modes.wrench, modes.information, prior, limit, start, modes.search
        )
        if mode.log_evidence == -math.inf:
            continue
        energy = mode.energy + seeding.link_energy[link]
        lowest_energy = min(lowest_energy, energy)
        a, f = _to_base(R, mode.contact.point), _to_base(R, mode.contact.force)
        point = (o[0] + a[0], o[1] + a[1], o[2] + a[2])
        if not _is_known_mode(modes, count, p, point, 2.0 * prior.surface_deviation):
            _insert_mode(modes, count, energy, p, point, f, mode.contact.torsion)
            count += 1
    while count > 0 and modes.energy[count - 1] > lowest_energy + MODE_MARGIN:
        count -= 1
    return count


@fused_kernel
def _most_likely_wrenches(seeding: SeedingBuffers) -> None:
    """Fill `seeding.link_wrench` and `seeding.link_energy`.

    The information becomes regular where the rows do not determine all of a wrench.
    """
    for link in range(seeding.link_vector.shape[0]):
        L, h, w, H = (
            seeding.link_information[link],
            seeding.link_vector[link],
            seeding.link_wrench[link],
            seeding.modes.information,
        )
        for a in range(6):
            L[a, a] += 1.0 / PRIOR_STD**2
            w[a] = h[a]
            for b in range(6):
                H[a, b] = L[a, b]
        _, gain, _, _, _ = ldl_solve(H, w)
        seeding.link_energy[link] = -gain


@fused_kernel
def _is_known_mode(modes: SingleContactModes, count: int, p: int, point: Vector, min_separation: float) -> bool:
    """Whether one of the first `count` modes is within `min_separation` [m] on the same primitive."""
    for i in range(count):
        dx, dy, dz = (
            modes.point[i, 0] - point[0],
            modes.point[i, 1] - point[1],
            modes.point[i, 2] - point[2],
        )
        if modes.primitive[i] == p and dx * dx + dy * dy + dz * dz < min_separation * min_separation:
            return True
    return False


@fused_kernel
def _insert_mode(
    modes: SingleContactModes,
    count: int,
    energy: float,
    p: int,
    point: Vector,
    force: Vector,
    torsion: float,
) -> None:
    """Insert a mode into the first `count`, which are sorted by rising energy."""
    i = count
    while i > 0 and modes.energy[i - 1] > energy:
        modes.energy[i], modes.primitive[i] = modes.energy[i - 1], modes.primitive[i - 1]
        modes.torsion[i] = modes.torsion[i - 1]
        for k in range(3):
            modes.point[i, k], modes.force[i, k] = modes.point[i - 1, k], modes.force[i - 1, k]
        i -= 1
    modes.energy[i], modes.primitive[i], modes.torsion[i] = energy, p, torsion
    modes.point[i, 0], modes.point[i, 1], modes.point[i, 2] = point
    modes.force[i, 0], modes.force[i, 1], modes.force[i, 2] = force


@fused_kernel
def _to_body(R: np.ndarray, a: Vector) -> Vector:
    """A vector in the axes of a body: R^T a."""
    return (
        R[0, 0] * a[0] + R[1, 0] * a[1] + R[2, 0] * a[2],
        R[0, 1] * a[0] + R[1, 1] * a[1] + R[2, 1] * a[2],
        R[0, 2] * a[0] + R[1, 2] * a[1] + R[2, 2] * a[2],
    )


@fused_kernel
def _to_base(R: np.ndarray, a: Vector) -> Vector:
    """A vector in the axes of the base: R a."""
    return (
        R[0, 0] * a[0] + R[0, 1] * a[1] + R[0, 2] * a[2],
        R[1, 0] * a[0] + R[1, 1] * a[1] + R[1, 2] * a[2],
        R[2, 0] * a[0] + R[2, 1] * a[1] + R[2, 2] * a[2],
    )
