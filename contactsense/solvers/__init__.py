"""Where on a surface does a wrench enter? The contact sensing problem of Bicchi, Salisbury & Brock (1993),
solved.

Given force and moment (f, m) on a convex body, find its contact centroid c: m = xi n(c) + c x f with f.n(c) <
0.
"""

from contactsense.solvers.answer import Status
from contactsense.solvers.primitive import solve_primitive
from contactsense.solvers.solve import METHODS, Method, Solution, Solutions, solve, solve_batch
from contactsense.solvers.surfaces import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    Placed,
    Plane,
    Revolved,
    Sphere,
    Surface,
    TaperedCapsule,
    place,
)

__all__ = [
    "METHODS",
    "Box",
    "Capsule",
    "Cone",
    "Cylinder",
    "Ellipsoid",
    "Method",
    "Placed",
    "Plane",
    "Revolved",
    "Solution",
    "Solutions",
    "Sphere",
    "Status",
    "Surface",
    "TaperedCapsule",
    "place",
    "solve",
    "solve_batch",
    "solve_primitive",
]
