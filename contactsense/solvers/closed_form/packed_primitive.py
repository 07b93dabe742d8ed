"""Exact contact on any packed primitive of a robot: the kinds and sizes of
`contactsense.robots.surface.convex_primitives`."""

import numpy as np

from contactsense.robots.jit.kernel import kernel
from contactsense.robots.surface.convex_primitives import ELLIPSOID, REVOLVED
from contactsense.solvers.closed_form.box import solve_box
from contactsense.solvers.closed_form.ellipsoid import solve_ellipsoid, solve_sphere
from contactsense.solvers.closed_form.revolved import solve_revolved
from contactsense.solvers.solution import Answer
from contactsense.solvers.wrench import Wrench


@kernel
def solve_primitive(kind: int, size: np.ndarray, wrench: Wrench) -> Answer:
    """Contact centroid on a primitive, in its body frame.

    Args:
        kind: `REVOLVED`, `ELLIPSOID` or `BOX`.
        size: Dimensions of the primitive as `contactsense.robots.surface.convex_primitives` packs them, shape
            (8,).
        wrench: Wrench on the body, body frame.

    Returns:
        See `contactsense.solvers.solution`.
    """
    if kind == REVOLVED:
        if size[0] == 0.0 and size[1] == 0.0 and size[2] == 0.0:
            return solve_sphere(wrench, size[3])
        return solve_revolved(wrench, size[0], size[1], size[2], size[3])
    if kind == ELLIPSOID:
        return solve_ellipsoid(wrench, size[0], size[1], size[2])
    return solve_box(wrench, (size[0], size[1], size[2]), size[3])
