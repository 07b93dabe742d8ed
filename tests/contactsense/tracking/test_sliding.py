"""A sliding contact is told where it is, not where the observer and its means saw it last."""

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Localizer, Scene, WrenchSensor, robots
from contactsense.benchmarks.hold.simulate import SLIDE, Finger, stream
from contactsense.benchmarks.static_truth.cases import COLUMNS
from contactsense.kinematics.model import empty_motion
from contactsense.robots.jit.flat_buffers import zeros
from contactsense.robots.vectors import tangents
from contactsense.tracking.contact_track import HOLD, ContactTrack
from contactsense.tracking.contact_track import SLIDE as SLIDING
from contactsense.tracking.sliding import extrapolate_sliding

NOISE = COLUMNS[1]


@pytest.fixture(scope="module")
def way() -> np.ndarray:
    """Time since the touch [s], and by how much the place found is behind the finger [m], one row a sample of
    the slide from when it is said to be one; shape (N, 2)."""
    scene = Scene(
        robot=robots.load("ur5e"),
        base_wrench=WrenchSensor(force_noise=NOISE.force, moment_noise=NOISE.moment),
        joint_torque=JointTorqueSensor(noise=NOISE.torque),
    )
    localizer, finger = Localizer(scene), Finger()
    start, rows = finger.at(0.0)[0][0], []
    for sample, _, since in stream(SLIDE, finger, 1.5, 0, noise=NOISE):
        estimate = localizer.step(sample)
        if since > 0.6 and estimate.contacts and estimate.contacts[0].phase == "slide":
            rows.append((since, SLIDE.slide * (since - 0.5) - (start - estimate.contacts[0].point[0])))
    return np.array(rows)


def test_a_sliding_contact_has_no_lag(way: np.ndarray) -> None:
    """At 50 mm/s the observer alone is 0.8 mm behind, and a mean over two of its time constants more."""
    assert len(way) > 400
    assert abs(np.median(way[:, 1])) < 2e-4
    assert np.quantile(np.abs(way[:, 1]), 0.9) < 1.5e-3


WINDOW = 3
AGES = np.array([0.016, 0.03, 0.05, 0.09])
"""Mean age of the windows [s]; the last one is in use."""
FORCES = np.full(4, -20.0)
"""Their mean normal force [N]."""


def extrapolated(
    place: np.ndarray,
    noise: np.ndarray,
    phase: int = HOLD,
    body: int = 0,
    ages: np.ndarray = AGES,
    forces: np.ndarray = FORCES,
    in_use: int = WINDOW,
    tangential: tuple[float, float] = (0.0, 0.0),
) -> tuple[np.ndarray, np.ndarray]:
    """Shift and added covariance of a contact on the base, whose normal is z.

    Args:
        place: Of each window along the tangents, shape (4, 2) [m].
        noise: Standard deviation of each along either tangent, shape (4,) [m].
        phase: Of the contact.
        body: That of the candidate.
        ages: Mean age of each window [s].
        forces: Mean normal force of each window [N].
        in_use: Index of the window in use.
        tangential: Mean force of that window along the tangents, in parts of the normal force.
    """
    track, motion = zeros(ContactTrack, joints=6, link_sensors=0, links=7), empty_motion(6)
    motion.rotation[:] = np.eye(3)
    status = track.status[0]
    status.window, status.phase, status.last_body = in_use, phase, 0
    track.last_normal[:] = 0.0, 0.0, 1.0
    for i in range(len(AGES)):
        window = track.windows[i]
        window.age, window.normal_force = ages[i], forces[i]
        window.x, window.y = place[i]
        window.moment_xx = window.moment_yy = (noise[i] * forces[i]) ** 2
    t1, t2 = np.array(tangents((0.0, 0.0, 1.0)))
    track.mean[in_use, :3] = -forces[in_use] * (tangential[0] * t1 + tangential[1] * t2)
    point, base, covariance = np.zeros(3), np.zeros(3), np.zeros((3, 3))
    extrapolate_sliding(track, motion, body, point, base, covariance)
    np.testing.assert_array_equal(point, base)
    return point, covariance


