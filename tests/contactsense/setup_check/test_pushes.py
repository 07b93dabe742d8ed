"""Pushes on the arm are no wrong line of the scene: they are left out, and named."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import Scene
from contactsense.benchmarks.calibration.setup_draws import Settings, cell, recorded
from contactsense.benchmarks.calibration.simulate import Push
from contactsense.calibration import FreeMotion, SuspectedContact
from contactsense.calibration.contact_free_fit import TooMuchContactError
from contactsense.setup_check import check, recorded_contacts

PUSHES = (
    Push(5, (0.0, 0.05, 0.0), (10.0, -35.0, 15.0), 2.5, 3.5),
    Push(3, (0.0, 0.0, 0.1), (0.0, 60.0, 40.0), 6.0, 7.2),
)
MOTION = Settings(seconds=15.0)


def pushed(pushes: tuple[Push, ...], settings: Settings) -> tuple[Scene, FreeMotion]:
    rng = np.random.default_rng(5)
    truth = cell("ur5e", rng)
    return truth, recorded(truth, rng, settings, pushes)


@pytest.mark.slow
@pytest.mark.parametrize(
    "settings", [MOTION, pytest.param(Settings(seconds=20.0, postures=5), marks=pytest.mark.long)]
)
def test_a_right_scene_fits_a_motion_with_pushes(settings: Settings) -> None:
    scene, part = pushed(PUSHES, settings)
    found = check(scene, [part])
    # They are looked for only where no lines explain the readings.
    assert found.fits
    assert found.contacts_left_out
    for push, contact in zip(PUSHES, found.contacts, strict=True):
        assert contact.start < push.start < push.stop < contact.stop
    # Samples that are no contact-free motion are not used in the first place.
    t = part.t - part.t[0]
    free = np.all([(t < push.start - 0.3) | (t > push.stop + 0.3) for push in PUSHES], axis=0)
    known = check(scene, [replace(part, free=free)])
    assert known.fits
    assert known.contacts == ()


@pytest.mark.long
def test_a_wrong_line_is_named_beside_pushes() -> None:
    scene, part = pushed(PUSHES, MOTION)
    roll, pitch, yaw = map(float, scene.mounting)
    wrong = scene.model_copy(update={"mounting": (-roll, pitch, yaw)})
    found = check(wrong, [part])
    assert [item.line for item in found.wrong] == ["mounting"]
    assert found.contacts
    # What does not fit throughout the motion is no push.
    alone = check(wrong, [pushed((), MOTION)[1]])
    assert [item.line for item in alone.wrong] == ["mounting"]
    assert alone.contacts == ()


@pytest.mark.slow
def test_pushes_that_last_too_long_are_named_and_not_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    contact = SuspectedContact("free.csv", 1.0, 7.0, 125, 875, (0,), (40.0,))

    def refused(*_: object) -> None:
        raise TooMuchContactError("expected motion without contact", (contact,))

    monkeypatch.setattr(recorded_contacts, "fit_without_contacts", refused)
    often = tuple(replace(PUSHES[1], start=t, stop=t + 1.6) for t in (1.0, 3.4, 5.8))
    scene, part = pushed(often, Settings(seconds=8.0))
    found = check(scene, [part])
    assert found.unexplained
    assert found.contacts == (contact,)
    assert not found.contacts_left_out
