"""Where on a surface does a wrench enter? The contact sensing problem of Bicchi, Salisbury & Brock (1993),
solved.

Given force and moment (f, m) on a convex body, find its contact centroid c: m = xi n(c) + c x f with f.n(c) <
0.
"""

from contactsense.solvers.answer import Status
from contactsense.solvers.bodies import (
    Box,
    Capsule,
    Fingertip,
    Polytope,
    Revolved,
    TaperedCapsule,
    place,
)
from contactsense.solvers.parts import Compound, Part
from contactsense.solvers.primitive import solve_primitive
from contactsense.solvers.sensitivity import Sensitivity, sensitivity
from contactsense.solvers.smooth import Convex, Paraboloid, Superquadric
from contactsense.solvers.solve import METHODS, Method, Solution, Solutions, solve, solve_batch
from contactsense.solvers.surface import Surface
from contactsense.solvers.surfaces import Cone, Cylinder, Ellipsoid, Placed, Plane, Sphere

__all__ = [
    "METHODS",
    "Box",
    "Capsule",
    "Compound",
    "Cone",
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