def test_a_shorter_window_that_is_no_noisier_tells_nothing() -> None:
    """As where the sensor's noise has fallen since: its samples are in the longer window, too."""
    place = np.array([[1e-3, 0.0], [1e-3, 0.0], [1e-3, 0.0], [0.0, 0.0]])
    for noise in (0.5e-3, 1e-3):
        point, covariance = extrapolated(place, np.array([noise, noise, noise, 1e-3]))
        np.testing.assert_allclose(point, 0.0, atol=1e-15)
        assert np.isfinite(covariance).all()
        assert (np.linalg.eigvalsh(covariance) > -1e-15).all()


LENGTHS = np.array([1.0, 3.0, 9.0, 27.0])
"""Of the windows; each contains the shorter ones."""


def means_over_windows(chance: np.random.Generator, forces: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Place of each window, of a contact that is now at the origin, shape (4, 2) [m].

    Args:
        chance: Random numbers.
        forces: Mean normal force of each window [N].
        velocity: Of the contact, shape (2,) [m/s].
    """
    added = np.diff(LENGTHS, prepend=0.0)[:, None]
    # The noise of the moment is that of 2 mm at 20 N in the shortest window.
    moments = np.cumsum(np.sqrt(added) * chance.normal(0.0, 0.04, (4, 2)), axis=0) / LENGTHS[:, None]
    return moments / forces[:, None] - AGES[:, None] * velocity


@pytest.mark.parametrize("phase", [HOLD, SLIDING])
@pytest.mark.parametrize("rises", [False, True])
def test_a_contact_that_may_slide_is_where_it_is_said_to_be(phase: int, rises: bool) -> None:
    """Half of the contacts hold their place, or none of those in the phase `SLIDE`; the others slide as is
    assumed beforehand: the errors have the stated variance, also while the force rises, and are smaller than
    those of the window. The normal has no share in it."""
    chance, in_use = np.random.default_rng(0), WINDOW if phase == HOLD else WINDOW - 1
    forces = np.array([-28.0, -26.0, -22.0, -14.0]) if rises else FORCES
    noise = 0.04 / np.sqrt(LENGTHS) / -forces
    errors, stated, before = [], [], []
    for _ in range(4000):
        velocity = chance.normal(0.0, 0.03, 2) * (phase == SLIDING or chance.random() < 0.5)
        places = means_over_windows(chance, forces, velocity)
        shift, covariance = extrapolated(places, noise, phase, forces=forces, in_use=in_use)
        error = places[in_use] + shift[:2]
        assert shift[2] == 0.0
        assert not covariance[2].any()
        errors.append(error @ error)
        stated.append(np.trace(covariance) + 2.0 * noise[in_use] ** 2)
        before.append((places[in_use] ** 2).sum())
    assert np.mean(errors) < 0.8 * np.mean(before)
    assert 0.85 < np.mean(errors) / np.mean(stated) < 1.1


@pytest.mark.parametrize("way", [0.018, 0.05])
def test_one_that_has_slid_far_unnoticed_is_moved_or_uncertain(way: float) -> None:
    """Along a tangent no farther than 3 cm, where a link is curved; the rest is uncertain."""
    places = -way * AGES[:, None] / AGES[WINDOW] * np.array([0.6, 0.8])
    for phase in (HOLD, SLIDING):
        shift, covariance = extrapolated(places, 1e-4 / np.sqrt(LENGTHS), phase, ages=5.0 * AGES)
        moved = min(way, 0.03)
        np.testing.assert_allclose(shift[:2], moved * np.array([0.6, 0.8]), rtol=0.02)
        assert np.trace(covariance) == pytest.approx((way - moved) ** 2, abs=1e-6)


@pytest.mark.parametrize(("away", "moved"), [(0.006, True), (0.04, False)])
def test_a_jump_is_no_slide(away: float, moved: bool) -> None:
    """Where the longer window still holds another contact: no finger slides by 4 cm in 14 ms."""
    place = np.array([[0.0, 0.0], [away, 0.0], [away, 0.0], [away, 0.0]])
    shift, covariance = extrapolated(place, 1e-4 / np.sqrt(LENGTHS), SLIDING, in_use=0)
    assert bool(shift.any()) == moved
    assert np.trace(covariance) < 1e-3**2


def test_what_slides_drags_the_link_along() -> None:
    """The tangential force points the way of a contact that slides, as far as the normal is known; one that
    holds its place has it in any direction. The errors have the stated variance, and are smaller than without
    that force."""
    chance = np.random.default_rng(0)
    noise = 0.04 / np.sqrt(LENGTHS) / -FORCES
    errors, stated, without = [], [], []
    for _ in range(2000):
        angle = chance.uniform(0.0, 2.0 * np.pi)
        way = np.array([np.cos(angle), np.sin(angle)])
        slides = chance.random() < 0.5
        velocity = way * abs(chance.normal(0.0, 0.03 * np.sqrt(2.0))) * slides
        places = means_over_windows(chance, FORCES, velocity)
        x, y = 0.5 * way + chance.normal(0.0, 0.15, 2)
        shift, covariance = extrapolated(places, noise, tangential=(x, y))
        alone, _ = extrapolated(places, noise)
        errors.append(((places[WINDOW] + shift[:2]) ** 2).sum())
        without.append(((places[WINDOW] + alone[:2]) ** 2).sum())
        stated.append(np.trace(covariance) + 2.0 * noise[WINDOW] ** 2)
    assert np.mean(errors) < 0.9 * np.mean(without)
    assert 0.85 < np.mean(errors) / np.mean(stated) < 1.1


@pytest.mark.parametrize("angle", [0.0, 1.0, 2.5, -2.0])
def test_the_way_of_the_force_is_that_of_the_shift(angle: float) -> None:
    """Where the windows tell no velocity, as they are of one place and too noisy."""
    way = np.array([np.cos(angle), np.sin(angle)])
    noise = 0.02 / np.sqrt(LENGTHS)
    shift, _ = extrapolated(np.zeros((4, 2)), noise, SLIDING, tangential=tuple(0.4 * way))
    across = way[0] * shift[1] - way[1] * shift[0]
    assert shift[:2] @ way > 1e-3
    assert abs(across) < 1e-9
    weak, _ = extrapolated(np.zeros((4, 2)), noise, SLIDING, tangential=tuple(0.02 * way))
    assert 0.0 < weak[:2] @ way < 0.3 * shift[:2] @ way


def test_a_force_along_the_tangent_plane_is_no_exception() -> None:
    """As where the primitive's normal is that of no part of the link: nothing but a direction is known."""
    noise = 0.02 / np.sqrt(LENGTHS)
    for ratio in (1e4, 1e12):
        shift, covariance = extrapolated(np.zeros((4, 2)), noise, tangential=(ratio, 0.0))
        assert shift[0] > 0.0
        assert abs(shift[1]) < 1e-9
        assert np.isfinite(covariance).all()
        assert (np.linalg.eigvalsh(covariance) > -1e-15).all()


def test_one_that_has_long_held_its_place_is_as_certain_as_before() -> None:
    noise = np.array([1e-3, 5e-4, 3e-4, 1.5e-4])
    shift, covariance = extrapolated(np.zeros((4, 2)), noise, ages=5.0 * AGES)
    assert not shift.any()
    assert np.trace(covariance) < 0.5 * 2.0 * noise[WINDOW] ** 2


def test_one_whose_windows_agree_with_a_velocity_is_moved_by_all_of_it() -> None:
    noise, velocity = 1e-4 / np.sqrt(LENGTHS), np.array([0.03, -0.02])
    for phase in (HOLD, SLIDING):
        shift, _ = extrapolated(-AGES[:, None] * velocity, noise, phase)
        np.testing.assert_allclose(shift[:2], AGES[WINDOW] * velocity, rtol=0.01)
        # Even one that a force from elsewhere pulls back.
        shift, _ = extrapolated(-AGES[:, None] * velocity, noise, phase, tangential=(-0.3, 0.2))
        np.testing.assert_allclose(shift[:2], AGES[WINDOW] * velocity, rtol=0.03)


def test_nothing_is_known_of_another_body() -> None:
    shift, covariance = extrapolated(-AGES[:, None] * np.ones(2), np.full(4, 1e-4), body=3)
    assert not shift.any()
    assert not covariance.any()
