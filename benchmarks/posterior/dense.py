"""The dense posterior as a method that answers measurements."""

import math
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from benchmarks.method import Answers
from benchmarks.posterior.evidence import Prior
from benchmarks.posterior.samples import SPACING, Samples, of_meshes, of_primitives
from benchmarks.posterior.weigh import (
    densest,
    displaced,
    gathered,
    mean_about,
    middle,
    most_gathered,
    normalise,
    turn,
    weigh,
)
from contactsense import Scene
from contactsense.arm import Arm, build_arm
from contactsense.isolation import Hypotheses, empty_hypotheses, isolate
from kinematics.core import place
from kinematics.model import Motion, empty_motion
from robots.compiled import allocating_fused_kernel

LEAST_FORCE, GREATEST_FORCE = 1.0, 300.0
"""Range of the normal force [N], its logarithm uniform."""
Geometry = Literal["primitives", "meshes"]
Rule = Literal["map", "link", "gathered", "mean", "middle"]
"""What is answered: `map`: the densest patch of all; `link`: the densest patch of the most probable link;
`gathered`: on that link, the place with the most probability within 20 mm; `mean`: the mean place of that
probability; `middle`: the mean place of the probability about the patch of that link whose expected distance
from the contact is least."""
_RULES = ("map", "link", "gathered", "mean", "middle")
_PROBES = 400
"""Patches that stand for a posterior where distances to all of it are asked for."""


def prior_of(scene: Scene, offset: float) -> Prior:
    """The estimator's prior: friction, torsion and any normal force."""
    return Prior(
        low=LEAST_FORCE,
        high=GREATEST_FORCE,
        lean=np.array([scene.friction / 2.0]),
        log_share=np.zeros(1),
        lever=scene.torsion,
        offset=offset,
    )


class Posterior(NamedTuple):
    """The whole posterior of one measurement."""

    density: np.ndarray
    """Logarithm of the probability per area, up to a constant, of each patch, shape (S,)."""
    weight: np.ndarray
    """Probability of each patch, shape (S,)."""
    force: np.ndarray
    """Each patch's estimate of the normal force, shape (S,) [N]."""
    link_probability: np.ndarray
    """Shape (links,)."""


class Dense:
    """The dense posterior of one scene."""

    def __init__(
        self,
        scene: Scene,
        geometry: Geometry = "meshes",
        meshes: Path | None = None,
        rule: Rule = "middle",
        prior: Prior | None = None,
        samples: Samples | None = None,
        spacing: float = SPACING,
    ) -> None:
        """Sample the surfaces.

        Args:
            scene: Arm, sensors, noise.
            geometry: Whose surface: the estimator's primitives or the links' meshes.
            meshes: For meshes: folder with LINK.ply.
            rule: What is answered.
            prior: By default `prior_of`, with the scene's surface error for primitives and none for meshes.
            samples: Made before, for the same arm, level of detail and geometry.
            spacing: Edge of a patch [m].
        """
        if samples is None:
            if geometry == "meshes" and meshes is None:
                raise ValueError("meshes: expected a folder of meshes, got none")
            samples = (
                of_meshes(scene, meshes, spacing)
                if geometry == "meshes" and meshes is not None
                else of_primitives(scene, spacing)
            )
        self.name = f"dense posterior, {geometry}"
        self.scene = scene
        self.samples = samples
        self.prior = prior or prior_of(scene, scene.surface_deviation if geometry == "primitives" else 0.0)
        self._rule = _RULES.index(rule)
        self._arm = build_arm(scene)
        joints, links = self._arm.model.joints, len(self._arm.touchable)
        self._state = (empty_motion(joints), empty_hypotheses(links))
        self._scratch = (np.zeros(6), np.zeros((6, 6)), np.zeros((8, 8)), np.zeros((6, 6)), np.zeros(6))
        self._turn = np.zeros((6, 6))
        self._probes = (np.zeros(_PROBES, np.int64), np.zeros(_PROBES, np.int64), np.zeros((_PROBES, 3)))
        count = len(samples.area)
        self._field = (np.zeros(count), np.zeros(count), np.zeros(count))

    def __call__(
        self, q: np.ndarray, base_wrench: np.ndarray | None, joint_torque: np.ndarray | None
    ) -> Answers:
        """See `benchmarks.method.Method`; the probability is that of the places within 20 mm."""
        n, links = len(q), len(self._arm.touchable)
        link = np.zeros(n, dtype=np.int64)
        point, force = np.zeros((n, 3)), np.zeros((n, 3))
        probability, link_probability = np.zeros(n), np.zeros((n, links))
        for i in range(n):
            link[i], probability[i] = self._one(
                q[i],
                None if base_wrench is None else base_wrench[i],
                None if joint_torque is None else joint_torque[i],
                self._rule,
                point[i],
                force[i],
                link_probability[i],
            )
        return Answers(link, point, force, probability, link_probability)

    def posterior(
        self, q: np.ndarray, base_wrench: np.ndarray | None, joint_torque: np.ndarray | None
    ) -> Posterior:
        """The whole posterior of one measurement: arguments as of `__call__`, without the leading axis."""
        link_probability = np.zeros(len(self._arm.touchable))
        self._one(q, base_wrench, joint_torque, 0, np.zeros(3), np.zeros(3), link_probability)
        density, weight, force = (array.copy() for array in self._field)
        return Posterior(density, weight, force, link_probability)

    def level(self, found: Posterior, link: int, q: np.ndarray, point_base: np.ndarray) -> float:
        """Probability of all patches more probable, per area, than a place on a link: than the densest of the
        five patches nearest to it, as at an edge the nearest one may face another way."""
        motion = self._state[0]
        place(self._arm.model, q, motion)
        local = (point_base - motion.origin[link]) @ motion.rotation[link]
        own = slice(self.samples.start[link], self.samples.start[link + 1])
        near = np.argsort(((self.samples.point[own] - local) ** 2).sum(axis=1))[:5]
        return float(found.weight[found.density > found.density[own][near].max()].sum())

    def _one(
        self,
        q: np.ndarray,
        wrench: np.ndarray | None,
        torque: np.ndarray | None,
        rule: int,
        point: np.ndarray,
        force: np.ndarray,
        link_probability: np.ndarray,
    ) -> tuple[int, float]:
        blank = np.zeros(6)
        answer: tuple[int, float] = _answer(
            self._arm,
            self.samples,
            self.prior,
            *self._state,
            np.ascontiguousarray(q),
            blank if wrench is None else wrench,
            wrench is not None,
            np.zeros(len(q)) if torque is None else -torque,
            torque is not None,
            rule,
            *self._scratch,
            self._turn,
            *self._probes,
            *self._field,
            point,
            force,
            link_probability,
        )
        return answer


