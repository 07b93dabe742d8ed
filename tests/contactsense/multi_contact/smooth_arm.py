"""Random contacts on a smooth arm, measured and placed for the joint optimization."""

from typing import NamedTuple

import numpy as np

from contactsense import Localizer, Scene
from contactsense.benchmarks.multi_contact.trials import Trial, Trials
from contactsense.localization.surface.placed_surface import PlacedSurface
from contactsense.localization.surface.primitive_frames import place_primitives
from contactsense.multi_contact.joint.contact_step import set_contact, vector_of
from contactsense.multi_contact.joint.joint_problem import JointProblem
from contactsense.multi_contact.joint.known_rows import KnownRows
from contactsense.multi_contact.measurement_rows import Variances, fill_measurement_rows
from contactsense.multi_contact.memory.buffers import (
    Measurement,
    MultiContactBuffers,
    empty_multi_contact_buffers,
)
from contactsense.multi_contact.memory.joint_layout import FX, PX
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.primitives import Capsule, Ellipsoid, Primitive, Sphere
from contactsense.robots.surface.convex_primitives import project
from contactsense.runtime.state import State
from contactsense.scene_model.constants import Constants
from tests.contactsense.multi_contact.joint_steps import JointSteps
from tests.plain_arm import ur5e_of

SHAPES: tuple[Primitive, ...] = (
    Sphere(center=(0, 0, 0.05), radius=0.09),
    Sphere(center=(0, 0, 0), radius=0.08),
    Capsule(a=(0.05, 0, 0.138), b=(-0.45, 0, 0.138), radius=0.06),
    Capsule(a=(0.05, 0, 0.007), b=(-0.4, 0, 0.007), radius=0.05),
    Capsule(a=(0, -0.02, 0), b=(0, 0.05, 0), radius=0.045),
    Capsule(a=(0, -0.05, 0), b=(0, 0.02, 0), radius=0.045),
    Ellipsoid(center=(0, 0, -0.02), radii=(0.04, 0.045, 0.05)),
)
"""One smooth body per link: at edges the curvature is discontinuous and solvers differ."""


NOTHING_KNOWN = KnownRows(0, 0)
SCENE = Scene(robot=ur5e_of([(shape,) for shape in SHAPES]))


class Case(NamedTuple):
    """Arrays of the search for several contacts."""

    localizer: Localizer
    constants: Constants
    state: State
    buffers: MultiContactBuffers
    trials: Trials

    def problem(self, rows: int, contacts: int, known: KnownRows = NOTHING_KNOWN) -> JointProblem:
        """That many contacts are to explain the first rows."""
        measurement = Measurement(self.buffers.rows, rows)
        return JointProblem(self.constants.surfaces, self.constants.prior, measurement, known, contacts)

    @property
    def surface(self) -> PlacedSurface:
        return PlacedSurface(self.constants.surfaces, self.constants.deviations, self.state.frames)

    @property
    def steps(self) -> JointSteps:
        return JointSteps(self.surface, self.buffers)


def empty_case() -> Case:
    """Without contacts."""
    localizer = Localizer(SCENE)
    constants, state = localizer._buffers.constants, localizer._buffers.state
    return Case(localizer, constants, state, empty_multi_contact_buffers(constants), Trials(SCENE, seed=4))


def take(case: Case, trial: Trial, shift: float, seed: int) -> int:
    """Noisy measurement of a trial; its contacts, displaced by about `shift` metres, as initial values, other
    ones in each lane. Number of rows."""
    rng = np.random.default_rng(seed)
    base, torque = trial.measure(trial.pushes)
    base = base + rng.standard_normal(6) * np.repeat((0.25, 0.05), 3)
    torque = torque + rng.standard_normal(6)
    case.localizer.locate(trial.q, base_wrench=base, joint_torque=torque, detect=False)
    surfaces, prior, joint = case.constants.surfaces, case.constants.prior, case.buffers.joint
    place_primitives(surfaces, case.constants.sensors.depth, case.state.motion, case.state.frames)
    for i, push in enumerate(trial.pushes):
        indices = range(surfaces.start[push.link], surfaces.start[push.link + 1])
        p = min(indices, key=lambda p: abs(_distance(case, p, push.point)))
        for lane in range(LANES):
            start = push.point + shift * rng.standard_normal(3)
            set_contact(case.surface, prior, joint, lane, i, p, tuple(start), tuple(push.force))
    state = case.state
    external = (state.base_wrench, state.torque, state.link_wrench)
    return int(
        fill_measurement_rows(
            case.constants.sensors, state.motion, external,
            Variances(
                case.constants.sensors.base_information, 1.0, case.constants.sensors.torque_variance,
                state.link_row, state.link_variance,
            ),
            (True, True, 0), 0.0, case.buffers.rows,
        )
    )  # fmt: skip


def _distance(case: Case, p: int, point: np.ndarray) -> float:
    local = case.state.frames.rotation[p].T @ (point - case.state.frames.origin[p])
    return float(project(case.constants.surfaces.kind[p], case.constants.surfaces.size[p], *local)[0])


def draw_known(case: Case, count: int) -> tuple[Trial, int]:
    """Contacts and their measurement; they are also the known ones, but for the covariances of their places.
    The trial, and the number of rows."""
    trial = case.trials.draw(count, 20.0, "different")
    m = take(case, trial, 0.0, count)
    joint, known = case.buffers.joint, case.buffers.known
    for i, push in enumerate(trial.pushes):
        block = joint.contact[i]
        known.primitive[i], known.torsion[i] = joint.primitive[i, 0], push.torsion
        known.point[i], known.force[i] = vector_of(block, PX, 0), vector_of(block, FX, 0)
    return trial, m
