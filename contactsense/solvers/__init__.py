"""Exact solvers of the contact sensing problem of Bicchi, Salisbury & Brock (1993).

Given force and moment (f, m) on a convex body, find its contact centroid c: m = xi n(c) + c x f with
f.n(c) < 0. `closed_form` solves it on bodies of one kind each, `general_convex` on any smooth convex body;
`solve_contact` and `solve_wrench` choose the solver of one of the `bodies`. For noisy wrenches `posterior`
finds the most probable contact.
"""

from typing import TYPE_CHECKING

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "bodies.compound_bodies": ["Compound", "Part"],
        "posterior.most_probable": ["ContactPrior", "ProbableContact"],
        "closed_form.packed_primitive": ["solve_primitive"],
        "bodies.paper_surfaces": ["Cone", "Cylinder", "Ellipsoid", "Placed", "Plane", "Sphere"],
        "bodies.rounded_bodies": [
            "Box",
            "Capsule",
            "Fingertip",
            "Polytope",
            "Revolved",
            "TaperedCapsule",
            "place",
        ],
        "centroid_sensitivity": ["Sensitivity", "sensitivity"],
        "bodies.smooth_bodies": ["Convex", "Paraboloid", "Superquadric"],
        "solution": ["Status"],
        "solve_contact": ["solve"],
        "solve_wrench": ["METHODS", "Method", "Solution", "Solutions", "solve_batch"],
        "bodies.surface": ["Surface"],
    },
)

if TYPE_CHECKING:
    from contactsense.solvers.bodies.compound_bodies import Compound as Compound
    from contactsense.solvers.bodies.compound_bodies import Part as Part
    from contactsense.solvers.bodies.paper_surfaces import Cone as Cone
    from contactsense.solvers.bodies.paper_surfaces import Cylinder as Cylinder
    from contactsense.solvers.bodies.paper_surfaces import Ellipsoid as Ellipsoid
    from contactsense.solvers.bodies.paper_surfaces import Placed as Placed
    from contactsense.solvers.bodies.paper_surfaces import Plane as Plane
    from contactsense.solvers.bodies.paper_surfaces import Sphere as Sphere
    from contactsense.solvers.bodies.rounded_bodies import Box as Box
    from contactsense.solvers.bodies.rounded_bodies import Capsule as Capsule
    from contactsense.solvers.bodies.rounded_bodies import Fingertip as Fingertip
    from contactsense.solvers.bodies.rounded_bodies import Polytope as Polytope
    from contactsense.solvers.bodies.rounded_bodies import Revolved as Revolved
    from contactsense.solvers.bodies.rounded_bodies import TaperedCapsule as TaperedCapsule
    from contactsense.solvers.bodies.rounded_bodies import place as place
    from contactsense.solvers.bodies.smooth_bodies import Convex as Convex
    from contactsense.solvers.bodies.smooth_bodies import Paraboloid as Paraboloid
    from contactsense.solvers.bodies.smooth_bodies import Superquadric as Superquadric
    from contactsense.solvers.bodies.surface import Surface as Surface
    from contactsense.solvers.centroid_sensitivity import Sensitivity as Sensitivity
    from contactsense.solvers.centroid_sensitivity import sensitivity as sensitivity
    from contactsense.solvers.closed_form.packed_primitive import solve_primitive as solve_primitive
    from contactsense.solvers.posterior.most_probable import ContactPrior as ContactPrior
    from contactsense.solvers.posterior.most_probable import ProbableContact as ProbableContact
    from contactsense.solvers.solution import Status as Status
    from contactsense.solvers.solve_contact import solve as solve
    from contactsense.solvers.solve_wrench import METHODS as METHODS
    from contactsense.solvers.solve_wrench import Method as Method
    from contactsense.solvers.solve_wrench import Solution as Solution
    from contactsense.solvers.solve_wrench import Solutions as Solutions
    from contactsense.solvers.solve_wrench import solve_batch as solve_batch
