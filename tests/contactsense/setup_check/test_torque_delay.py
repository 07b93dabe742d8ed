"""Joint torques, or the readings of a base sensor, that come later than the joint positions."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense.benchmarks.calibration.setup_draws import Case, Settings, right_setup
from contactsense.setup_check import Finding, SetupCheck, check
from contactsense.setup_check.fit.fitter import Fitter
from contactsense.setup_check.lines import DELAYED_TORQUES
from contactsense.setup_check.setup import Setup
from contactsense.setup_check.terms.instants import at_delay
from contactsense.setup_check.terms.motion_basis import MotionBases, Readings

DRAWN = Settings(seconds=12.0)
LATE = 12
"""By how many samples of 8 ms something comes late: whole ones, so that the noise stays as it is."""


def _later(array: np.ndarray | None) -> np.ndarray:
    """What was read `LATE` samples before."""
    assert array is not None
    return array[:-LATE]


def _case(speed: float = DRAWN.speed) -> Case:
    return right_setup("ur5e", 3, replace(DRAWN, speed=speed))


def _checked(case: Case, *late: str) -> SetupCheck:
    """What is said if these arrays of the recording come late."""
    now = case.recording.part(np.arange(LATE, len(case.recording.t)))
    changes = {name: _later(getattr(case.recording, name)) for name in late}
    return check(case.scene, [replace(now, **changes)])


def _of_torques(found: SetupCheck) -> Finding:
    (item,) = (item for item in found.findings if item.line == DELAYED_TORQUES)
    return item


def _milliseconds(text: str | None, expected: str = "late") -> float:
    assert text is not None
    size, unit, way = text.split(" ")
    assert unit == "ms"
    assert way == expected
    return float(size)


@pytest.mark.slow
def test_late_torques_are_named_with_their_delay() -> None:
    """Friction must not absorb them."""
    (item,) = _checked(_case(), "torque").wrong
    assert item.line == DELAYED_TORQUES
    assert item.stated == "none"
    assert _milliseconds(item.proposed) == pytest.approx(96.0, abs=12.0)


@pytest.mark.slow
def test_a_late_base_sensor_is_named_with_its_delay() -> None:
    (item,) = _checked(_case(), "reading").wrong
    assert item.line == "base_wrench.delay"
    assert item.proposed is not None
    assert float(item.proposed) == pytest.approx(0.096, abs=0.003)


@pytest.mark.long
def test_late_positions_make_the_base_sensor_and_the_torques_early() -> None:
    """Friction reverses with the velocities of late positions: it must be able to reverse early as well."""
    said = {item.line: item.proposed for item in _checked(_case(), "q", "qd").wrong}
    assert set(said) == {"base_wrench.delay", DELAYED_TORQUES}
    delay, torques = said["base_wrench.delay"], said[DELAYED_TORQUES]
    assert delay is not None
    assert float(delay) == pytest.approx(-0.096, abs=0.003)
    assert _milliseconds(torques, "early") == pytest.approx(96.0, abs=12.0)


@pytest.mark.slow
def test_slow_motion_does_not_determine_the_delay_of_torques() -> None:
    """At 0.3 rad/s its standard deviation is below 10 ms, at 0.05 rad/s it is above 20 ms."""
    fast, slow = (_of_torques(_checked(_case(speed))) for speed in (0.3, 0.05))
    assert fast.verdict == "fits"
    assert fast.std[0] < 0.010
    assert slow.verdict == "cannot_tell"
    assert slow.remark == "not determined by this motion"
    assert slow.std[0] > 0.020


@pytest.mark.slow
@pytest.mark.parametrize("displacement", [0.002, 0.005])
def test_friction_that_reverses_late_is_no_delay(displacement: float) -> None:
    """Dahl's friction follows the velocity after a small displacement [rad]: as if it came late."""
    case = _case()
    scene, part = case.scene, case.recording
    assert scene.joint_torque is not None
    assert part.torque is not None
    friction = scene.joint_torque.friction
    strain, strains = np.zeros(6), np.empty_like(part.q)
    for i, path in enumerate(np.diff(part.q, axis=0, prepend=part.q[:1])):
        # The exact solution for a path without reversal.
        strain = np.sign(path) + (strain - np.sign(path)) * np.exp(-np.abs(path) / displacement)
        strains[i] = strain
    prompt = np.tanh(part.qd / friction.velocity)
    torque = part.torque + np.array(friction.coulomb) * (strains - prompt)
    found = check(scene, [replace(part, torque=torque)])
    assert DELAYED_TORQUES not in [item.line for item in found.wrong]


@pytest.mark.parametrize("delay", [0.0, 0.02, 0.096, -0.07])
def test_terms_between_the_nodes_are_those_of_a_parabola(delay: float) -> None:
    nodes = np.tile(0.05 * np.arange(-2.0, 3.0), (3, 1))
    terms = np.stack((1.0 + 2.0 * nodes - 30.0 * nodes**2, nodes), axis=-1)
    exact = [1.0 - 2.0 * delay - 30.0 * delay**2, -delay]
    np.testing.assert_allclose(at_delay(terms, nodes, delay), np.tile(exact, (3, 1)), atol=1e-12)


def test_the_right_delay_leaves_nothing_but_noise() -> None:
    case = _case()
    late = replace(case.recording, torque=_padded(case.recording.torque))
    left = {}
    for name, part, delay in (("prompt", case.recording, 0.0), ("late", late, 0.096), ("wrong", late, 0.0)):
        fitter = Fitter(
            case.scene, MotionBases({"ur5e": case.scene}, [part]), Readings.of(case.scene, [part])
        )
        found = fitter.fit(replace(Setup.of(case.scene), torque_delay=delay))
        left[name] = float(np.sqrt(np.mean(found.residual[:, :3] ** 2)))
    assert left["late"] < 1.25 * left["prompt"] < left["wrong"]


def _padded(torque: np.ndarray | None) -> np.ndarray:
    """Torques that come late, the first one repeated meanwhile."""
    assert torque is not None
    return np.concatenate((np.repeat(torque[:1], LATE, axis=0), _later(torque)))