@allocating_fused_kernel
def _answer(
    arm: Arm,
    samples: Samples,
    prior: Prior,
    motion: Motion,
    hypotheses: Hypotheses,
    q: np.ndarray,
    wrench: np.ndarray,
    has_base: bool,
    torque: np.ndarray,
    has_torque: bool,
    rule: int,
    local_w: np.ndarray,
    local_L: np.ndarray,
    M: np.ndarray,
    H: np.ndarray,
    g: np.ndarray,
    T: np.ndarray,
    probe: np.ndarray,
    owner: np.ndarray,
    probe_place: np.ndarray,
    density: np.ndarray,
    weight: np.ndarray,
    normal_force: np.ndarray,
    point: np.ndarray,
    force: np.ndarray,
    link_probability: np.ndarray,
) -> tuple[int, float]:
    """One measurement: fill place, force and link probabilities; returns the link, -1 for none, and how
    probable its place is."""
    place(arm.model, q, motion)
    no_wrist = np.zeros(6)
    isolate(
        arm.sensors, motion.screw, wrench, has_base, torque, torque, arm.sensors.torque_variance, has_torque,
        no_wrist, no_wrist, False, no_wrist[:3], 1.0, hypotheses,
    )  # fmt: skip
    weigh(
        samples, arm.touchable, q, motion, hypotheses, has_base, prior, local_w, local_L, T, M, density,
        normal_force,
    )  # fmt: skip
    normalise(samples, density, weight, link_probability)
    link = 0
    for k in range(1, link_probability.shape[0]):
        if link_probability[k] > link_probability[link]:
            link = k
    first, last = samples.start[link], samples.start[link + 1]
    if rule == 0:
        first, last = 0, density.shape[0]
    if rule == 4:
        at = middle(samples, weight, first, last, motion, probe, owner, probe_place)
    elif rule >= 2:
        at = most_gathered(samples, density, weight, first, last)
    else:
        at = densest(density, first, last)
    if at < 0:
        return -1, 0.0
    if rule == 0:
        link = 0
        while samples.start[link + 1] <= at:
            link += 1
        first, last = samples.start[link], samples.start[link + 1]
    R, o = motion.rotation[link], motion.origin[link]
    turn(hypotheses.wrench[link], hypotheses.information[link], R, o, T, local_w, local_L)
    local = np.empty(3)
    if rule >= 3:
        mean_about(
            samples, weight, normal_force, first, last, at, has_base, prior, local_w, local_L, M, H, g, local
        )
    else:
        displaced(samples, at, normal_force[at], has_base, prior, local_w, local_L, M, H, g, local)
    n = samples.normal[at]
    for i in range(3):
        point[i] = o[i] + R[i, 0] * local[0] + R[i, 1] * local[1] + R[i, 2] * local[2]
        push = R[i, 0] * n[0] + R[i, 1] * n[1] + R[i, 2] * n[2]
        force[i] = hypotheses.wrench[link, i] if has_base else -normal_force[at] * push
    if not math.isfinite(point[0]):
        return -1, 0.0
    return link, gathered(samples, weight, first, last, at)
