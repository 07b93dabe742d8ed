"""The kernels' quick test of readings passes nothing that `PlausibleLimits` refuses, and what is ordinary."""

import numpy as np
import pytest

from contactsense import Scene, WrenchSensor, robots
from contactsense.plausibility.plausible_limits import PlausibleLimits
from contactsense.robots.jit.kernel import kernel
from contactsense.scene_model.arm_weight import ArmWeight
from contactsense.scene_model.constants import build_constants
from contactsense.scene_model.reading_limits import (
    LARGEST_FORCE,
    LARGEST_MOMENT,
    ReadingLimits,
    is_base_plausible,
    is_sample_plausible,
)
from tests.plain_arm import plain_ur5e

ARM = plain_ur5e()
Q = np.array([0.0, -1.3, 1.6, -1.9, -1.57, 0.0])
RANGED = WrenchSensor(
    range=(400.0, 60.0), rpy=(0.3, -0.2, 0.5), translation=(0.0, 0.1, 0.05), bias=(5, 0, -9, 1, 2, 0)
)
SCENES = (Scene(robot=ARM), Scene(robot=ARM, base_wrench=RANGED, mounting=(0.0, 0.4, 0.0)))


@kernel
def _sample(
    limits: ReadingLimits, q: np.ndarray, torque: np.ndarray, base_wrench: np.ndarray, sensor_bits: int
) -> bool:
    return is_sample_plausible(limits, q, torque, base_wrench, sensor_bits)


@kernel
def _base(limits: ReadingLimits, wrench: np.ndarray, weight: np.ndarray, external: bool) -> bool:
    return is_base_plausible(limits, wrench, weight, external)


@pytest.mark.parametrize("scene", SCENES, ids=["no range", "range"])
def test_a_sample_passes_exactly_if_nothing_is_wrong_with_it(scene: Scene) -> None:
    chance, limits, kernels = np.random.default_rng(0), PlausibleLimits(scene), build_constants(scene).limits
    counts = np.zeros(2, dtype=int)
    for _ in range(2000):
        q = chance.uniform(-1.1, 1.1, 6) * 4.0 * np.pi
        torque = chance.uniform(-1.02, 1.02, 6) * 1.5 * np.array([joint.torque_limit for joint in ARM.joints])
        wrench = chance.uniform(-1.0, 1.0, 6) * np.repeat([350.0, 60.0], 3)
        for bits in (0, 1, 2, 3):
            found = limits.position(q)
            found = found or (limits.torque(torque) if bits & 2 else None)
            found = found or (limits.saturation(wrench) if bits & 1 else None)
            assert _sample(kernels, q, torque, wrench, bits) == (found is None)
            counts[int(found is None)] += 1
    assert counts.min() > 500


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("field", ["q", "torque", "wrench"])
def test_what_is_no_number_does_not_pass(field: str, wrong: float) -> None:
    values = {"q": Q.copy(), "torque": np.zeros(6), "wrench": np.zeros(6)}
    limits = build_constants(SCENES[1]).limits
    assert _sample(limits, *values.values(), 3)
    values[field][2] = wrong
    assert not _sample(limits, *values.values(), 3)


@pytest.mark.slow
@pytest.mark.parametrize("external", [True, False])
@pytest.mark.parametrize("scene", SCENES, ids=["no range", "range"])
def test_a_base_wrench_that_is_refused_does_not_pass(scene: Scene, external: bool) -> None:
    """Contacts, and what mistakes make of readings, with a tenth of the weight added to it."""
    chance, limits, kernels = np.random.default_rng(1), PlausibleLimits(scene), build_constants(scene).limits
    weight = ArmWeight(scene)
    passed, refused = 0, 0
    for _ in range(2000):
        q = chance.uniform(-np.pi, np.pi, 6)
        own = weight.wrench(q)
        contact = chance.standard_normal(6) * np.repeat([40.0, 15.0], 3) * chance.choice([0.3, 1.0, 100.0])
        wrench = chance.choice([0.0, 1.0, -1.0]) * own + contact
        passes = _base(kernels, wrench, own, external)
        found = limits.request(q, wrench, None, {}, external)
        assert found is None or not passes
        passed, refused = passed + passes, refused + (found is not None)
    assert passed > 500
    assert refused > 200


@pytest.mark.parametrize("name", robots.names())
def test_the_largest_wrench_is_far_beyond_what_an_arm_exerts(name: str) -> None:
    """As the limits state: eight times the push at full reach, six times the torque."""
    joints = robots.load(name).joints
    torque = max(joint.torque_limit for joint in joints)
    # Stretched out: upper arm, forearm, and the way between the last two wrists.
    reach = sum(float(np.abs(joint.translation).max()) for joint in joints[2:5])
    assert 8.0 * torque / reach < LARGEST_FORCE
    assert 6.0 * torque < LARGEST_MOMENT
    stated = {"ur20": (738.0, 1.75, 422.0), "ur30": (738.0, 1.3, 568.0)}
    if name in stated:
        assert (torque, reach, torque / reach) == pytest.approx(stated[name], abs=0.5, rel=1e-3)
    else:
        assert torque < 738.0
