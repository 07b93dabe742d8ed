"""What is assumed of a contact before it is measured, and the contact on a surface that a search for the most
probable one improves. The posterior's formulas: `contactsense.solvers.posterior.equations`."""

import math
from typing import Annotated, NamedTuple

from contactsense.robots.jit.declaration import Floats
from contactsense.robots.jit.kernel import fused_kernel, inlined_fused_kernel
from contactsense.robots.vectors import Vector
from contactsense.solvers.posterior.block import LENGTH

STUDENT_DOF = 4.0
"""Degrees of freedom nu of the Student t distribution of the friction ratio."""
FORCE_POWER = 4.0
"""The widths of the priors of normal force, torsion and tangential force along both tangents are proportional
to the normal force F: their joint density is proportional to F to the power of minus this."""
MIN_INITIAL_FORCE = 1e-3
"""Initial force of a search if the fused wrench has none [N]."""


class Prior(NamedTuple):
    """Prior of a contact, before any measurement."""

    friction_ratio: float
    """Standard deviation of tangential over normal force along each tangent: half the friction
    coefficient."""
    torsion_lever: float
    """Standard deviation of torsion over normal force [m]."""
    surface_deviation: float
    """Standard deviation of the real surface's offset from the primitive [m]."""
    force: float
    """Median of the normal force [N]; its logarithm has standard deviation 1."""
    clearance: float
    """Free height above the surface that a touching object needs [m]."""
    area: float
    """Area of the touchable surface [m^2]."""
    log_link_density: Annotated[Floats, "links"]
    """Log of the density of places on each link relative to 1 / `area`, that of places uniform by area. It is
    the same on the whole surface of a link."""


class Contact(NamedTuple):
    """A contact on a surface, in the frame of the wrench."""

    point: Vector
    """Contact centroid on the surface [m]."""
    normal: Vector
    """Outward unit normal there."""
    force: Vector
    """Force on the body [N]."""
    torsion: float
    """Moment on the body about the normal [Nm]."""


class SearchBuffers(NamedTuple):
    """Scratch arrays of the search for the most probable contact."""

    normal_equations: Annotated[Floats, "6, 6"]
    """Upper triangle: Gauss-Newton matrix of (f, xi, v1, v2)."""
    gradient: Annotated[Floats, "6"]
    """Gradient of the energy, then the step."""
    frame: Annotated[Floats, "3, 3"]
    """Columns: outward normal and two tangents, body axes."""
    block: Annotated[Floats, f"{LENGTH}"]
    """Block, see `contactsense.solvers.posterior.block`."""


@inlined_fused_kernel
def with_surface(prior: Prior, friction_ratio: float, surface_deviation: float) -> Prior:
    """The prior on another surface; a compiled `_replace`."""
    return Prior(
        friction_ratio,
        prior.torsion_lever,
        surface_deviation,
        prior.force,
        prior.clearance,
        prior.area,
        prior.log_link_density,
    )


@fused_kernel
def log_prior(prior: Prior, force: float) -> float:
    """Log of the prior density at its peak for a force of that magnitude [N], times (2 pi)^3; what depends on
    its direction is part of the energy.

    The place is uniform by area here: `Prior.log_link_density` belongs to the link. The factor is that of
    Laplace's integral over force, torsion and place.
    """
    return math.log(
        2.0 * math.pi / (prior.friction_ratio * prior.friction_ratio * prior.torsion_lever * prior.area)
    ) - FORCE_POWER * math.log(force)


@fused_kernel
def pushing_force(force: Vector, normal: Vector) -> Vector:
    """The force, with its normal part raised until it pushes: a valid initial value for the search [N]."""
    (fx, fy, fz), (nx, ny, nz) = force, normal
    normal_force = -(fx * nx + fy * ny + fz * nz)
    min_normal_force = 0.1 * max(math.sqrt(fx * fx + fy * fy + fz * fz), MIN_INITIAL_FORCE)
    missing = max(min_normal_force - normal_force, 0.0)
    return fx - missing * nx, fy - missing * ny, fz - missing * nz
