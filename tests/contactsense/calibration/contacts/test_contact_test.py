"""Pushes in a calibration's recording are found and left out; motion without them is used whole."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from contactsense.benchmarks.calibration.coverage import CENTER, GROUPS, draw
from contactsense.benchmarks.calibration.pushes import measure, summarize
from contactsense.benchmarks.calibration.simulate import Push, simulate
from contactsense.calibration import CalibrationError, FreeMotion, Settings, SuspectedContact, calibrate
from contactsense.calibration.contact_free_fit import TooMuchContactError
from contactsense.calibration.motion.fourier_trajectory import FourierTrajectory
from contactsense.scene import Scene

SETTINGS = Settings(GROUPS, widths=False)
PUSHES = (
    Push(3, (0.0, 0.0, 0.05), (0.0, 15.0, 10.0), 3.0, 4.5),
    Push(1, (0.0, 0.05, 0.0), (30.0, 0.0, 0.0), 7.0, 7.4),
    Push(6, (0.02, 0.0, 0.0), (20.0, -20.0, 40.0), 9.5, 11.5),
)


def recorded(pushes: tuple[Push, ...]) -> tuple[Scene, FreeMotion]:
    truth, gain, start = draw(np.random.default_rng(11))
    motion = FourierTrajectory.draw(np.random.default_rng(12), CENTER, np.full(6, 0.7), 8, 14.0)
    return start, simulate(truth, motion, 13, 125.0, gain, pushes)


def test_a_push_is_a_load_of_the_mock() -> None:
    """The same force, seen by the base sensor alone: its wrench on the sensor about the base origin."""
    force = np.array(PUSHES[0].force)
    _, free = recorded(())
    _, touched = recorded(PUSHES[:1])
    assert free.reading is not None
    assert touched.reading is not None
    difference = touched.reading - free.reading
    held = (free.t > 3.3) & (free.t < 4.2)
    np.testing.assert_allclose(difference[held, :3], np.tile(force, (held.sum(), 1)), atol=0.02)
    np.testing.assert_allclose(difference[(free.t < 2.9) | (free.t > 4.6)], 0.0, atol=1e-9)


@pytest.mark.slow
def test_pushes_are_left_out_and_named() -> None:
    start, free = recorded(())
    _, touched = recorded(PUSHES)
    shifted = replace(touched, name="touched.csv", rows=np.arange(len(touched.t)) + 1000)
    clean = calibrate(start, [free], SETTINGS)
    assert clean.contacts == ()
    assert clean.seconds == pytest.approx(free.seconds)
    found = calibrate(start, [shifted], SETTINGS)
    assert len(found.contacts) == len(PUSHES)
    for push, contact in zip(PUSHES, found.contacts, strict=True):
        assert contact.recording == "touched.csv"
        assert push.start - 0.8 < contact.start < push.start + 0.05
        assert push.stop - 0.05 < contact.stop < push.stop + 0.8
        assert contact.first_row == pytest.approx(1000 + 125 * contact.start, abs=1.0)
        assert contact.last_row == pytest.approx(1000 + 125 * contact.stop, abs=1.0)
        assert contact.channels
    kept = calibrate(start, [shifted], replace(SETTINGS, leave_out_contacts=False))
    assert kept.contacts == ()
    pairs = list(zip(clean.values, found.values, kept.values, strict=True))
    estimated = [(c, f, k) for c, f, k in pairs if not (c.kept or f.kept or k.kept)]
    assert len(estimated) > 30
    off = np.array([(f.after - c.after) / c.std for c, f, _ in estimated])
    wrong = np.array([(k.after - c.after) / c.std for c, _, k in estimated])
    # Without a third of the samples an estimate moves by about its standard deviation, not by tens of them.
    assert np.sqrt(np.mean(off**2)) < 2.0
    assert np.sqrt(np.mean(wrong**2)) > 10.0


def test_the_first_fit_does_not_lean_towards_pushes(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is no free motion by the scene's own values is left out of it, if half of the motion remains."""
    seen: list[list[FreeMotion]] = []

    def first_fit(start: object, recordings: list[FreeMotion], *others: object) -> None:
        seen.append(recordings)
        raise np.linalg.LinAlgError

    monkeypatch.setattr(sys.modules["contactsense.calibration.contact_free_fit"], "fit_model", first_fit)
    scene = Scene(robot="ur5e")
    motion = FourierTrajectory.draw(np.random.default_rng(12), CENTER, np.full(6, 0.7), 8, 14.0)
    often = tuple(Push(3, (0.0, 0.0, 0.05), (0.0, 40.0, 40.0), t, t + 1.4) for t in (1, 4, 7, 10))
    for pushes in ((), PUSHES, often):
        touched = simulate(scene, motion, 13, 125.0, pushes=pushes)
        with pytest.raises(CalibrationError, match="let every joint move"):
            calibrate(scene, [touched], SETTINGS)
    (free,), (few,), (many,) = seen
    assert free.usable.all()
    assert all(not few.usable[round(125 * (p.start + p.stop) / 2)] for p in PUSHES)
    assert few.usable.mean() >= 0.5
    assert many.usable.all()


