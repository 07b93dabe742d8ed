"""Exact solvers of the contact sensing problem of Bicchi, Salisbury & Brock (1993).

Given force and moment (f, m) on a convex body, find its contact centroid c: m = xi n(c) + c x f with
f.n(c) < 0.
"""

from contactsense.solvers.compound_bodies import Compound, Part
from contactsense.solvers.most_probable import ContactPrior, ProbableContact
from contactsense.solvers.packed_primitive import solve_primitive
from contactsense.solvers.paper_surfaces import Cone, Cylinder, Ellipsoid, Placed, Plane, Sphere
from contactsense.solvers.rounded_bodies import (
    Box,
    Capsule,
    Fingertip,
    Polytope,
    Revolved,
    TaperedCapsule,
    place,
)
from contactsense.solvers.sensitivity import Sensitivity, sensitivity
from contactsense.solvers.smooth_bodies import Convex, Paraboloid, Superquadric
from contactsense.solvers.solution import Status
from contactsense.solvers.solve import solve
from contactsense.solvers.solve_wrench import METHODS, Method, Solution, Solutions, solve_batch
from contactsense.solvers.surface import Surface

__all__ = [
    "METHODS",
    "Box",
    "Capsule",
    "Compound",
    "Cone",
    "ContactPrior",
    "Convex",
    "Cylinder",
    "Ellipsoid",
    "Fingertip",
    "Method",
    "Paraboloid",
    "Part",
    "Placed",
    "Plane",
    "Polytope",
    "ProbableContact",
    "Revolved",
    "Sensitivity",
    "Solution",
    "Solutions",
    "Sphere",
    "Status",
    "Superquadric",
    "Surface",
    "TaperedCapsule",
    "place",
    "sensitivity",
    "solve",
    "solve_batch",
    "solve_primitive",
]
