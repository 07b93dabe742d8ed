"""`detectability`: what the sensors of a scene can tell about a push on each place of the arm."""

from typing import NamedTuple

import numpy as np

from contactsense.detection.detectable_force import DETECTION
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import empty_motion
from contactsense.runtime.constants import build_constants
from contactsense.scene import Scene
from contactsense.sensors.validation import checked_vector
from contactsense.surface_map.link_naming import link_probabilities
from contactsense.surface_map.place_error import place_covariance, radius_of_share
from contactsense.surface_map.places import touchable_places
from contactsense.surface_map.sensor_response import sensor_response, wrench
from contactsense.surface_map.smallest_force import detected_size, smallest_force


class LinkDetectability(NamedTuple):
    """One link of a map. Quantiles are by area; infinite where sensors cannot tell."""

    link: str
    """Name of the link."""
    share: float
    """Its share of the touchable surface in this posture."""
    smallest_force: tuple[float, float]
    """Smallest detected force: median, and below which 95 % of the surface lies [N]."""
    error: tuple[float, float]
    """Median error: median over the surface, and below which 95 % of the surface lies [m]."""
    link_probability: tuple[float, float]
    """Probability of naming the link: median, and above which 95 % of the surface lies."""


class Detectability(NamedTuple):
    """N places of the touchable surface in one posture. Base frame; infinite where sensors cannot tell."""

    link_names: tuple[str, ...]
    """Names of all links."""
    link: np.ndarray
    """Index of each place's link, shape (N,), int64."""
    point_base: np.ndarray
    """Places, shape (N, 3) [m]."""
    normal_base: np.ndarray
    """Outward unit normals, shape (N, 3)."""
    share: np.ndarray
    """Share of each place in the touchable surface, shape (N,); their sum is 1."""
    smallest_force: np.ndarray
    """Smallest force along the inward normal that is detected, shape (N,) [N]."""
    error: np.ndarray
    """Radius around the place that holds half of the localizer's answers on this link, shape (N,) [m];
    infinite where the sensors do not determine the wrench, or the radius exceeds the link."""
    error_95: np.ndarray
    """Radius that holds 95 % of them, shape (N,) [m]."""
    link_probability: np.ndarray
    """Probability of naming the link, shape (N,)."""
    force: float
    """Force to which `error`, `error_95` and `link_probability` refer [N]."""
    friction: float
    """Coefficient of friction of the pushes to which the errors refer; 0: along the inward normal."""
    detection: float
    """Probability with which `smallest_force` is detected in one measurement."""
    false_alarms_per_hour: float
    """False-alarm rate of the threshold [1/h]."""

    def by_link(self) -> tuple[LinkDetectability, ...]:
        """Summary of each link that can be touched in this posture, base first."""
        return tuple(
            LinkDetectability(
                link=name,
                share=float(self.share[on].sum()),
                smallest_force=self._quantiles(self.smallest_force, on, 0.95),
                error=self._quantiles(self.error, on, 0.95),
                link_probability=self._quantiles(self.link_probability, on, 0.05),
            )
            for index, name in enumerate(self.link_names)
            if (on := self.link == index).any()
        )

    def _quantiles(self, values: np.ndarray, on: np.ndarray, worst: float) -> tuple[float, float]:
        """Median by area, and the quantile `worst`."""
        order = np.argsort(values[on])
        below = np.cumsum(self.share[on][order])
        at = np.searchsorted(below, np.array([0.5, worst]) * below[-1])
        middle, extreme = values[on][order][np.minimum(at, len(order) - 1)]
        return float(middle), float(extreme)


def detectability(
    scene: Scene,
    q: np.ndarray,
    *,
    force: float | None = None,
    detection: float = DETECTION,
    friction: float = 0.0,
) -> Detectability:
    """What the sensors of a scene can tell about a push on each place of the arm, from covariances.

    For one measurement of an arm at rest, as `Localizer.locate` takes it. An average over N measurements has
    1 / sqrt(N) of the noise, and of the forces. The model, the bias and the surface are assumed to be right,
    but for the errors that the scene states.

    Args:
        scene: Arm, tool, sensors and their noise, false alarms per hour.
        q: Joint positions, shape (n,) [rad].
        force: Normal force for errors and link probability [N]; None: the scene's usual force.
        detection: Probability with which the smallest force is detected in one measurement.
        friction: Coefficient of friction of the pushes for the errors: their inclinations are uniform in the
            friction cone, with the scene's torsion; 0: along the inward normal, without torsion.

    Raises:
        ValueError: an argument is wrong; the message names the field.
    """
    force = scene.force if force is None else force
    if not (np.isfinite(force) and force > 0.0):
        raise ValueError(f"force: expected a positive number of newtons, got {force!r}")
    if not 0.0 < detection < 1.0:
        raise ValueError(f"detection: expected a probability between 0 and 1, got {detection!r}")
    if not (np.isfinite(friction) and friction >= 0.0):
        raise ValueError(f"friction: expected a coefficient of at least 0, got {friction!r}")
    joints = len(scene.robot.joints)
    q = checked_vector("q", q, joints, "rad")
    constants, motion = build_constants(scene), empty_motion(joints)
    forward_kinematics(constants.model, q, motion)
    places = touchable_places(constants, motion, constants.samples)
    cells = touchable_places(constants, motion, constants.subsamples)
    response = sensor_response(scene, constants, motion)
    at_place = response[places.link]
    found, stated = place_covariance(at_place, places, constants.prior, force, friction)
    extent = _extents(cells.link, cells.point, len(response))[places.link]
    # Fewer than six independent readings leave the wrench open: the answers then lie on several distant
    # places, which no covariance describes.
    determined = np.linalg.matrix_rank(response) == 6
    unknown = ~determined[places.link] | (radius_of_share(stated, 0.5) > extent)
    mean = np.einsum("nij,nj->ni", at_place, wrench(-force * places.normal, places.point))
    probability = link_probabilities(mean, response[cells.link], cells, constants.prior, force, len(response))
    return Detectability(
        link_names=scene.link_names,
        link=places.link,
        point_base=places.point,
        normal_base=places.normal,
        share=places.share,
        smallest_force=smallest_force(at_place, detected_size(scene, detection), places.point, places.normal),
        error=np.where(unknown, np.inf, radius_of_share(found, 0.5)),
        error_95=np.where(unknown, np.inf, radius_of_share(found, 0.95)),
        link_probability=probability[np.arange(len(places.link)), places.link],
        force=float(force),
        friction=float(friction),
        detection=float(detection),
        false_alarms_per_hour=scene.false_alarms_per_hour,
    )


def _extents(link: np.ndarray, point: np.ndarray, links: int) -> np.ndarray:
    """Largest distance of each link's places from their centre, shape (links,) [m].

    An error above it tells nothing about the place on the link.
    """
    extents = np.zeros(links)
    for index in range(links):
        on = point[link == index]
        if len(on):
            extents[index] = np.linalg.norm(on - on.mean(axis=0), axis=1).max()
    return extents
