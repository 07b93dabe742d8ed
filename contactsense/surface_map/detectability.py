"""`detectability`: what the sensors of a scene can tell about a push on each place of the arm."""

from typing import NamedTuple

import numpy as np

from contactsense.detection.detectable_force import DETECTION
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import Motion, empty_motion
from contactsense.plausibility.plausible_limits import PlausibleLimits
from contactsense.robots.attribute_docs import with_attributes
from contactsense.scene import Scene, check_scene
from contactsense.scene_model.constants import Constants, build_constants
from contactsense.scene_model.reading_limits import LARGEST_FORCE
from contactsense.sensors.validation import checked_vector
from contactsense.surface_map.cell_evidence import CellEvidence, cell_evidence
from contactsense.surface_map.expected_answers import expected_answers
from contactsense.surface_map.noise_points import readings
from contactsense.surface_map.place_error import (
    line_of_action_known,
    place_covariance,
    place_gain,
    push_jacobian,
    radius_of_share,
)
from contactsense.surface_map.places import Places, on_surface, touchable_places
from contactsense.surface_map.sensor_response import sensor_response
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
    """Places, shape (N, 3) [m]."""
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
    """What the sensors of a scene can tell about a push on each place of the arm, from covariances.

    For one measurement of an arm at rest, as `Localizer.locate` takes it. An average over N measurements has
    1 / sqrt(N) of the noise, and of the forces. The model, the bias and the surface are assumed to be right,
    but for the errors that the scene states.

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
    if not 0.0 < force <= LARGEST_FORCE:
        raise ValueError(
            f"force: expected a positive number of newtons, at most {LARGEST_FORCE:g}, got {force!r}"
        )
    if not 0.0 < detection < 1.0:
        raise ValueError(f"detection: expected a probability between 0 and 1, got {detection!r}")
    if not (np.isfinite(friction) and friction >= 0.0):
        raise ValueError(f"friction: expected a coefficient of at least 0, got {friction!r}")
    if every < 1:
        raise ValueError(f"every: expected at least 1, got {every!r}")
    joints = len(scene.robot.joints)
    q = checked_vector("q", q, joints, "rad")
    if (beyond := PlausibleLimits(scene).position(q)) is not None:
        raise ValueError(f"q: {beyond.reason}")
    constants, motion = build_constants(scene), empty_motion(joints)
    forward_kinematics(constants.model, q, motion)
    response = sensor_response(scene, constants, motion)
    surface = [
        touchable_places(constants, motion, samples) for samples in (constants.samples, constants.subsamples)
    ]
    if not all(len(cells.link) for cells in surface):
        raise ValueError(
            "q: no place can be touched in this posture: other links or bodies of the scene cover the whole "
            "touchable surface"
        )
    coarse, fine = (cell_evidence(response[cells.link], cells, constants.prior, force) for cells in surface)
    places = Places(*(values[::every] for values in coarse.cells))
    at_place = response[places.link]
    weakest = smallest_force(at_place, detected_size(scene, detection), places.point, places.normal)
    named, error, error_95 = _expected(constants, motion, coarse, fine, places, at_place, force, friction)
    # Where the line of action is known the answer is one mode, whose covariance is exact for small noise.
    known = line_of_action_known(response, motion.origin[constants.sensors.depth], force)[places.link]
    covariance = place_covariance(at_place, places, constants.prior, force, friction)[0]
    error = np.where(known, radius_of_share(covariance, 0.5), error)
    error_95 = np.where(known, radius_of_share(covariance, 0.95), error_95)
    unknown = np.isinf(weakest) | (named < MIN_NAMED)
    return Detectability(
        link_names=scene.link_names,
        link=places.link,
        point_base=places.point,
        normal_base=places.normal,
        share=places.share / places.share.sum(),
        smallest_force=weakest,
        error=np.where(unknown, np.inf, error),
        error_95=np.where(unknown, np.inf, error_95),
        link_probability=named,
        force=float(force),
        friction=float(friction),
        detection=float(detection),
        false_alarms_per_hour=scene.false_alarms_per_hour,
    )


def _expected(
    constants: Constants,
    motion: Motion,
    coarse: CellEvidence,
    fine: CellEvidence,
    places: Places,
    response: np.ndarray,
    force: float,
    friction: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Share of the answers that name the link, and the radii that hold half and 95 % of these, shapes (N,);
    the radii are NaN without such answers.

    Args:
        constants, motion: Of the scene.
        coarse, fine: Cells and subcells of the surface.
        places: N places.
        response: `sensor_response` of each place's link, shape (N, rows, 6).
        force, friction: As for `detectability`.
    """
    pushes = push_jacobian(response, places, constants.prior, force)
    gains = place_gain(response, places, constants.prior, force)
    inclinations = friction / places.friction_ratio
    answers = [
        expected_answers(coarse, fine, push[:, 0], readings(push, gain, float(inclination)))
        for push, gain, inclination in zip(pushes, gains, inclinations, strict=True)
    ]
    link = np.stack([answer.link for answer in answers])
    point = on_surface(constants, motion, link, np.stack([answer.point for answer in answers]))
    right = link == places.link[:, None]
    distance = np.linalg.norm(point - places.point[:, None], axis=2)
    radii = [
        np.quantile(d[r], (0.5, 0.95)) if r.any() else (np.nan, np.nan)
        for d, r in zip(distance, right, strict=True)
    ]
    half, most = np.array(radii).T
    return right.mean(axis=1), half, most
