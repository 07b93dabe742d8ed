"""The stream pauses for minutes: what is known of biases outlasts it, and a touch at its end is none."""

from dataclasses import replace

import numpy as np
import pytest

from contactsense import Estimate, Localizer
from tests.contactsense.tracking.test_resumed_contact import START, Push, plain_scene, pushed_arm

LONG = Push(0.0, 1.0, (0.0, -30.0, 0.0))


@pytest.fixture(scope="module")
def localizer() -> Localizer:
    return Localizer(plain_scene())


def _estimates(localizer: Localizer, paused: float, gap: float) -> list[Estimate]:
    """The stream pauses `paused` seconds after the push has begun, for `gap` seconds."""
    samples = pushed_arm((LONG,), seconds=2.5)
    pause = START + paused
    localizer.reset()
    return [localizer.step(replace(s, t=s.t + gap) if s.t > pause else s) for s in samples]


@pytest.mark.parametrize("gap", [20.0, 300.0, 2000.0])
@pytest.mark.parametrize("paused", [-0.002, 0.4])
def test_a_touch_at_the_end_of_a_pause_is_no_bias(localizer: Localizer, paused: float, gap: float) -> None:
    estimates = _estimates(localizer, paused, gap)
    held = [e for e in estimates if START + 0.55 < e.t - gap < START + 0.8]
    assert len(held) > 100
    for estimate in held:
        assert estimate.contacts[0].link == "forearm", estimate.t
    after = [e for e in estimates if e.t - gap > START + 1.3]
    assert {e.status for e in after} == {"none"}
    force, torque = localizer.biases
    assert np.abs(force[:3]).max() < 0.5
    assert np.abs(torque).max() < 1.0


def test_what_is_detectable_is_so_after_a_pause(localizer: Localizer) -> None:
    """Biases have wandered in the meantime, by as much as they do in samples."""
    usual, *after = (
        next(e.detectable for e in _estimates(localizer, 0.4, gap) if e.t - gap > START + 0.6)
        for gap in (0.0, 60.0, 3600.0)
    )
    assert after[0] < 1.2 * usual
    assert after[1] < 3.0 * usual
