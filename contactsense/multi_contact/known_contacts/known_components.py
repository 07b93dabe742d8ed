"""The components of a broad known place: narrower normal distributions, each with the forces that the earlier
sample measured if the contact is there.

The middles of the components spread in all directions in which the stated covariance does, along the normal
as well: a place that is known by centimetres may be on the far side of the link. Each component is on the
primitive that is nearest to its middle. Across the surface it is at least as wide as along it: a place on a
face across an edge is as improbable as one as far away on the same face.

If forces are held, a component has forces of its own. The joints measure force times lever, so how a force
depends on its place is linear only near that place. The earlier sample is taken to be what the stated
contacts predict, and solved for the forces with the contact in the middle of each component, one in each
lane.
"""

import math

import numpy as np

from contactsense.localization.surface.mean_surface_distance import mean_surface_distance
from contactsense.localization.surface.placed_surface import PlacedSurface
from contactsense.multi_contact.explanations.pooled_places import bilinear_form
from contactsense.multi_contact.joint.contact_step import set_contact, vector_of
from contactsense.multi_contact.joint.initial_contacts import weigh_priors
from contactsense.multi_contact.joint.joint_energy import linearize
from contactsense.multi_contact.joint.joint_optimization import find_joint_modes, take_rows
from contactsense.multi_contact.joint.joint_problem import JointProblem
from contactsense.multi_contact.joint.known_rows import Known, KnownRows
from contactsense.multi_contact.known_contacts.known_prior import MIN_POINT_DEVIATION, fill_rows
from contactsense.multi_contact.memory.buffers import (
    Measurement,
    MeasurementRows,
    MultiContactBuffers,
)
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.vectors import Vector, add_scaled, cross, rotate_back, subtract, vector
from contactsense.solvers.posterior.contact_prior import Prior, pushing_force

from contactsense.multi_contact.memory.joint_layout import (  # isort: skip
    ACTIVE, EXTENT, FX, LOG_EVIDENCE, NX, OFFSET, PX, SX, TILT, TORSION, TX,
)  # fmt: skip

COMPONENT_WIDTH = 0.5
"""Standard deviation of a component over that of the stated distribution."""
_RADIUS = math.sqrt(2.0 * LANES / (LANES - 1.0) * (1.0 - COMPONENT_WIDTH**2))
_ANGLES = 2.0 * np.pi / (LANES - 1.0) * np.arange(LANES - 1)
COMPONENTS = np.vstack(
    (np.zeros(3), _RADIUS * np.column_stack((np.cos(_ANGLES), np.sin(_ANGLES), np.cos(2.0 * _ANGLES))))
)
"""Middles of the components, which weigh the same, of a standard normal distribution along two tangents and
the normal; its covariance is that of the mixture. Shape (LANES, 3)."""
FIXED = 1e14
"""Information on a place that is not to move [1/m^2]."""


@fused_kernel
def fill_component_priors(
    surface: PlacedSurface,
    prior: Prior,
    buffers: MultiContactBuffers,
    measurement: Measurement,
    known: Known,
    i: int,
) -> KnownRows:
    """Fill the rows of the known contacts with contact i in another component in each lane.

    Args:
        surface, prior: Where contacts may be, and their prior.
        buffers: The known contacts. In `joint`, `known_rows` and `known_mean` are filled;
            in `known_prior`, `primitive` and `evidence`.
        measurement: The measurement.
        known: Their number, and what has changed since the earlier sample, in which they were measured.
        i: The one that is divided.

    Returns:
        Numbers of known contacts and of their rows.
    """
    (rows, m), surfaces = measurement, surface.surfaces
    joint, scratch = buffers.joint, buffers.known_prior
    _predict_earlier_sample(surface, prior, buffers, measurement, known.contacts)
    _place_components(surface, prior, buffers, known.contacts, i)
    if known.drift < math.inf:
        earlier = MeasurementRows(
            rows.matrix, scratch.earlier, rows.seen, rows.factor, rows.row, rows.transformed
        )
        problem = JointProblem(surfaces, prior, Measurement(earlier, m), KnownRows(0, 0), known.contacts)
        find_joint_modes(problem, LANES, math.inf, joint)
        for j in range(LANES):
            joint.lane[ACTIVE, j] = 1.0
        take_rows(problem, joint)
        linearize(problem, joint)
    size = 0
    for j in range(LANES):
        size = fill_rows(prior, scratch.place_covariance, known, joint, scratch, (j, j + 1))
        for e in range(known.contacts):
            block, mean = joint.contact[e], joint.known_mean[e]
            for k in range(3):
                mean[k * LANES + j] = block[PX + k * LANES + j]
                mean[(3 + k) * LANES + j] = block[FX + k * LANES + j]
            mean[6 * LANES + j], mean[7 * LANES + j] = block[TORSION + j], block[OFFSET + j]
            block[EXTENT + j] = 0.0
            weigh_priors(known, j, block)
    known_rows = KnownRows(known.contacts, size)
    alone = JointProblem(surfaces, prior, Measurement(rows, 0), known_rows, known.contacts)
    find_joint_modes(alone, LANES, math.inf, joint)
    for j in range(LANES):
        scratch.evidence[j] = joint.lane[LOG_EVIDENCE, j]
    return known_rows