@pytest.mark.slow
def test_samples_that_are_not_free_are_never_used(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene(robot="ur5e")
    motion = FourierTrajectory.draw(np.random.default_rng(12), CENTER, np.full(6, 0.7), 8, 14.0)
    touched = simulate(scene, motion, 13, 125.0, pushes=PUSHES[:1])
    given = replace(touched, free=(touched.t < 5.0) | (touched.t > 6.0))
    seen: list[np.ndarray] = []
    module = sys.modules["contactsense.calibration.contact_free_fit"]
    fit, trimmed = module.fit_model, module.trimmed_fit

    def fit_model(start: object, recordings: list[FreeMotion], *others: object) -> object:
        seen.append(recordings[0].usable)
        return fit(start, recordings, *others)

    def trimmed_fit(arm: object, start: object, recordings: list[FreeMotion], *others: object) -> object:
        seen.append(recordings[0].usable)
        return trimmed(arm, start, recordings, *others)

    monkeypatch.setattr(module, "fit_model", fit_model)
    monkeypatch.setattr(module, "trimmed_fit", trimmed_fit)
    found = calibrate(scene, [given], Settings(("bias",), widths=False))
    assert len(seen) >= 2
    assert not any(usable[~given.usable].any() for usable in seen)
    (contact,) = found.contacts
    assert contact.start < PUSHES[0].start
    assert found.seconds == pytest.approx(given.seconds - 1.0 - (contact.stop - contact.start), abs=0.02)


def test_a_recording_with_next_to_no_free_samples_is_refused() -> None:
    start, touched = recorded(())
    with pytest.raises(CalibrationError, match=r"free: expected at least 2 s of use, got 1 s"):
        calibrate(start, [replace(touched, free=touched.t < 1.0)], SETTINGS)
    with pytest.raises(ValueError, match=r"free: expected 1750 truth values, got array\(\["):
        replace(touched, free=np.ones(len(touched.t)))


def test_a_recording_full_of_contact_is_refused() -> None:
    pushes = tuple(Push(3, (0.0, 0.0, 0.05), (0.0, 40.0, 40.0), t, t + 1.4) for t in (1, 4, 7, 10))
    start, touched = recorded(pushes)
    text = r"expected motion without contact, .* of 14\.0 s, first at"
    with pytest.raises(TooMuchContactError, match=text) as error:
        calibrate(start, [replace(touched, name="touched.csv")], SETTINGS)
    assert {contact.recording for contact in error.value.contacts} == {"touched.csv"}


@pytest.mark.slow
def test_a_hand_that_holds_a_joint_at_rest_below_its_friction_is_not_told() -> None:
    """A joint at rest may hold any torque up to its Coulomb friction."""
    truth, _, start = draw(np.random.default_rng(11))
    assert truth.joint_torque is not None
    assert start.joint_torque is not None
    friction = truth.joint_torque.friction
    # What the joint may hold is beyond the limit for joints in motion.
    friction = friction.model_copy(update={"coulomb": (20.0, *friction.coulomb[1:])})
    torques = truth.joint_torque.model_copy(update={"friction": friction})
    known = start.joint_torque.model_copy(update={"friction": friction})
    start = start.model_copy(update={"base_wrench": None, "joint_torque": known})
    truth = truth.model_copy(update={"base_wrench": None, "joint_torque": torques})
    speed = np.array([0.0, 0.7, 0.7, 0.7, 0.7, 0.7])
    motion = FourierTrajectory.draw(np.random.default_rng(12), CENTER, speed, 8, 14.0)
    free = simulate(truth, motion, 13, 125.0)
    settings = Settings(("payload", "bias", "coulomb", "viscous", "rotor"), widths=False)

    def contacts(torque: float) -> tuple[SuspectedContact, ...]:
        assert free.torque is not None
        held = free.torque.copy()
        held[600:900, 0] += torque
        return calibrate(start, [replace(free, torque=held)], settings).contacts

    assert contacts(0.8 * friction.coulomb[0]) == ()
    (contact,) = contacts(5.0 * friction.coulomb[0])
    assert contact.channels == (0,)


@pytest.mark.slow
def test_pushes_do_not_move_the_parameters_and_free_motion_is_kept() -> None:
    """Three motions with pushes of 10 to 80 N, five more without."""
    found = summarize([measure(seed, True, seed < 103) for seed in range(100, 108)])
    assert found["false_in_free"] == 0
    assert found["false_in_touched"] == 0
    assert found["refused"] == 0
    assert all(hits == made for hits, made in found["pushes"].values())
    error = found["error"]
    assert error["left_out"]["rms"] < 2.0 * error["free"]["rms"]
    assert error["kept"]["rms"] > 5.0 * error["free"]["rms"]
