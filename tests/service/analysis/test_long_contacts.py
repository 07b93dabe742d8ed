"""Contacts that last for minutes: a dataset has them whole, wherever its recordings are cut."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from contactsense import Scene, WrenchSensor, forward_model
from contactsense.robots.tool import Tool
from contactsense.runtime.block_runner import MAX_BLOCK
from contactsense.service.analysis import analysis
from contactsense.service.analysis.analysis import AnalysisRun
from contactsense.service.analysis.fleet import segments
from contactsense.service.analysis.fleet.run import analyze_fleet
from contactsense.service.analysis.followed_rows import FollowedRows
from contactsense.service.analysis.present_sensors import without_sensors
from contactsense.service.analysis.samples import contact_history
from contactsense.service.recordings import RecordingFile, read
from contactsense.service.recordings.export import write_columns

RATE = 50.0
"""Samples per second."""
Q = np.array([0.3, -1.3, 1.6, -1.9, -1.57, 0.0])


def _write(path: Path, seconds: float, *held: tuple[float, float], impact: float = 20.0) -> Path:
    """An arm at rest whose forearm somebody pushes with 20 N from one time to the other [s], with `impact`
    [N] for the first 0.4 s."""
    scene, chance, t = Scene(robot="ur5e"), np.random.default_rng(0), np.arange(0.0, seconds, 1.0 / RATE)
    free, touched = (
        forward_model(scene, Q, "forearm", np.array([-0.2, 0.0, 0.06]), np.array([0.0, 0.0, -force]))
        for force in (0.0, 1.0)
    )
    force = np.zeros((len(t), 1))
    for begin, end in held:
        force[(begin <= t) & (t < end)] = 20.0
        force[(begin <= t) & (t < begin + 0.4)] = impact
    columns = {"timestamp": t}
    for name, noise in (("base_wrench", np.repeat([0.25, 0.05], 3)), ("joint_torque", np.full(6, 0.3))):
        values = getattr(free, name) + force * (getattr(touched, name) - getattr(free, name))
        values = values + noise * chance.standard_normal(values.shape)
        columns |= {f"{name}_{i}": values[:, i] for i in range(6)}
    columns |= {f"actual_q_{i}": np.full(len(t), Q[i]) for i in range(6)}
    columns |= {f"actual_qd_{i}": np.zeros(len(t)) for i in range(6)}
    write_columns(path, columns)
    return path


def test_reading_ends_with_the_contacts_of_the_part(tmp_path: Path) -> None:
    """Not with one that begins later, and not before problems of the whole file are known."""
    scene = Scene(robot="ur5e", wrist_wrench=WrenchSensor(), tool=Tool(name="gripper"))
    file = RecordingFile(_write(tmp_path / "a.parquet", 600.0, (10.0, 15.0), (30.0, 590.0)), scene)
    run = AnalysisRun(without_sensors(scene, frozenset({"wrist_wrench"})))
    (contact,) = run.contacts(FollowedRows(file, 0, 0, 600))
    assert contact.complete
    assert contact.row == pytest.approx(10.0 * RATE, abs=5)
    assert run.extent.samples <= MAX_BLOCK + 600 < 600.0 * RATE
    assert [problem.kind for problem in run.extent.problems] == ["missing_sensor"]


def test_the_beginning_of_a_long_contact_is_not_forgotten(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each time that memory was full every other sample was dropped, also of those that had been thinned out
    before: after minutes the impact was missing, and the last seconds counted as much as all before."""
    monkeypatch.setattr(analysis, "MAX_BLOCK", 250)
    path = _write(tmp_path / "a.parquet", 120.0, (10.0, 110.0), impact=80.0)
    recording = read(path, Scene(robot="ur5e"))
    assert recording.base_wrench is not None
    recording.base_wrench[(recording.t >= 90.0) & (recording.t < 110.0)] = np.nan
    found = []
    for most in (30_000, 500):
        monkeypatch.setattr(contact_history, "MAX_SAMPLES", most)
        (contact,) = AnalysisRun(Scene(robot="ur5e"), smooth=False).contacts(recording)
        found.append(contact)
    whole, thinned = found
    assert whole.transient_force == pytest.approx(80.0, abs=5.0)
    assert whole.silent == pytest.approx(20.0, abs=0.2)
    for name in ("row", "row_end", "begin", "duration", "peak_force", "transient_force", "energy"):
        assert getattr(thinned, name) == getattr(whole, name), name
    assert thinned.quasi_static_force == whole.quasi_static_force
    assert thinned.silent == pytest.approx(whole.silent, rel=0.02)
    assert thinned.impulse == pytest.approx(whole.impulse, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(
    "held",
    [
        [(70.0, 180.0), (181.0, 190.0)],
        [(0.0, 150.0)],  # from the first sample on
    ],
)
def test_a_long_contact_is_one_wherever_the_recording_is_cut(
    tmp_path: Path, held: list[tuple[float, float]]
) -> None:
    path, scene = _write(tmp_path / "a.parquet", 220.0, *held), tmp_path / "scene.yaml"
    scene.write_text("robot: ur5e\n")
    whole, cut = (
        analyze_fleet((path,), scene, tmp_path / f"{length}", length=length) for length in (600.0, 31.0)
    )
    for found in (whole, cut):
        rows = found.contacts.to_pylist()
        assert [row["complete"] for row in rows] == len(held) * [True]
        for row, (begin, end) in zip(rows, held, strict=True):
            assert row["link"] == "forearm"
            assert row["begin"] == pytest.approx(begin, abs=0.15)
            assert row["begin"] + row["duration"] == pytest.approx(end, abs=0.15)
            assert row["peak_force"] == pytest.approx(20.0, abs=1.0)
        assert found.robots[0].touched == whole.robots[0].touched
        assert found.problems == whole.problems == ()


@pytest.mark.slow
def test_a_contact_that_is_longer_than_is_looked_back_does_not_raise_doubts_of_the_scene(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its middle segments begin while it acts, and no free sample before them is read."""
    monkeypatch.setattr(segments, "REACH", 65.0)
    path, scene = _write(tmp_path / "a.parquet", 300.0, (20.0, 280.0)), tmp_path / "scene.yaml"
    scene.write_text("robot: ur5e\n")
    found = analyze_fleet((path,), scene, tmp_path / "out", length=60.0)
    first = found.contacts.to_pylist()[0]
    assert (first["link"], first["complete"]) == ("forearm", True)
    assert first["begin"] + first["duration"] == pytest.approx(280.0, abs=0.15)
    assert found.problems == ()


def test_a_clock_that_is_set_back_ends_no_handover_early() -> None:
    """Contacts that begin within a second after the own rows are kept, whatever the clock does."""
    part = FollowedRows(SimpleNamespace(name="r"), 0, 0, 100)  # type: ignore[arg-type]
    part.pass_block(np.arange(100), 0.01 * np.arange(100))
    part.pass_block(np.arange(100, 150), 0.01 * np.arange(100, 150) - 0.9)
    assert part.keeps(149)
    part.pass_block(np.arange(150, 300), 0.01 * np.arange(150, 300) - 0.9)
    assert part.keeps(190)
    assert not part.keeps(210)
