"""Which windows of a contact agree, which begin anew, and what that says of its motion."""

import numpy as np
import pytest

from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import build_model, empty_motion
from contactsense.residuals.observers import first_torque
from contactsense.robots.jit.flat_buffers import zeros
from contactsense.robots.vectors import tangents
from contactsense.tracking.contact_track import HOLD, NEW, NONE, SLIDE, WINDOWS, ContactTrack
from contactsense.tracking.contact_tracker import (
    POSITION_TOLERANCE,
    _window_positions,
    choose_window,
    update_phase,
)
from tests.plain_arm import plain_ur5e

DT, BANDWIDTH = 0.002, 10.0
TIME_CONSTANT = 1.0 / (2.0 * np.pi * BANDWIDTH)
BODY, FORCE, NOISE = 3, 20.0, 0.02
"""The touched body, the force on it [N], and the noise of the moments [Nm]."""
TORQUE_NOISE = 0.5
"""[Nm]"""
POINT, NORMAL = np.array([-0.2, 0.04, 0.007]), np.array([0.36, 0.48, 0.8])
RATIOS = [0.06 - 1e-5 * i for i in range(WINDOWS)]
UNIT = float(np.hypot(NOISE * np.sqrt(RATIOS[0]) / FORCE, POSITION_TOLERANCE))
"""Standard deviation of a window's place, nearly the same for all, and how far skin gives way [m]."""
SIZES = {"joints": 6, "links": 7, "link_sensors": 0}
MOTION = empty_motion(6)
forward_kinematics(build_model(plain_ur5e()), np.array([0.3, -1.1, 1.4, -0.6, 0.9, 2.0]), MOTION)


def put(track: ContactTrack, i: int, place: np.ndarray, force: np.ndarray, torsion: float = 0.0) -> None:
    """Let a window's mean be a force at a place, in the frame of the body."""
    track.mean[i, 6 * BODY : 6 * BODY + 3] = force
    track.mean[i, 6 * BODY + 3 : 6 * BODY + 6] = np.cross(place, force) + torsion * NORMAL


def touched(shifts: list[float], newest: float = FORCE) -> ContactTrack:
    """Windows whose contact is shifted by so many `UNIT`s."""
    track = zeros(ContactTrack, **SIZES)
    track.last_point[:], track.last_normal[:] = POINT, NORMAL
    track.status[0].last_body = BODY
    tangent = np.array(tangents((0.36, 0.48, 0.8))[0])
    for i, shift in enumerate(shifts):
        place = POINT + shift * UNIT * tangent
        put(track, i, place, -(newest if i == 0 else FORCE) * NORMAL)
        window = track.windows[i]
        window.variance_ratio, window.samples, window.age = RATIOS[i], 10.0 * (i + 1), 0.1 * (i + 1)
    return track


def choose(
    track: ContactTrack, has_base: bool = True, torque_scale: float = 1.0, link_sensors: int = 0
) -> bool:
    """Choose a window; the base sensor's noise is that of its moments alone."""
    base_noise = (np.diag([1e-12] * 3 + [NOISE**2] * 3), np.zeros((6, 6)))
    torque_noise = (np.full(6, TORQUE_NOISE**2), torque_scale)
    usable = (has_base, True, link_sensors)
    return bool(choose_window(torque_noise, base_noise, track, MOTION, usable, DT, BANDWIDTH))


@pytest.mark.parametrize("seed", range(3))
def test_the_place_of_a_window_is_where_its_force_meets_the_tangent_plane(seed: int) -> None:
    """Whatever the direction of the force, and its torsion about the normal."""
    chance = np.random.default_rng(seed)
    track = touched([0.0] * WINDOWS)
    ways = np.array(tangents((0.36, 0.48, 0.8)))
    places, forces = chance.uniform(-0.1, 0.1, (WINDOWS, 2)), chance.uniform(-30.0, 30.0, (WINDOWS, 3))
    for i in range(WINDOWS):
        put(track, i, POINT + places[i] @ ways, forces[i], torsion=chance.uniform(-2.0, 2.0))
    _window_positions(track)
    for i in range(WINDOWS):
        window = track.windows[i]
        assert (window.x, window.y) == pytest.approx(tuple(places[i]))
        assert window.normal_force == pytest.approx(forces[i] @ NORMAL)


FAR, LESS = 4.65, 4.3
"""The square of the first is above 20, so that it clearly disagrees; that of the second is below."""


@pytest.mark.parametrize(
    ("shifts", "used", "copied", "slid"),
    [
        ([0.0] * 6, 5, (), False),
        ([0.0, 0.0, 0.0, 0.0, FAR, FAR], 3, (4, 5), True),
        ([0.0, 0.0, FAR, FAR, FAR, FAR], 1, (3, 4, 5), True),  # short windows forget soon enough
        ([0.0, FAR, FAR, FAR, FAR, FAR], 0, (3, 4, 5), True),
        ([0.0, 0.0, 0.0, 0.0, LESS, 0.0], 3, (), False),
        ([0.0, 0.0, 0.0, 0.0, 0.0, LESS], 4, (), False),
    ],
)
def test_windows_are_used_as_long_as_all_shorter_ones_agree(
    shifts: list[float], used: int, copied: tuple[int, ...], slid: bool
) -> None:
    """One that clearly disagrees becomes a copy of the longest that can be used."""
    track = touched(shifts)
    before = track.mean.copy()
    assert choose(track) == slid
    assert track.status[0].window == used
    for i in range(WINDOWS):
        source = used if i in copied else i
        np.testing.assert_array_equal(track.mean[i], before[source])
        window = track.windows[i]
        assert (window.variance_ratio, window.age) == (RATIOS[source], 0.1 * (source + 1))
        # It holds no more than a window of that length.
        most = 3.0**used * TIME_CONSTANT / DT if used else 1.0
        assert window.samples == pytest.approx(
            min(10.0 * (source + 1), most) if i in copied else 10.0 * (i + 1)
        )


