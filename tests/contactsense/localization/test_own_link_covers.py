"""Primitives of one link overlap: what one of them covers of another is no explanation of a contact, and a
concave edge between two of them can be touched."""

from typing import NamedTuple

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Localizer, Scene, WrenchSensor
from contactsense.localization.candidates.accessibility import OWN_CLEARANCE, clearance
from contactsense.localization.surface.placed_surface import PlacedSurface
from contactsense.readings import forward_model
from contactsense.robots.primitives import Box
from contactsense.robots.surface.union import distances
from contactsense.robots.surroundings import Body
from contactsense.runtime.state import State
from contactsense.scene_model.constants import Constants, build_constants
from tests.contactsense.localization.placed_arm import placed
from tests.plain_arm import plain_ur5e, plain_ur5e_on

PENETRATION = 1e-3
"""Depth inside a link at which no contact can be: several standard deviations of the surface [m]."""
Q = np.array([0.3, -1.2, 1.5, -1.9, -1.4, 0.5])


class Arm(NamedTuple):
    scene: Scene
    localizer: Localizer
    constants: Constants
    state: State
    surface: PlacedSurface


@pytest.fixture(scope="module", params=["ur5e", "ur10e"])
def arm(request: pytest.FixtureRequest) -> Arm:
    scene = Scene(
        robot=request.param,
        base_wrench=WrenchSensor(force_noise=0.002, moment_noise=0.0004),
        joint_torque=JointTorqueSensor(noise=0.002),
    )
    constants = build_constants(scene)
    return Arm(scene, Localizer(scene), constants, *placed(constants, Q))


def _link(arm: Arm, sample: int) -> int:
    return int(arm.constants.surfaces.link[arm.constants.samples.primitive[sample]])


def _clearance(arm: Arm, sample: int) -> float:
    """Clearance of a sample, 0 if it is positive."""
    samples, body = arm.constants.samples, arm.constants.sensors.depth[_link(arm, sample)]
    R, o = arm.state.motion.rotation[body], arm.state.motion.origin[body]
    free: float = clearance(
        arm.surface,
        int(samples.primitive[sample]),
        tuple(R @ samples.point[sample] + o),
        tuple(R @ samples.normal[sample]),
        arm.constants.prior.clearance,
        0.0,
    )
    return free


def test_no_explanation_is_inside_of_its_own_link(arm: Arm) -> None:
    samples, surfaces = arm.constants.samples, arm.constants.surfaces
    rng, deepest, explanations = np.random.default_rng(3), 0.0, 0
    for s in range(0, len(samples.point), 3):
        link = _link(arm, s)
        if _clearance(arm, s) < 0.0:
            continue
        body = arm.constants.sensors.depth[link]
        inward = -samples.normal[s] + 0.25 * rng.standard_normal(3)
        force = 30.0 * arm.state.motion.rotation[body] @ inward
        readings = forward_model(
            arm.scene, Q, arm.scene.link_names[link], samples.point[s], force, external=True
        )
        found = arm.localizer.locate(Q, base_wrench=readings.base_wrench, joint_torque=readings.joint_torque)
        for contact in found.contacts:
            if contact.probability > 0.1:
                explanations += 1
                depth = -float(distances(surfaces, contact.point[None], contact.link_index)[0][0])
                deepest = max(deepest, depth)
    assert explanations > 100
    assert deepest < PENETRATION


def test_a_concave_edge_can_be_touched(arm: Arm) -> None:
    # The room for a finger above it is within the next face of the same link.
    samples, surfaces = arm.constants.samples, arm.constants.surfaces
    above = samples.point + arm.constants.prior.clearance * samples.normal
    concave = [
        s for s in range(len(above)) if distances(surfaces, above[s : s + 1], _link(arm, s))[0][0] < -1e-3
    ]
    assert any(_clearance(arm, s) == pytest.approx(0.0, abs=1e-9) for s in concave)


def test_the_face_on_which_two_primitives_touch_cannot_be_touched() -> None:
    left = Box(center=(0.2, 0.3, 0.05), half=(0.1, 0.15, 0.05), rounding=0.001)
    right = Box(center=(0.4, 0.3, 0.04), half=(0.1, 0.15, 0.04), rounding=0.001)
    constants = build_constants(Scene(robot=plain_ur5e_on((left, right))))
    _, surface = placed(constants, Q)
    free = [
        clearance(
            surface,
            0,
            (0.3, 0.3, z),
            (1.0, 0.0, 0.0),
            constants.prior.clearance,
            0.01,
        )
        for z in (0.04, 0.09)
    ]
    # Below the top of the other one, and above it.
    assert free[0] == pytest.approx(-OWN_CLEARANCE, abs=1e-9)
    assert free[1] > 0.0


def test_a_cover_of_the_base_link_must_leave_the_room_of_a_finger() -> None:
    """Covers follow the primitives of all links, and are none of the base link's own."""
    gap = 0.003
    wall = Body(
        name="wall",
        role="cover",
        primitives=(Box(center=(0.175 + gap, 0, 0.05), half=(0.1, 0.2, 0.04), rounding=0.01),),
    )
    constants = build_constants(Scene(robot=plain_ur5e(), bodies=(wall,)))
    _, surface = placed(constants, Q)
    height = constants.prior.clearance
    free = clearance(surface, 0, (0.075, 0.0, 0.05), (1.0, 0.0, 0.0), height, 0.0)
    assert free == pytest.approx(gap - height, abs=1e-9)
