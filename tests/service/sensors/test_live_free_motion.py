"""A live arm is read for some time, also where its controller is restarted meanwhile."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from contactsense import Sample, Scene
from contactsense.calibration import FreeMotion
from contactsense.service.sensors import live_free_motion
from contactsense.service.sensors.live_free_motion import read_live_motion
from contactsense.service.sensors.source_settings import SourceSettings

SCENE = Scene.model_validate({"robot": "ur5e", "base_wrench": None})
DT = 0.01


def read_at(stamps: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> tuple[FreeMotion, list[float]]:
    """One second of a robot with samples at these times, and the progress."""
    left = [[Sample(float(t), np.full(6, t), np.zeros(6), np.ones(6))] for t in stamps]

    class Robot:
        def poll(self, timeout: float) -> list[Sample]:
            return left.pop(0)

    @contextmanager
    def opened(*_: object) -> Iterator[Robot]:
        yield Robot()

    monkeypatch.setattr(live_free_motion, "LiveSource", opened)
    read: list[float] = []
    return read_live_motion(SCENE, SourceSettings("robot"), 1.0, read.append), read


def test_a_restarted_controller_begins_the_recording_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its clock begins at zero, and would reach the time of before after days only."""
    stamps = np.concatenate((1e5 + DT * np.arange(50), DT * np.arange(150)))
    motion, read = read_at(stamps, monkeypatch)
    assert motion.seconds == pytest.approx(1.0)
    assert motion.t[0] == 0.0
    np.testing.assert_array_equal(motion.q[:, 0], motion.t)
    assert min(read) == 0.0


def test_an_outage_is_no_time_that_was_read(monkeypatch: pytest.MonkeyPatch) -> None:
    stamps = DT * np.arange(300)
    stamps[20:] += 9.0
    motion, read = read_at(stamps, monkeypatch)
    assert (np.diff(read) > 0.0).all()
    assert len(motion.t) == pytest.approx(1.0 / DT, abs=6)
    assert np.diff(motion.t).max() == pytest.approx(9.0 + DT)
