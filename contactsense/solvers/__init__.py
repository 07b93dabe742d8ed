"""Where on a surface does a wrench enter? The contact sensing problem of Bicchi, Salisbury & Brock (1993),
solved.

Given force and moment (f, m) on a convex body, find its contact centroid c: m = xi n(c) + c x f with f.n(c) <
0.
"""

from contactsense.solvers.answer import Status
from contactsense.solvers.solve import METHODS, Method, Solution, Solutions, solve, solve_batch
from contactsense.solvers.surfaces import (
    Capsule,
    Cylinder,
    Ellipsoid,
    Placed,
    Plane,
    Sphere,
    Surface,
    TaperedCapsule,
)

__all__ = [
    "METHODS",
    "Capsule",
    "Cylinder",
    "Ellipsoid",
    "Method",
    "Placed",
    "Plane",
    "Solution",
    "Solutions",
    "Sphere",
    "Status",
    "Surface",
    "TaperedCapsule",
    "solve",
    "solve_batch",
]
