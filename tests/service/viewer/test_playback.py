"""Playback: the localizer's own answers at the same samples, and everything that happened."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pa_parquet
import pytest

from contactsense import Estimate, Localizer, Scene
from contactsense.service.recordings import RecordingError, RecordingFile
from contactsense.service.recordings.export import write_columns
from contactsense.service.viewer.frame import forces_of
from contactsense.service.viewer.playback import Playback
from tests.service.analysis.recordings import demo, write_motion


@pytest.fixture(scope="module")
def localizer() -> Localizer:
    return Localizer(Scene(robot="ur5e"))


def assert_same(found: Estimate, expected: Estimate) -> None:
    assert (found.t, found.status, found.reason) == (expected.t, expected.status, expected.reason)
    assert found.other == expected.other
    assert found.events == expected.events
    for name in ("link_probability", "wrench", "covariance"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
    assert len(found.contacts) == len(expected.contacts)
    for one, other in zip(found.contacts, expected.contacts, strict=True):
        assert (one.link, one.probability, one.id, one.phase) == (
            other.link, other.probability, other.id, other.phase,
        )  # fmt: skip
        for name in ("point", "point_base", "normal_base", "force_base", "covariance"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    if found.status == "none" and np.isfinite(expected.detectable):
        # `step` keeps the value for 64 samples, a block for all of its samples.
        assert found.detectable == pytest.approx(expected.detectable, rel=0.2)
    elif found.status == "degraded":
        assert found.detectable >= expected.detectable


def test_frames_are_the_answers_of_the_localizer(tmp_path: Path, localizer: Localizer) -> None:
    path = write_motion(demo(), tmp_path / "demo.parquet", last=3000)
    recording = RecordingFile(path, localizer.scene).read()
    estimates = list(localizer.run(recording.samples()))
    playback = Playback.open(localizer.scene, path, localizer=localizer)
    assert playback.duration == pytest.approx(recording.t[-1] - recording.t[0])
    touched = 0
    for i in range(0, len(recording), 10):
        frame = playback.at(float(recording.t[i] - recording.t[0]) + 1e-4)
        assert frame.estimate is not None
        assert frame.q is not None
        assert_same(frame.estimate, estimates[i])
        np.testing.assert_array_equal(frame.q, recording.q[i])
        touched += len(frame.estimate.contacts)
    assert touched > 50
    expected = [(e.kind, e.contact, e.link) for estimate in estimates for e in estimate.events]
    assert [(e.kind, e.contact, e.link) for e in playback.events] == expected
    assert {kind for kind, _, _ in expected} >= {"onset", "release"}


def test_the_frame_of_an_event_is_kept(tmp_path: Path, localizer: Localizer) -> None:
    path = write_motion(demo(), tmp_path / "demo.parquet", last=3000)
    playback = Playback.open(localizer.scene, path, localizer=localizer)
    for event in playback.events:
        frame = playback.at(event.t)
        assert frame.estimate is not None
        assert event.kind in {each.kind for each in frame.estimate.events}


def test_forces_of_the_last_ten_seconds(tmp_path: Path, localizer: Localizer) -> None:
    path = write_motion(demo(), tmp_path / "demo.parquet", last=6000)
    playback = Playback.open(localizer.scene, path, localizer=localizer)
    frame = playback.at(11.5)
    assert frame.forces.t[-1] == pytest.approx(11.5, abs=0.021)
    assert frame.forces.t[0] == pytest.approx(1.5, abs=0.021)
    assert (np.diff(frame.forces.t) > 0.0).all()
    for k in range(0, len(frame.forces.t), 25):
        estimate = playback.at(float(frame.forces.t[k])).estimate
        assert estimate is not None
        np.testing.assert_allclose(frame.forces.force[k], forces_of(estimate), rtol=1e-6)
    assert frame.forces.force.any()


def test_what_is_wrong_with_the_file_is_kept(tmp_path: Path, localizer: Localizer) -> None:
    path = write_motion(demo(), tmp_path / "demo.parquet", last=500)
    assert Playback.open(localizer.scene, path, localizer=localizer).problems == ()
    table = pa_parquet.read_table(path)
    pa_parquet.write_table(table.take([i for i in range(500) if not 200 <= i < 250]), path)
    (problem,) = Playback.open(localizer.scene, path, localizer=localizer).problems
    assert "a gap of 0.102 s" in problem


def test_times_beyond_the_ends_show_the_ends(tmp_path: Path, localizer: Localizer) -> None:
    playback = Playback.open(
        localizer.scene, write_motion(demo(), tmp_path / "demo.parquet", last=500), localizer=localizer
    )
    for time, end in ((-5.0, 0.0), (99.0, 0.98)):
        frame = playback.at(time)
        assert frame.estimate is not None
        assert frame.estimate.t == pytest.approx(end, abs=1e-9)


def test_faults_of_a_recording(tmp_path: Path, localizer: Localizer) -> None:
    """A silent sensor, samples that cannot be used, a clock that is reset."""
    motion = demo()
    q, wrench, t = motion.q[:1400].copy(), motion.base_wrench[:1400].copy(), np.arange(1400) / 500.0
    wrench[700:800] = np.nan
    q[900:905, 2] = np.nan
    t[1000:] -= 1.0
    columns = {"timestamp": t}
    parts = (("actual_q", q), ("actual_qd", motion.qd), ("joint_torque", motion.joint_torque))
    for name, values in (*parts, ("base_wrench", wrench)):
        columns |= {f"{name}_{i}": values[:1400, i] for i in range(6)}
    path = tmp_path / "faults.parquet"
    write_columns(path, columns)
    playback = Playback.open(localizer.scene, path, localizer=localizer)
    assert playback.duration == pytest.approx(1399 / 500.0 - 1 / 500.0, abs=0.003)
    silent, unusable, after = (playback.at(i / 500.0).estimate for i in (750, 901, 1350))
    assert silent is not None
    assert unusable is not None
    assert after is not None
    assert (silent.status, silent.reason) == ("degraded", "base_wrench is missing")
    assert playback.at(901 / 500.0).q is None
    assert (unusable.status, "not used" in unusable.reason) == ("degraded", True)
    # On the robot's clock, which has been set back.
    assert after.t == pytest.approx(1.7, abs=0.021)


def test_a_file_that_cannot_be_played(tmp_path: Path, localizer: Localizer) -> None:
    with pytest.raises(RecordingError, match="nothing"):
        Playback.open(localizer.scene, tmp_path / "nothing.parquet", localizer=localizer)
    path = write_motion(demo(), tmp_path / "demo.parquet", last=20)
    done: list[int] = []
    Playback.open(localizer.scene, path, localizer=localizer, progress=done.append)
    assert sum(done) == 20
