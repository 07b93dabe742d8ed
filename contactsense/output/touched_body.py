"""Which body of the cell a contact is with: the pedestal that is touched, or the obstacle that the arm runs
into."""

import math

import numpy as np

from contactsense.kinematics.model import Motion
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.robots.surface.union import distances
from contactsense.robots.surroundings import Body, pack_bodies
from contactsense.scene import Scene
from contactsense.scene_model.constants import Constants

REACH_SIGMAS = 2.0
"""An obstacle is within reach of a contact up to this many standard deviations of its point."""
STEPS = 40
"""Largest number of projections from the obstacle to the link and back."""
STANDSTILL = 1e-6
"""The search ends where a step gets no nearer than this [m]."""


class TouchedBody:
    """Names the bodies of one scene.

    The sensors cannot distinguish an obstacle from anything else that pushes at the same place in the same
    direction: the name says that the obstacle explains the contact.
    """

    def __init__(self, scene: Scene, constants: Constants, motion: Motion) -> None:
        """Prepare the surfaces.

        Args:
            scene: The scene.
            constants: Its surfaces, in link frames.
            motion: Poses of the links in the sample that is being explained; read with every contact.
        """
        self._motion, self._surfaces, self._depth = motion, constants.surfaces, constants.sensors.depth
        link = constants.surfaces.link[constants.samples.primitive]
        self._places = [constants.samples.point[link == index] for index in range(len(self._depth))]
        self._obstacles: list[tuple[Body, Surfaces]] = [
            (body, pack_bodies([body])) for body in scene.bodies if body.role == "obstacle"
        ]
        pedestals = [body for body in scene.bodies if body.role == "pedestal"]
        base = [body.name for body in pedestals for _ in body.primitives]
        self._of_base = [""] * (int(constants.surfaces.start[1]) - len(base)) + base

    def name(
        self, link: int, primitive: int, point: np.ndarray, force: np.ndarray, covariance: np.ndarray
    ) -> str:
        """Name of the body that a contact is with, empty if it is with none.

        Args:
            link: Index of the touched link.
            primitive: Index of the touched primitive among the link's own.
            point: Contact point, base frame, shape (3,) [m].
            force: Force on the robot, base axes, shape (3,) [N].
            covariance: Covariance of the point, shape (3, 3) [m^2]; not finite if the place is unknown.
        """
        if link == 0:
            return self._of_base[primitive]
        if not np.isfinite(covariance).all():  # an unknown place is within reach of nothing
            return ""
        for body, surfaces in self._obstacles:
            if self._touches(body, surfaces, link, point, force, covariance):
                return body.name
        return ""

    def _touches(
        self,
        body: Body,
        surfaces: Surfaces,
        link: int,
        point: np.ndarray,
        force: np.ndarray,
        covariance: np.ndarray,
    ) -> bool:
        """Whether a body can be what pushes: somewhere within reach of the point the link is as near to it as
        the errors of their places allow, and the force points away from it."""
        widest = math.sqrt(max(float(np.trace(covariance)), 0.0))
        if _project(surfaces, point)[1] > 2.0 * body.tolerance + REACH_SIGMAS * widest:
            return False
        R, origin = self._motion.rotation[self._depth[link]], self._motion.origin[self._depth[link]]
        places = np.concatenate((point[None], self._places[link] @ R.T + origin))
        places = places[_within_reach(places - point, covariance, body.tolerance)]
        place = places[np.argmin(distances(surfaces, places)[0])]
        here, gap, outward = _project(surfaces, place)
        # Alternating projections on two convex bodies converge to their nearest points (Cheney and Goldstein,
        # Proc. AMS 1959).
        for _ in range(STEPS):
            if gap <= body.tolerance:
                break
            on_link, distance, _ = _project(self._surfaces, (here - origin) @ R, link)
            place = here if distance < 0.0 else R @ on_link + origin
            previous = gap
            here, gap, outward = _project(surfaces, place)
            if gap > previous - STANDSTILL:
                break
        return (
            gap <= body.tolerance
            and bool(_within_reach((place - point)[None], covariance, body.tolerance)[0])
            and float(force @ outward) > 0.0
        )


def _within_reach(steps: np.ndarray, covariance: np.ndarray, tolerance: float) -> np.ndarray:
    """Whether steps from a point, shape (N, 3) [m], end within `REACH_SIGMAS` of it and `tolerance` [m]."""
    length = np.linalg.norm(steps, axis=1)
    deviation = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", steps, covariance, steps), 0.0))
    # The standard deviation along the step is `deviation` / `length`.
    return np.asarray(length * length <= tolerance * length + REACH_SIGMAS * deviation)


def _project(surfaces: Surfaces, point: np.ndarray, link: int = 0) -> tuple[np.ndarray, float, np.ndarray]:
    """Nearest point of a link's surface, signed distance [m] and outward normal there, link frame."""
    distance, _, normal = distances(surfaces, point[None], link)
    return point - distance[0] * normal[0], float(distance[0]), normal[0]
