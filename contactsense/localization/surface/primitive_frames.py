"""Body frames of all primitives in the base frame, in the posture of one measurement."""

from typing import Annotated, NamedTuple

import numpy as np

from contactsense.kinematics.model import Motion
from contactsense.kinematics.wrench_information import matvec
from contactsense.robots.jit.declaration import Floats
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.robots.vectors import add, vector


class Frame(NamedTuple):
    """A frame in the base frame, such as that of a link or the body frame of a primitive."""

    rotation: np.ndarray
    """Rotation from this frame to the base frame, shape (3, 3)."""
    origin: np.ndarray
    """Its origin, base frame, shape (3,) [m]."""


class PrimitiveFrames(NamedTuple):
    """Body frames of P primitives in the base frame."""

    rotation: Annotated[Floats, "primitives, 3, 3"]
    """Rotation from the body frame of each primitive to the base frame."""
    origin: Annotated[Floats, "primitives, 3"]
    """Its origin, base frame [m]."""
    mean_rotation: Annotated[Floats, "3, 3"]
    """Scratch: rotation of one body frame as moved to the mean surface ..."""
    mean_origin: Annotated[Floats, "3"]
    """... and its origin [m], see `contactsense.localization.surface.mean_surface`."""


@fused_kernel
def place_primitives(surfaces: Surfaces, depth: np.ndarray, motion: Motion, frames: PrimitiveFrames) -> None:
    """Compute the body frames of all primitives in the base frame.

    Args:
        surfaces: Primitives.
        depth: Body of each link, see `contactsense.isolation.link_hypotheses.SensorModel`.
        motion: Poses of the bodies.
        frames: `rotation` and `origin` are filled.
    """
    for p in range(surfaces.kind.shape[0]):
        body = depth[surfaces.link[p]]
        R, s = motion.rotation[body], vector(surfaces.origin[p])
        # Read before anything is written: the compiler cannot know that these are other arrays.
        rows = (vector(R[0]), vector(R[1]), vector(R[2]))
        S, o, T = surfaces.rotation[p], frames.origin[p], frames.rotation[p]
        x = matvec(rows, (S[0, 0], S[1, 0], S[2, 0]))
        y = matvec(rows, (S[0, 1], S[1, 1], S[2, 1]))
        z = matvec(rows, (S[0, 2], S[1, 2], S[2, 2]))
        o[0], o[1], o[2] = add(vector(motion.origin[body]), matvec(rows, s))
        T[0, 0], T[0, 1], T[0, 2] = x[0], y[0], z[0]
        T[1, 0], T[1, 1], T[1, 2] = x[1], y[1], z[1]
        T[2, 0], T[2, 1], T[2, 2] = x[2], y[2], z[2]
