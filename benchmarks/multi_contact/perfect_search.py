"""Upper bound of what a better search could find: the search for several contacts, also started at the
truth."""

import math
from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from contactsense import Contact, Estimate, Scene
from contactsense.localization.surface.placed_surface import PlacedSurface
from contactsense.multi_contact.explanations.set_evidence import (
    add_accessibility,
    fill_set_evidence,
    known_evidence,
)
from contactsense.multi_contact.joint.contact_step import set_contact, vector_of
from contactsense.multi_contact.joint.initial_contacts import initialize_known_contact
from contactsense.multi_contact.joint.joint_problem import JointProblem
from contactsense.multi_contact.joint.known_rows import Known
from contactsense.multi_contact.known_contacts.known_prior import fill_known_prior
from contactsense.multi_contact.locator import MultiContactLocator
from contactsense.multi_contact.memory.buffers import Measurement, MultiContactBuffers
from contactsense.multi_contact.memory.joint_layout import FX, LOG_EVIDENCE, NX, PX
from contactsense.output.estimate_builder import EstimateBuilder
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.surface.convex_primitives import project
from contactsense.runtime.buffers import Buffers, KernelBuffers, buffer_views
from contactsense.runtime.kernels import AT_REST, EXTERNAL, process
from contactsense.runtime.state import empty_state
from contactsense.scene_model.constants import build_constants
from contactsense.scene_model.skin_grids import skin_argument
from contactsense.solvers.posterior.contact_prior import pushing_force

MAX_RESTARTS = 10
"""Maximum number of restarts of the optimization from where it stopped, so that its step limit does not
matter."""
SURFACE_TOLERANCE = 0.003
"""Points this near to a primitive's surface may be on it; all such primitives are tried [m]."""
MIN_GAIN = 0.01
"""Minimum gain in log evidence for another restart."""


class TruthResult(NamedTuple):
    """Result of the optimization that starts at the truth."""

    gain: float
    """Log evidence above that of the best optimum among the explanations found without knowing the truth."""
    point_base: np.ndarray
    """Points, in the order of the true ones, shape (K, 3) [m]."""


class Oracle:
    """Explains a static sample by several contacts, as `Localizer.locate` does, and from the truth."""

    def __init__(self, scene: Scene) -> None:
        """For a scene with base sensor and joint torques."""
        constants = build_constants(scene)
        self._kernel_buffers = KernelBuffers(constants, empty_state(constants))
        self._arguments = (self._kernel_buffers.arguments, skin_argument(scene))
        self._estimate_builder = EstimateBuilder(scene, constants, self._kernel_buffers.state)
        self._sets = MultiContactLocator(scene, self._kernel_buffers, self._arguments, self._estimate_builder)
        self._best_evidence, self._drift = -np.inf, math.inf

    def locate(
        self,
        q: np.ndarray,
        base_wrench: np.ndarray,
        joint_torque: np.ndarray,
        contacts: int,
        known: Sequence[Contact],
        drift: float | None,
    ) -> Estimate:
        """The estimate of `Localizer.locate`; arguments as there."""
        self._drift = math.inf if drift is None else drift
        present = (True, True, 0)
        readings = (q, q, joint_torque, base_wrench, np.zeros((0, 6)))
        process(*self._arguments, AT_REST | EXTERNAL, -1.0, 3, readings)
        if contacts > 1:
            estimate = self._sets.explain(present, contacts, known, drift)
            found = self._sets.explanations
            ranked = found.order[: len(estimate.explanations)]
            self._best_evidence = float(found.log_evidence[ranked].max(initial=-np.inf))
            return estimate
        return self._estimate_builder.contacts(0.0, self._kernel_buffers.state.answer.integers.tolist())

    def from_truth(
        self, links: np.ndarray, points: np.ndarray, forces: np.ndarray, known_count: int
    ) -> TruthResult:
        """Optimize from the true contacts, after `locate` of the same sample.

        Args:
            links: Indices of the touched links, shape (K,); known contacts first, in their order.
            points, forces: Base frame, shapes (K, 3) [m, N].
            known_count: Number of known contacts. They start at their known points.
        """
        constants, buffers = self._kernel_buffers.constants, self._sets.buffers
        m, best = 6 + constants.model.joints, TruthResult(-np.inf, points)
        reference = self._best_evidence
        choices = [self._primitives(link, point) for link, point in zip(links, points, strict=True)]
        for primitives in product(*choices):
            score = _optimize_from(
                *self._arguments[:1],
                buffers,
                m,
                known_count,
                self._drift,
                np.array(primitives),
                points,
                forces,
            )
            if score - reference > best.gain:
                reached = [vector_of(block, PX, 0) for block in buffers.joint.contact[: len(links)]]
                best = TruthResult(score - reference, np.array(reached))
        return best

    def _primitives(self, link: int, point: np.ndarray) -> list[int]:
        """Primitives of a link on whose surface a point may lie."""
        surfaces, motion = self._kernel_buffers.constants.surfaces, self._kernel_buffers.state.motion
        body = self._kernel_buffers.constants.sensors.depth[link]
        local = (point - motion.origin[body]) @ motion.rotation[body]
        indices = range(surfaces.start[link], surfaces.start[link + 1])
        distances = [
            abs(project(surfaces.kind[p], surfaces.size[p], *local_point)[0])
            for p in indices
            for local_point in [surfaces.rotation[p].T @ (local - surfaces.origin[p])]
        ]
        return [
            p
            for p, distance in zip(indices, distances, strict=True)
            if distance < max(SURFACE_TOLERANCE, min(distances) + 1e-9)
        ]


@kernel
def _optimize_from(
    kernel_buffers: Buffers,
    buffers: MultiContactBuffers,
    m: int,
    known_count: int,
    drift: float,
    primitive: np.ndarray,
    point: np.ndarray,
    force: np.ndarray,
) -> float:
    """Log evidence of the contacts at which the optimization ends; they remain in lane 0 of
    `buffers.joint`."""
    constants, state = buffer_views(kernel_buffers)
    surfaces, prior, joint = constants.surfaces, constants.prior, buffers.joint
    surface = PlacedSurface(surfaces, constants.deviations, state.frames)
    count = primitive.shape[0]
    known = Known(known_count, drift, measured=True)
    measurement = Measurement(buffers.rows, m)
    known_rows = fill_known_prior(
        surface, prior, measurement, buffers.known, known, joint, buffers.known_prior
    )
    problem = JointProblem(surfaces, prior, measurement, known_rows, count)
    prior_log_evidence = known_evidence(problem, joint)
    for i in range(count):
        c, f = point[i], force[i]
        if i < known_count:
            initialize_known_contact(surface, prior, buffers.known, joint, known, 1.0, 0, i)
        else:
            set_contact(surface, prior, joint, 0, i, primitive[i], (c[0], c[1], c[2]), (0.0, 0.0, 0.0))
        push = pushing_force((f[0], f[1], f[2]), vector_of(joint.contact[i], NX, 0))
        for k in range(3):
            joint.contact[i, FX + k * LANES] = push[k]
    best: float = -math.inf
    for _ in range(MAX_RESTARTS):
        fill_set_evidence(problem, 1, math.inf, joint)
        add_accessibility(surface, prior, known_count, count, 1, joint)
        score = joint.lane[LOG_EVIDENCE, 0]
        if score <= best + MIN_GAIN:
            break
        best = score
    gain: float = best - prior_log_evidence
    return gain
