"""`detectability`: what the sensors of a scene can tell about a push on each place of the arm.

Smallest forces follow from the distribution of the residuals' energy. Errors and probabilities of links are
those of the localizer's answers to a few readings of each push, at fixed points of the noise's distribution.
"""

from numbers import Integral, Real
from typing import NamedTuple

import numpy as np

from contactsense.detection.detectable_force import DETECTION
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import Motion, empty_motion
from contactsense.plausibility.plausible_limits import PlausibleLimits
from contactsense.robots.attribute_docs import with_attributes
from contactsense.scene import Scene, check_scene
from contactsense.scene_model.reading_limits import LARGEST_FORCE
from contactsense.scene_model.skin_grids import skin_of
from contactsense.sensors.validation import checked_vector
from contactsense.static_localizer import StaticLocalizer
from contactsense.surface_map.noise_points import noisy_residuals
from contactsense.surface_map.place_gain import place_gain, push_jacobian
from contactsense.surface_map.places import Places, on_skin, touchable_places
from contactsense.surface_map.sensor_response import readings_of, sensor_response
from contactsense.surface_map.smallest_force import detected_size, smallest_force

MIN_NAMED = 0.2
"""Share of answers on the link below which the map gives no error: a dozen answers have no median."""


@with_attributes
class LinkDetectability(NamedTuple):
    """One link of a map. Quantiles are by area; infinite where the sensors do not determine them."""

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


@with_attributes
class Detectability(NamedTuple):
    """N places of the touchable surface in one posture. Base frame; infinite where the sensors do not
    determine them."""

    link_names: tuple[str, ...]
    """Names of all links."""
    link: np.ndarray
    """Index of each place's link, shape (N,), int64."""
    point_base: np.ndarray
    """Places, shape (N, 3) [m]; with `detail: skin` those of the skin."""
    normal_base: np.ndarray
    """Outward unit normals, shape (N, 3)."""
    share: np.ndarray
    """Share of each place in the touchable surface, shape (N,); their sum is 1."""
    smallest_force: np.ndarray
    """Smallest force along the inward normal that is detected, shape (N,) [N]."""
    error: np.ndarray
    """Radius around the place that holds half of the localizer's answers on this link, shape (N,) [m];
    infinite where no sensor measures the push, or fewer than `MIN_NAMED` of the answers are on the link."""
    error_95: np.ndarray
    """Radius that holds 95 % of them, shape (N,) [m]."""
    link_probability: np.ndarray
    """Probability that the localizer's answer is on the link, shape (N,)."""
    force: float
    """Force to which `error`, `error_95` and `link_probability` refer [N]."""
    friction: float
    """Coefficient of friction of these pushes; 0: along the inward normal."""
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
    every: int = 1,
) -> Detectability:
    """What the sensors of a scene can tell about a push on each place of the arm.

    For one measurement of an arm at rest, as `Localizer.locate` takes it; errors and link probability are
    those of its answers to simulated readings. An average over N measurements has
    1 / sqrt(N) of the noise, and of the forces. The model, the bias and the surface are assumed to be right,
    but for the errors of the joint torques that the scene states. The `range` of a sensor is not looked at:
    `contactsense scene show` warns where the weight of the arm or its motion reaches it.

    Args:
        scene: Arm, tool, sensors and their noise, false alarms per hour.
        q: Joint positions, shape (n,) [rad].
        force: Normal force for errors and link probability [N]; None: the scene's usual force.
        detection: Probability with which the smallest force is detected in one measurement.
        friction: Coefficient of friction of the pushes for errors and link probability: their inclinations
            are uniform in the friction cone, with the scene's torsion; 0: along the inward normal, without
            torsion.
        every: Compute only every n-th place: a coarser map in less time.

    Raises:
        ValueError: an argument is wrong; the message names the field.
        TypeError: `scene` is none.
    """
    check_scene(scene)
    force = scene.force if force is None else force
    if not (isinstance(force, Real) and 0.0 < force <= LARGEST_FORCE):
        raise ValueError(
            f"force: expected a positive number of newtons, at most {LARGEST_FORCE:g}, got {force!r}"
        )
    if not (isinstance(detection, Real) and 0.0 < detection < 1.0):
        raise ValueError(f"detection: expected a probability between 0 and 1, got {detection!r}")
    if not (isinstance(friction, Real) and np.isfinite(friction) and friction >= 0.0):
        raise ValueError(f"friction: expected a coefficient of at least 0, got {friction!r}")
    if not (isinstance(every, Integral) and every >= 1):
        raise ValueError(f"every: expected a whole number of at least 1, got {every!r}")
    joints = len(scene.robot.joints)
    q = checked_vector("q", q, joints, "rad")
    if (beyond := PlausibleLimits(scene).position(q)) is not None:
        raise ValueError(f"q: {beyond.reason}")
    localizer, motion = StaticLocalizer(scene, "joint", None), empty_motion(joints)
    constants = localizer.constants
    forward_kinematics(constants.model, q, motion)
    places = touchable_places(constants, motion)
    if not len(places.link):
        raise ValueError(
            "q: no place can be touched in this posture: other links or bodies of the scene cover the whole "
            "touchable surface"
        )
    places = Places(*(values[::every] for values in places))
    places = places._replace(point=on_skin(places, skin_of(scene), constants, motion))
    response = sensor_response(scene, constants, motion)[places.link]
    weakest = smallest_force(response, detected_size(scene, detection), places.point, places.normal)
    jacobians = (of(response, places, constants.prior, force) for of in (push_jacobian, place_gain))
    inclination = friction / places.friction_ratio
    residuals = np.stack(
        [noisy_residuals(*of_place) for of_place in zip(*jacobians, inclination, strict=True)]
    )
    link, point = _answers(localizer, motion, q, residuals)
    right = link == places.link[:, None]
    named = right.mean(axis=1)
    distance = np.linalg.norm(point - places.point[:, None], axis=2)
    radii = [
        np.quantile(of_place[on], (0.5, 0.95)) if share >= MIN_NAMED else (np.inf, np.inf)
        for of_place, on, share in zip(distance, right, named, strict=True)
    ]
    error, error_95 = np.where(np.isfinite(weakest), np.transpose(radii), np.inf)
    return Detectability(
        link_names=scene.link_names,
        link=places.link,
        point_base=places.point,
        normal_base=places.normal,
        share=places.share / places.share.sum(),
        smallest_force=weakest,
        error=error,
        error_95=error_95,
        link_probability=named,
        force=float(force),
        friction=float(friction),
        detection=float(detection),
        false_alarms_per_hour=scene.false_alarms_per_hour,
    )


def _answers(
    localizer: StaticLocalizer, motion: Motion, q: np.ndarray, residuals: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The localizer's answers to K readings of the push on each of N places.

    Args:
        localizer: Of the scene.
        motion, q: Posture.
        residuals: Of the readings, in units of their noise, shape (N, K, rows).

    Returns:
        Link of each answer, -1 if no push explains the reading, shape (N, K), int64; its place, shape (N, K,
        3) [m].
    """
    shape = residuals.shape[:2]
    rows = residuals.reshape(-1, residuals.shape[2])
    readings = readings_of(localizer.scene, localizer.constants, motion, rows)
    found = localizer.locate_batch(np.broadcast_to(q, (len(rows), len(q))), **readings, detect=False)
    return found.link.reshape(shape), found.point_base.reshape(*shape, 3)
