"""Solutions against exact arithmetic: contact, condition number and status over every patch of every surface.

Nothing is taken from the solvers: surfaces are level sets of their own, contacts are constructed on them in
mpmath, and the rounded wrench is solved there again.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from contactsense.benchmarks.solvers.level_sets import Patch, numbers, patches, vector
from contactsense.benchmarks.solvers.reference import (
    EPS,
    Reference,
    cross,
    dot,
    error_in_ulps,
    normal_at,
    refine,
)
from contactsense.solvers import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    Fingertip,
    Paraboloid,
    Plane,
    Polytope,
    Revolved,
    Sphere,
    Superquadric,
    Surface,
    TaperedCapsule,
    solve,
)

TORSIONS = (0.0, 1e-8, 0.1, 10.0)
"""Torsion relative to force times size."""

ULPS = 16.0

_CUBE = [(x, y, z) for x in (-0.1, 0.1) for y in (-0.04, 0.04) for z in (-0.07, 0.07)]

SURFACES: dict[str, Surface] = {
    "sphere": Sphere(0.05),
    "ellipsoid 1 : 2 : 4": Ellipsoid(0.05, 0.1, 0.2),
    "needle 1 : 1e-6 : 1e-6": Ellipsoid(1.0, 1e-6, 1e-6),
    "cylinder": Cylinder(0.05),
    "plane": Plane((1.0, -2.0, 3.0), 0.1),
    "cone": Cone(0.05, 0.2),
    "steep cone": Cone(0.05, -50.0),
    "paraboloid": Paraboloid(20.0, 10.0, 0.1),
    "capsule": Capsule(0.2, 0.06),
    "tapered capsule": TaperedCapsule(0.2, 0.08, 0.05),
    "steep tapered capsule": TaperedCapsule(0.1, 0.3, 0.1000001),
    "steepest tapered capsule": TaperedCapsule(0.1, 0.3, 0.100000000001),
    "fingertip": Fingertip(0.03),
    "rounded cylinder": Revolved(0.1, 0.05, 0.05, 0.01),
    "rounded cone": Revolved(0.1, 0.05, 0.03, 0.01),
    "rounded disc": Revolved(0.0, 0.05, 0.05, 0.01),
    "cylinder, rounding 1e-7": Revolved(0.1, 0.05, 0.05, 1e-7),
    "cone, rounding 1e-10": Revolved(0.1, 0.05, 0.03, 1e-10),
    "rounded box": Box(0.1, 0.04, 0.07, 0.01),
    "superquadric, exponents 2.5, 3": Superquadric(0.05, 0.07, 0.1, 2.5, 3.0),
    "superquadric, exponent 8": Superquadric(0.05, 0.07, 0.1, 8.0, 8.0),
    "superquadric, exponent 64": Superquadric(0.05, 0.07, 0.1, 64.0, 64.0),
    "rounded polytope": Polytope(_CUBE, 0.01),
}

SAME: dict[str, Surface] = {"rounded polytope": Box(0.1, 0.04, 0.07, 0.01)}
"""The same body with a reference, for one whose own patches are computed by the solver."""


@dataclass(frozen=True)
class Row:
    """One surface."""

    surface: str
    wrenches: int
    failures: int
    """Number of wrenches without the status `OK`, except those that rounding of the moment decides."""
    worst: float
    """Largest error, in ulps times the condition number."""
    condition: float
    """Largest ratio of the true condition number to the reported one: above 1 it is understated."""


def _wrench(
    patch: Patch, rng: np.random.Generator, torsion: float
) -> tuple[np.ndarray, np.ndarray, Reference | None]:
    """A random pushing wrench at a random point, and its exact contact."""
    mp = numbers()
    c = patch.draw(rng)
    n = normal_at(patch, c)
    force = 10.0 * rng.normal(size=3) * rng.lognormal()
    if dot(vector(force), n) > 0:
        force = -force
    size = float(max(abs(x) for x in c)) * float(np.linalg.norm(force))
    xi = mp.mpf(torsion * size * float(rng.normal()))
    moment = np.array([float(a + xi * b) for a, b in zip(cross(c, vector(force)), n, strict=True)])
    return force, moment, refine(patch, force, moment, c, xi)


def rows(count: int, tick: Callable[[str], None]) -> Iterator[Row]:
    """Measure all surfaces, `count` wrenches each at least, all patches and torsions alike."""
    for name, surface in SURFACES.items():
        tick(name)
        rng = np.random.default_rng(6)
        there = patches(SAME.get(name, surface))
        share = -(-count // (len(there) * len(TORSIONS)))
        solved = failures = 0
        worst = understated = 0.0
        for patch in there:
            for torsion in TORSIONS:
                for _ in range(share):
                    force, moment, exact = _wrench(patch, rng, torsion)
                    if exact is None:
                        # The rounded wrench acts beside the patch.
                        continue
                    found = solve(surface, force, moment)
                    solved += 1
                    if found.ok:
                        error = error_in_ulps(found.centroid, exact, force, moment)
                        worst = max(worst, error)
                        understated = max(understated, exact.condition / found.condition)
                    elif exact.cosine > ULPS * EPS**0.5 and exact.margin > ULPS * EPS:
                        failures += 1
        yield Row(name, solved, failures, worst, understated)
