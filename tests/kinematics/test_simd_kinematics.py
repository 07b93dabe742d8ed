"""Eight samples at once: the digits of one at a time."""

import math

import numpy as np

from contactsense import robots
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.kinematics.momenta import kinematics_and_momenta
from contactsense.kinematics.simd_kinematics import empty_lanes, kinematics_in_lanes, motion_of_lane
from contactsense.kinematics.trigonometry import sine_and_versine
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.jit.lanes import LANES

GRAVITY = np.array([0.3, -0.2, -9.7])


@kernel
def _sines(angles: np.ndarray, sines: np.ndarray, versines: np.ndarray) -> None:
    for i in range(angles.shape[0]):
        sines[i], versines[i] = sine_and_versine(angles[i])


def test_sine_and_versine() -> None:
    chance = np.random.default_rng(1)
    quarters = np.arange(-40, 41) * math.pi / 4
    angles = np.concatenate(
        (chance.uniform(-7.0, 7.0, 20_000), chance.uniform(-1e6, 1e6, 20_000), quarters, [0.0, 1e-300])
    )
    sines, versines = np.empty_like(angles), np.empty_like(angles)
    _sines(angles, sines, versines)
    np.testing.assert_allclose(sines, np.sin(angles), rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(versines, 2.0 * np.sin(0.5 * angles) ** 2, rtol=0.0, atol=1e-15)
    small = chance.uniform(-1e-4, 1e-4, 1000)
    _sines(small, sines[:1000], versines[:1000])
    np.testing.assert_allclose(sines[:1000], np.sin(small), rtol=1e-15)
    np.testing.assert_allclose(versines[:1000], 2.0 * np.sin(0.5 * small) ** 2, rtol=1e-15)


def test_lanes_have_the_digits_of_single_samples() -> None:
    model = build_model(robots.load("ur10e"))
    chance = np.random.default_rng(2)
    q, qd = chance.uniform(-6.0, 6.0, (13, 6)), chance.uniform(-2.0, 2.0, (13, 6))
    lanes, motion, single = empty_lanes(6), empty_motion(6), empty_motion(6)
    for first in (0, 8):
        kinematics_in_lanes(model, GRAVITY, q, qd, first, lanes)
        for lane in range(LANES):
            i = min(first + lane, 12)
            motion_of_lane(lanes, lane, motion)
            kinematics_and_momenta(model, q[i].copy(), qd[i].copy(), GRAVITY, single)
            for name, value, expected in zip(motion._fields, motion, single, strict=True):
                np.testing.assert_array_equal(value, expected, err_msg=name)
