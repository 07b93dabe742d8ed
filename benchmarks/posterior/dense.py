"""The dense posterior as a reference method."""

import math
from typing import Literal, NamedTuple

import numpy as np

from contactsense import Scene
from contactsense.benchmarks.peers.method import Answers
from contactsense.benchmarks.posterior.evidence import Prior
from contactsense.benchmarks.posterior.patch_posterior import (
    LinkMeasurement,
    Probes,
    empty_measurement,
    evaluate_patches,
    mean_near,
    median_patch,
    most_probable_patch,
    normalize,
    wrench_in_link_frame,
)
from contactsense.benchmarks.posterior.samples import Samples
from contactsense.isolation.link_hypotheses import (
    Hypotheses,
    SensorRows,
    isolate,
)
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import Motion, empty_motion
from contactsense.robots.jit.flat_buffers import zeros
from contactsense.robots.jit.kernel import allocating_fused_kernel
from contactsense.scene_model.constants import Constants, build_constants

MIN_FORCE, MAX_FORCE = 1.0, 300.0
"""Range of the normal force [N]; its logarithm is uniform."""
Geometry = Literal["primitives", "meshes"]
Rule = Literal["middle", "mean"]
"""Point estimate on the most probable link: `mean`: the mean point of the peak with the most probability
within 20 mm; `middle`: the mean point near the patch with the lowest expected distance to the contact."""
_PROBES = 400
"""Number of patches that represent the posterior when distances to all of it are needed."""


def prior_of(scene: Scene, offset: float) -> Prior:
    """The estimator's prior of friction and torsion, with a uniform prior of the logarithm of the normal
    force."""
    return Prior(
        low=MIN_FORCE,
        high=MAX_FORCE,
        friction_ratio=scene.friction / 2.0,
        torsion_lever=scene.torsion,
        surface_deviation=offset,
    )


class Posterior(NamedTuple):
    """Posterior of one measurement."""

    density: np.ndarray
    """Log probability per area of each patch, up to a constant, shape (S,)."""
    weight: np.ndarray
    """Probability of each patch, shape (S,)."""
    force: np.ndarray
    """Normal force estimated at each patch, shape (S,) [N]."""
    link_probability: np.ndarray
    """Shape (links,)."""


class Measurement(NamedTuple):
    """One sample."""

    q: np.ndarray
    """Joint positions, shape (n,) [rad]."""
    wrench: np.ndarray
    """External wrench on the base sensor, shape (6,) [N, Nm]."""
    has_base: bool
    """Whether there is a base sensor."""
    torque: np.ndarray
    """External joint torques: a contact wrench w leaves s_j . w, shape (n,) [Nm]."""
    has_torque: bool
    """Whether there are joint torques."""


class Buffers(NamedTuple):
    """Scratch of the kernel."""

    motion: Motion
    hypotheses: Hypotheses
    rows: SensorRows
    local: LinkMeasurement
    probes: Probes


class Dense:
    """The dense posterior of one scene."""

    def __init__(
        self,
        scene: Scene,
        geometry: Geometry,
        samples: Samples,
        rule: Rule = "middle",
    ) -> None:
        """Take the surfaces.

        Args:
            scene: Arm, sensors, noise.
            geometry: Surface of the samples: the estimator's primitives or the meshes of the links.
            samples: Of the same arm and level of detail.
            rule: Point estimate.
        """
        self.name = f"dense posterior, {geometry}"
        self.scene = scene
        self.samples = samples
        # The meshes are exact.
        self.prior = prior_of(scene, scene.surface_deviation if geometry == "primitives" else 0.0)
        self._middle = rule == "middle"
        self._constants = build_constants(scene)
        joints, links = self._constants.model.joints, len(self._constants.touchable)
        self._buffers = Buffers(
            empty_motion(joints),
            zeros(Hypotheses, links=links),
            zeros(SensorRows, rows=joints),
            empty_measurement(),
            Probes(np.zeros(_PROBES, np.int64), np.zeros(_PROBES, np.int64), np.zeros((_PROBES, 3))),
        )
        count = len(samples.area)
        self._posterior = Posterior(np.zeros(count), np.zeros(count), np.zeros(count), np.zeros(links))

    def __call__(
        self, q: np.ndarray, base_wrench: np.ndarray | None, joint_torque: np.ndarray | None
    ) -> Answers:
        """See `contactsense.benchmarks.peers.method.Method`."""
        n, links = len(q), len(self._constants.touchable)
        link, point, link_probability = np.zeros(n, dtype=np.int64), np.zeros((n, 3)), np.zeros((n, links))
        for i in range(n):
            link[i] = self._estimate(
                q[i],
                None if base_wrench is None else base_wrench[i],
                None if joint_torque is None else joint_torque[i],
                point[i],
            )
            link_probability[i] = self._posterior.link_probability
        return Answers(link, point, link_probability)

    def _estimate(
        self, q: np.ndarray, wrench: np.ndarray | None, torque: np.ndarray | None, point: np.ndarray
    ) -> int:
        measured = Measurement(
            np.ascontiguousarray(q),
            np.zeros(6) if wrench is None else wrench,
            wrench is not None,
            np.zeros(len(q)) if torque is None else -torque,
            torque is not None,
        )
        link: int = _estimate_kernel(
            self._constants, self.samples, self.prior, measured, self._middle, self._buffers,
            self._posterior, point,
        )  # fmt: skip
        return link


@allocating_fused_kernel
def _estimate_kernel(
    constants: Constants,
    samples: Samples,
    prior: Prior,
    measured: Measurement,
    middle: bool,
    buffers: Buffers,
    posterior: Posterior,
    point: np.ndarray,
) -> int:
    """Evaluate one measurement: fills posterior and point; returns the index of the link, -1 for none."""
    motion, hypotheses, rows, local, probes = buffers
    q, wrench, has_base, torque, has_torque = measured
    density, weight, normal_force, link_probability = posterior
    forward_kinematics(constants.model, q, motion)
    count = torque.shape[0] if has_torque else 0
    for j in range(count):
        for k in range(6):
            rows.screw[j, k] = motion.screw[j, k]
        rows.value[j] = rows.proximal_value[j] = torque[j]
        rows.variance[j] = constants.sensors.torque_variance[j]
        rows.first_link[j] = j + 1
    sensors = constants.sensors
    isolate(sensors.base_covariance, sensors.base_information, wrench, has_base, rows, count, 1.0, hypotheses)
    evaluate_patches(
        samples, constants.touchable, q, motion, hypotheses, has_base, prior, local, density, normal_force
    )
    normalize(samples, density, weight, link_probability)
    link = 0
    for k in range(1, link_probability.shape[0]):
        if link_probability[k] > link_probability[link]:
            link = k
    first, last = samples.start[link], samples.start[link + 1]
    if middle:
        patch = median_patch(samples, weight, first, last, motion, probes)
    else:
        patch = most_probable_patch(samples, density, weight, first, last)
    if patch < 0:
        return -1
    R, o = motion.rotation[link], motion.origin[link]
    wrench_in_link_frame(hypotheses.wrench[link], hypotheses.information[link], R, o, local)
    place = np.empty(3)
    mean_near(samples, weight, normal_force, first, last, patch, has_base, prior, local, place)
    for i in range(3):
        point[i] = o[i] + R[i, 0] * place[0] + R[i, 1] * place[1] + R[i, 2] * place[2]
    return link if math.isfinite(point[0]) else -1