@fused_kernel
def _predict_earlier_sample(
    surface: PlacedSurface,
    prior: Prior,
    buffers: MultiContactBuffers,
    measurement: Measurement,
    known_count: int,
) -> None:
    """Fill the rows that the known contacts predict, and lane 0 with these."""
    joint, known, value = buffers.joint, buffers.known, buffers.known_prior.earlier
    rows, m = measurement
    for r in range(m):
        value[r] = 0.0
    for e in range(known_count):
        p, f = known.primitive[e], vector(known.force[e])
        set_contact(surface, prior, joint, 0, e, p, vector(known.point[e]), f)
        point, normal = vector_of(joint.contact[e], PX, 0), vector_of(joint.contact[e], NX, 0)
        moment = add_scaled(cross(point, f), known.torsion[e], normal)
        A = rows.matrix[surface.surfaces.link[p]]
        for r in range(m):
            for k in range(3):
                value[r] += A[r, k] * f[k] + A[r, 3 + k] * moment[k]


@fused_kernel
def _place_components(
    surface: PlacedSurface, prior: Prior, buffers: MultiContactBuffers, known_count: int, i: int
) -> None:
    """Put the known contacts into all lanes, at fixed places, contact i in the middle of another component in
    each. Before the call, lane 0 holds them as stated."""
    joint, known, scratch = buffers.joint, buffers.known, buffers.known_prior
    point, C, block = vector(known.point[i]), known.covariance[i], joint.contact[i]
    s, t, n = vector_of(block, SX, 0), vector_of(block, TX, 0), vector_of(block, NX, 0)
    # Root of the covariance: (a x, b x + d y, c x + e y + g z) along s, t and n.
    a = math.sqrt(bilinear_form(C, s, s) + MIN_POINT_DEVIATION**2)
    b, c = bilinear_form(C, s, t) / a, bilinear_form(C, s, n) / a
    d = math.sqrt(max(bilinear_form(C, t, t) - b * b, 0.0) + MIN_POINT_DEVIATION**2)
    e = (bilinear_form(C, t, n) - b * c) / d
    along_normal = bilinear_form(C, n, n)
    g = math.sqrt(max(along_normal - c * c - e * e, 0.0))
    missing = max(0.5 * (C[0, 0] + C[1, 1] + C[2, 2] - along_normal) - along_normal, 0.0)
    for q in range(known_count):
        for k in range(3):
            for h in range(3):
                variance = known.covariance[q, k, h]
                if q == i:
                    variance = COMPONENT_WIDTH**2 * (variance + missing * n[k] * n[h])
                scratch.place_covariance[q, k, h] = variance
    for j in range(LANES):
        for q in range(known_count):
            p, at, own = known.primitive[q], vector(known.point[q]), joint.contact[q]
            if q == i:
                x, y, z = COMPONENTS[j, 0], COMPONENTS[j, 1], COMPONENTS[j, 2]
                at = add_scaled(add_scaled(point, a * x, s), b * x + d * y, t)
                at = add_scaled(at, c * x + e * y + g * z, n)
                p = _nearest_primitive(surface, surface.surfaces.link[p], at)
                scratch.primitive[j] = p
            set_contact(surface, prior, joint, j, q, p, at, (0.0, 0.0, 0.0))
            push = pushing_force(vector(known.force[q]), vector_of(own, NX, j))
            for k in range(3):
                own[FX + k * LANES + j] = push[k]
            own[TORSION + j], own[EXTENT + j], own[TILT + j] = known.torsion[q], FIXED, 0.0


@fused_kernel
def _nearest_primitive(surface: PlacedSurface, link: int, point: Vector) -> int:
    """The primitive of a link whose mean surface is nearest to a point [m]; inside several, the deepest."""
    surfaces, deviations, frames = surface
    nearest, found = math.inf, 0
    for p in range(surfaces.start[link], surfaces.start[link + 1]):
        at = rotate_back(frames.rotation[p], subtract(point, vector(frames.origin[p])))
        distance = mean_surface_distance(surfaces, deviations, p, at)
        if distance < nearest:
            nearest, found = distance, p
    return found
