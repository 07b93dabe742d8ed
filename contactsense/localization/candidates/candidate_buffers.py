"""Arrays for the candidate contacts of one measurement, and how a candidate is stored in them."""

from typing import Annotated, NamedTuple

import numpy as np

from contactsense.localization.candidates.simd_neighbourhood import LENGTH as POINTS_LENGTH
from contactsense.localization.candidates.surface_tails import with_surface_error
from contactsense.localization.surface.line_distance import SPHERES_LENGTH
from contactsense.localization.surface.local_prior import SurfaceError
from contactsense.localization.surface.primitive_frames import Frame
from contactsense.robots.jit.declaration import Floats, Integers
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.vectors import add, rotate, vector
from contactsense.solvers.posterior.mode import Mode

MAX_CANDIDATES = 8
"""Number of candidates that the search over the surface returns at most."""


class Candidates(NamedTuple):
    """Candidate contacts of one measurement, one per row. `order` lists the valid rows. Base frame.

    Row p belongs to primitive p in the search along the line of action; candidates at unmodelled places take
    rows that are free. The other searches fill rows in the order in which candidates are found, and a
    primitive may have several.
    """

    order: Annotated[Integers, "candidates"]
    """Rows by falling probability."""
    primitive: Annotated[Integers, "candidates"]
    """Index of the touched primitive."""
    score: Annotated[Floats, "candidates"]
    """Log evidence."""
    probability: Annotated[Floats, "candidates"]
    """Probability, set for the rows listed in `order`."""
    point: Annotated[Floats, "candidates, 3"]
    """Contact centroid [m]."""
    normal: Annotated[Floats, "candidates, 3"]
    """Outward unit normal."""
    force: Annotated[Floats, "candidates, 3"]
    """Force on the robot [N]."""
    torsion: Annotated[Floats, "candidates"]
    """Moment on the robot about the outward normal [Nm]."""
    covariance: Annotated[Floats, "candidates, 3, 3"]
    """Covariance of `point` [m^2]."""
    wrench: Annotated[Floats, "primitives, 6"]
    """Scratch: fused wrench of the link hypothesis in the body frame of each primitive [N, Nm] ..."""
    information: Annotated[Floats, "primitives, 6, 6"]
    """... and its information matrix."""
    deviation_cell: Annotated[Integers, "primitives"]
    """Scratch: cell of `contactsense.localization.surface.local_prior` where the search on each primitive
    begins."""
    bound: Annotated[Floats, "primitives"]
    """Scratch: lower bound of the energy of a contact on each primitive."""
    near: Annotated[Integers, "primitives"]
    """Scratch: primitives that may cover the neighbourhood of one candidate."""
    points: Annotated[Floats, f"{POINTS_LENGTH}"]
    """Scratch: see `contactsense.localization.candidates.simd_neighbourhood`."""
    spheres: Annotated[Floats, f"{SPHERES_LENGTH}"]
    """Scratch: block of spheres for `contactsense.localization.surface.line_distance`."""


@fused_kernel
def rotate_into(R: np.ndarray, x: float, y: float, z: float, out: np.ndarray) -> None:
    """out = R (x, y, z)."""
    for i in range(3):
        out[i] = R[i, 0] * x + R[i, 1] * y + R[i, 2] * z


@fused_kernel
def store_candidate(
    candidates: Candidates,
    row: int,
    p: int,
    frame: Frame,
    mode: Mode,
    error: SurfaceError,
) -> None:
    """Store a contact found on primitive p in row `row`, in the base frame.

    The covariance of the point is that of the posterior with the effects of the real surface
    (`contactsense.localization.candidates.surface_tails`).

    Args:
        candidates: Arrays to write to.
        row: Row to write.
        p: Index of the primitive.
        frame: Its body frame, as moved to the mean surface.
        mode: The contact, body frame.
        error: Of the surface there.
    """
    point, normal, force, xi = mode.contact
    v11, v12, v22 = with_surface_error(mode.variances, mode.tangents, mode.contact, error)
    candidates.primitive[row] = p
    R, o = frame.rotation, vector(frame.origin)
    # Everything is read before anything is written: the compiler cannot know that these are other arrays.
    c, n, f = add(o, rotate(R, point)), rotate(R, normal), rotate(R, force)
    t1, t2 = rotate(R, mode.tangents[0]), rotate(R, mode.tangents[1])
    along_normal = error.offset * error.offset
    candidates.torsion[row] = xi
    for i in range(3):
        candidates.point[row, i], candidates.normal[row, i], candidates.force[row, i] = c[i], n[i], f[i]
        for k in range(3):
            candidates.covariance[row, i, k] = (
                t1[i] * (v11 * t1[k] + v12 * t2[k])
                + t2[i] * (v12 * t1[k] + v22 * t2[k])
                + n[i] * n[k] * along_normal
            )