@pytest.mark.parametrize(
    ("phase", "shift", "used"),
    [(NEW, 2.15, 5), (NEW, 2.3, 4), (SLIDE, 2.15, 5), (SLIDE, 2.3, 4), (HOLD, 3.05, 5), (HOLD, 3.25, 4)],
)
def test_a_contact_that_holds_is_given_more_tolerance(phase: int, shift: float, used: int) -> None:
    """Squares below 5 agree, of a contact that holds those below 10."""
    track = touched([0.0, 0.0, 0.0, 0.0, 0.0, shift])
    track.status[0].phase = phase
    assert not choose(track)
    assert track.status[0].window == used


@pytest.mark.parametrize(("newest", "slid"), [(0.2 * FORCE, False), (0.3 * FORCE, True)])
def test_a_contact_that_ends_does_not_slide(newest: float, slid: bool) -> None:
    assert choose(touched([0.0, 0.0, 0.0, 0.0, 100.0 * FAR, 100.0 * FAR], newest)) == slid


@pytest.mark.parametrize(("sustained", "used"), [(False, 0), (True, 1)])
def test_the_first_sample_of_a_contact_is_explained_by_what_showed_it(sustained: bool, used: int) -> None:
    track = touched([0.0] * WINDOWS)
    track.status[0].last_body, track.status[0].sustained = -1, sustained
    assert not choose(track)
    assert track.status[0].window == used


@pytest.mark.parametrize(("change", "scale", "used"), [(0.0, 1.0, 5), (0.5, 1.0, 3), (0.5, 4.0, 5)])
def test_without_a_base_sensor_the_torques_must_agree(change: float, scale: float, used: int) -> None:
    """A changed torque is no motion of the contact, nor a change if it is within the noise of the stream."""
    track = touched([FAR, -FAR] * 3)
    first = first_torque(6)
    track.mean[:, first + 1] = 20.0
    track.mean[4:, first + 2] = change
    assert not choose(track, has_base=False, torque_scale=scale)
    assert track.status[0].window == used


@pytest.mark.parametrize("newest", [0.5, 1.5])
def test_without_a_base_sensor_the_magnitude_of_the_torques_may_change(newest: float) -> None:
    """The force is that of the newest windows, which agree in it, place and link those of all."""
    track, first = touched([0.0] * WINDOWS), first_torque(6)
    torque = np.array([8.0, -20.0, 12.0, 0.0, 0.0, 0.0])
    track.mean[:2, first : first + 6] = newest * torque
    track.mean[2:, first : first + 6] = torque
    assert not choose(track, has_base=False)
    assert track.status[0].window == WINDOWS - 1
    assert track.status[0].magnitude == pytest.approx(newest)
    assert not choose(track)
    assert track.status[0].magnitude == 1.0
    # A sensor within the arm measures the present force better than the torques do.
    assert not choose(track, has_base=False, link_sensors=1)
    assert (track.status[0].window, track.status[0].magnitude) == (1, 1.0)


def test_without_a_base_sensor_a_push_that_turns_into_a_pull_is_another_contact() -> None:
    track, first = touched([0.0] * WINDOWS), first_torque(6)
    torque = np.array([8.0, -20.0, 12.0, 0.0, 0.0, 0.0])
    track.mean[:2, first : first + 6] = -0.5 * torque
    track.mean[2:, first : first + 6] = torque
    assert not choose(track, has_base=False)
    assert (track.status[0].window, track.status[0].magnitude) == (1, 1.0)
    np.testing.assert_array_equal(track.mean[3, first : first + 6], -0.5 * torque)


def test_a_contact_is_new_then_holds_slides_and_holds_again() -> None:
    """New for 9 time constants of the observer, whatever it does; it holds again 20 after it last moved."""
    track = zeros(ContactTrack, **SIZES)
    status = track.status[0]
    assert status.phase == NONE
    seen = []
    for k in range(round(60 * TIME_CONSTANT / DT)):
        t = k * DT / TIME_CONSTANT
        update_phase(track, t < 5.0 or 20.0 < t < 25.0, DT, BANDWIDTH)
        seen.append((t, status.phase))
    expected = [(0.0, NEW), (9.0, HOLD), (20.0, SLIDE), (45.0, HOLD)]
    changes = [seen[i] for i in range(len(seen)) if i == 0 or seen[i][1] != seen[i - 1][1]]
    assert [phase for _, phase in changes] == [phase for _, phase in expected]
    for (t, _), (at, _) in zip(changes, expected, strict=True):
        assert t == pytest.approx(at, abs=2.0 * DT / TIME_CONSTANT)
