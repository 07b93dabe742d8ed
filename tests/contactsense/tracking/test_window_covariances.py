"""Noise of the places that windows give, with that of the velocities."""

import numpy as np
import pytest

from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.residuals.wrench_velocity_error import noise_share_in_average
from contactsense.robots.jit.flat_buffers import zeros
from contactsense.robots.vectors import tangents
from contactsense.tracking.contact_track import WINDOWS, ContactTrack
from contactsense.tracking.contact_tracker import (
    _moment_covariances,
    _most_precise_window,
    _position_distance,
)
from tests.plain_arm import plain_ur5e

ARM = plain_ur5e()
LINK, BANDWIDTH = 3, 10.0


def track_of(*arrays: tuple[str, list[float]]) -> ContactTrack:
    """With these numbers of the first windows, and 1 for their other variances and -1 for their forces."""
    track = zeros(ContactTrack, joints=6, links=7, link_sensors=0)
    for i in range(WINDOWS):
        window = track.windows[i]
        window.variance_ratio = window.moment_xx = window.moment_yy = 1.0
        window.normal_force = -1.0
    for name, values in arrays:
        for i, value in enumerate(values):
            track.windows[i][name] = value
    return track


def test_the_noise_of_velocities_is_averaged_apart_from_that_of_the_sensor() -> None:
    """In the second window nothing is averaged, in the last one more than in the newest residual."""
    chance, ratios = np.random.default_rng(0), [0.06, 0.06, 0.02, 0.004, 1e-4, 0.12]
    sensor, velocities = (a @ a.T for a in chance.standard_normal((2, 6, 6)))
    motion, track = empty_motion(6), track_of(("variance_ratio", ratios))
    forward_kinematics(build_model(ARM), np.array([0.3, -1.1, 1.4, -0.6, 0.9, 2.0]), motion)
    track.status[0].last_body = LINK
    track.last_point[:], track.last_normal[:] = (-0.2, 0.04, 0.007), (0.0, 0.6, 0.8)
    _moment_covariances((sensor + velocities / ratios[0], velocities), motion, track, BANDWIDTH)
    R, n = motion.rotation[LINK], track.last_normal
    c = motion.origin[LINK] + R @ track.last_point
    arm = np.array([[0.0, -c[2], c[1]], [c[2], 0.0, -c[0]], [-c[1], c[0], 0.0]])
    # n x r along both tangents, r being the moment about the point.
    rows = np.array([R @ np.cross(t, n) for t in map(np.array, tangents(tuple(n)))])
    rows = np.hstack((-rows @ arm, rows))
    for i, ratio in enumerate(ratios):
        share = ratio / ratios[0]
        average = noise_share_in_average(share, BANDWIDTH) if share < 1.0 else share
        expected = rows @ (ratio * sensor + average * velocities) @ rows.T
        window = track.windows[i]
        found = [[window.moment_xx, window.moment_xy], [window.moment_xy, window.moment_yy]]
        np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_the_distance_of_two_windows_is_in_units_of_the_noisier_one() -> None:
    track = track_of(
        ("moment_xx", [4e-4, 1e-6]), ("moment_yy", [2e-4, 1e-6]), ("moment_xy", [2.5e-4, 0.0]),
        ("normal_force", [-2.0, -1.0]), ("x", [0.02, 0.0]), ("y", [0.01, 0.0]),
    )  # fmt: skip
    covariance = np.array([[4e-4, 2.5e-4], [2.5e-4, 2e-4]]) / 2.0**2 + 1e-4**2 * np.eye(2)
    for y in (0.01, -0.01):
        track.windows[0].y = y
        d = np.array([0.02, y])
        expected = 0.5 * (d @ np.linalg.solve(covariance, d) - 2.0)
        for pair in ((0, 1), (1, 0)):
            assert _position_distance(track, *pair) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("variances", "forces", "longest", "expected"),
    [
        ([1.0, 0.8, 0.9], [-1.0, -1.0, -1.0], 2, 1),
        ([1.0, 0.8, 0.7], [-1.0, -1.0, -1.0], 2, 2),
        ([1.0, 0.8, 0.7], [-1.0, -1.0, -1.0], 1, 1),
        ([1.0, 0.5, 0.4], [-3.0, -1.0, -2.0], 2, 2),
        ([1.0, 0.5, 0.4], [-3.0, -2.0, -1.0], 2, 0),
        ([1.0, 0.5, 0.1], [-3.0, -2.5, 1.0], 2, 1),
        ([1.0, 0.5, 0.1], [1.0, -2.5, -1.0], 2, 0),
    ],
)
def test_the_window_in_use_has_the_least_variance_over_the_square_of_its_force(
    variances: list[float], forces: list[float], longest: int, expected: int
) -> None:
    track = track_of(("moment_xx", variances), ("moment_yy", variances), ("normal_force", forces))
    assert _most_precise_window(track, longest) == expected
