"""A recording of known contacts through `analyze`."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pa_parquet
import pytest

from contactsense import Localizer, Scene
from contactsense.plausibility.stream_start import FROM_START
from contactsense.service.analysis import Analysis, ForceLimits, LimitsError, analyze
from contactsense.service.analysis.contact_table import SCHEMA, write_contacts
from contactsense.service.analysis.health import health, warning
from contactsense.service.analysis.summary.summarize import Summarizer
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.arm.simulated_arm import simulate
from contactsense.service.recordings import Recording, read
from tests.contactsense.plausibility.test_stream_start import RIGHT, stream
from tests.service.analysis.recordings import demo, write_motion

SCENE = Scene(robot="ur5e")


@pytest.fixture(scope="module")
def analysis(tmp_path_factory: pytest.TempPathFactory) -> Analysis:
    path = write_motion(demo(), tmp_path_factory.mktemp("recordings") / "demo.parquet")
    return analyze(path, SCENE, estimates=True)


def test_every_contact_of_the_recording_is_found_where_it_was(analysis: Analysis) -> None:
    motion = demo()
    assert [contact.link for contact in analysis.contacts] == [touch.link for touch in motion.touches]
    for contact, touch in zip(analysis.contacts, motion.touches, strict=True):
        assert contact.begin == pytest.approx(touch.start, abs=0.2)
        assert contact.begin + contact.duration == pytest.approx(touch.stop, abs=0.3)
        assert np.linalg.norm(contact.point - touch.point_link) < 0.03
        force = np.linalg.norm(touch.force_base, axis=1)
        assert contact.peak_force == pytest.approx(force.max(), rel=0.15)
        assert contact.impulse == pytest.approx(np.trapezoid(force, dx=1 / motion.rate), rel=0.1)
        assert contact.complete
        moves = np.abs(motion.qd[touch.first]).max() > 0.0
        assert (contact.speed > 1e-3) == moves
        assert np.linalg.eigvalsh(contact.covariance).min() > -1e-15
        at = int(contact.peak_time * motion.rate)
        np.testing.assert_allclose(contact.q, motion.q[at], atol=0.01)


def test_a_contact_carries_the_rows_of_the_file_and_the_place_at_its_peak(analysis: Analysis) -> None:
    motion = demo()
    for contact, touch in zip(analysis.contacts, motion.touches, strict=True):
        assert motion.t[contact.row] == pytest.approx(contact.begin)
        at = round(contact.peak_time * motion.rate) - touch.first
        assert np.linalg.norm(contact.point_base - touch.point_base[at]) < 0.03
        assert repr(contact).startswith(f"<contact {contact.contact} at ")


@pytest.mark.parametrize("link", [2, 3, 6, 7])
def test_speed_of_a_point_of_a_link(link: int) -> None:
    """From two poses; joints beyond the link move it no more than the tool's frame, 7, moves itself."""
    summarizer, point = Summarizer(SCENE), np.array([0.1, -0.05, 0.2])
    q, qd = np.array([0.2, -1.1, 1.3, -0.8, -1.2, 0.5]), np.array([0.4, -0.3, 0.7, 1.1, -0.9, 2.0])
    step = 1e-6
    (origin, rotation), (later, turned) = (summarizer.link_pose(q + t * qd, link) for t in (-step, step))
    moved = later + turned @ point - origin - rotation @ point
    assert summarizer.speed(q, qd, link, point) == pytest.approx(
        np.linalg.norm(moved) / (2.0 * step), rel=1e-6
    )


def test_residuals_are_as_large_as_their_noise(analysis: Analysis) -> None:
    found = analysis.residuals
    assert found.free + found.touched <= analysis.samples
    assert np.all(found.base_ratio < 1.3)
    assert np.all(found.joint_ratio < 1.3)
    assert len(found.t) == len(found.energy) == len(found.joint_torque)
    assert found.missing[:2] == (0, 0)
    assert "free" in repr(found)


def test_a_scene_that_contradicts_the_recording_is_named(tmp_path: Path) -> None:
    path = write_motion(demo(), tmp_path / "part.parquet", last=500)
    found = analyze(path, Scene(robot="ur5e", mounting="ceiling"))
    assert any("base_wrench: expected the weight" in problem for problem in found.problems)
    assert any(not well and "base_wrench.sign" in text for well, text in health(found))


def test_estimates_of_every_sample_are_those_of_the_localizer(analysis: Analysis, tmp_path: Path) -> None:
    path = write_motion(demo(), tmp_path / "part.parquet", last=3000)
    table = analysis.estimates
    assert table is not None
    assert table.num_rows == analysis.samples
    links = table["link"].to_pylist()[:3000]
    estimates = list(Localizer(SCENE).run(read(path, SCENE).samples()))
    assert links == [estimate.contacts[0].link if estimate.contacts else None for estimate in estimates]


def test_what_is_no_recording_and_what_is_no_scene_is_told(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match=r"scene: expected a Scene, .*, got 'scene\.yaml'"):
        analyze(tmp_path / "a.csv", "scene.yaml")  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=r"scene: expected a Scene, .*, got 'scene\.yaml'"):
        read(tmp_path / "a.csv", "scene.yaml")  # type: ignore[arg-type]
    with pytest.raises(
        TypeError, match=r"recording: expected a Recording, .* or the path of a file, got dict"
    ):
        analyze({}, Scene(robot="ur5e"))  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="path: expected that of a file, got dict"):
        read({}, Scene(robot="ur5e"))  # type: ignore[arg-type]


def test_what_belongs_to_another_scene_or_is_of_another_type_is_told(tmp_path: Path) -> None:
    path = write_motion(demo(), tmp_path / "part.parquet", last=100)
    wall = Localizer(Scene(robot="ur5e", mounting="wall"))
    with pytest.raises(ValueError, match="localizer: expected one of the same scene"):
        analyze(path, SCENE, localizer=wall)
    with pytest.raises(TypeError, match=r"limits: expected ForceLimits, .* got \{'hand': 100\}"):
        analyze(path, SCENE, limits={"hand": 100})  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=r"columns: expected a ColumnMapping, .* got \{'q': 'joint'\}"):
        read(path, SCENE, {"q": "joint"})  # type: ignore[arg-type]


def test_the_table_is_written_as_parquet_and_csv(analysis: Analysis, tmp_path: Path) -> None:
    write_contacts(analysis.to_arrow(), tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["contacts.csv", "contacts.parquet"]
    table = pa_parquet.read_table(tmp_path / "contacts.parquet")
    assert table.schema == SCHEMA
    assert table.equals(analysis.to_arrow())
    for name, i, k in (("xy", 0, 1), ("yz", 1, 2), ("zz", 2, 2)):
        expected = [contact.covariance[i, k] for contact in analysis.contacts]
        assert table[f"covariance_{name}"].to_pylist() == expected
    text = pa_csv.read_csv(tmp_path / "contacts.csv")
    assert text.column_names == table.column_names
    assert text["link"].to_pylist() == table["link"].to_pylist()


def test_a_recording_that_ends_in_a_contact_tells_so(tmp_path: Path) -> None:
    touch = demo().touches[0]
    path = write_motion(demo(), tmp_path / "cut.csv", last=touch.first + 300)
    (contact,) = analyze(path, SCENE).contacts
    assert not contact.complete
    assert contact.link == touch.link


def test_forces_are_compared_with_the_users_own_limits(analysis: Analysis, tmp_path: Path) -> None:
    path = tmp_path / "limits.yaml"
    path.write_text(
        "provenance: our own risk assessment\n"
        "regions:\n"
        "  - {name: hand, quasi_static: 1000, transient: 22}\n"
        "  - {name: face, quasi_static: 22, transient: 1000}\n"
    )
    limits = ForceLimits.load(path)
    texts = [limits.exceeded(contact) for contact in analysis.contacts]
    for contact, found in zip(analysis.contacts, texts, strict=True):
        expected = int(contact.transient_force > 22) + int(contact.quasi_static_force > 22)
        assert len(found) == expected
    assert any("face" in found[-1] and "quasi-static" in found[-1] for found in texts if found)
    # Each kind of force has its own limit.
    short = replace(analysis.contacts[0], transient_force=30.0, quasi_static_force=10.0)
    assert limits.exceeded(short) == ["hand: 30.0 N above 22 N (transient)"]
    long = replace(analysis.contacts[0], transient_force=10.0, quasi_static_force=30.0)
    assert limits.exceeded(long) == ["face: 30.0 N above 22 N (quasi-static)"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("regions: []", "provenance: expected a value, the field is missing"),
        ("[1]", "expected fields such as `regions:`, got [1]"),
        ("provenance: x\nregions: [{name: hand, quasi_static: -1, transient: 2}]", "regions[0].quasi_static"),
        (
            "provenance: x\nregions: [{name: hand, quasi_static: yes, transient: 2}]",
            "regions[0].quasi_static: expected a number, got true",
        ),
        ("a: [", "not YAML"),
    ],
)
def test_wrong_limits_are_named(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "limits.yaml"
    path.write_text(text)
    with pytest.raises(LimitsError, match=r"limits\.yaml") as caught:
        ForceLimits.load(path)
    assert message in str(caught.value)


@pytest.mark.slow
def test_a_file_block_by_block_gives_what_the_whole_recording_gives(tmp_path: Path) -> None:
    path = write_motion(demo(), tmp_path / "demo.parquet", rounds=6)
    table = pa_parquet.read_table(path)
    table = pa.concat_tables([table.slice(0, 40_000), table.slice(40_500)])
    pa_parquet.write_table(table, path)
    whole, file = analyze(read(path, SCENE), SCENE), analyze(path, SCENE)
    assert file.to_arrow().equals(whole.to_arrow())
    assert len(file.contacts) > 40
    assert (
        (file.samples, file.start, file.gaps) == (whole.samples, whole.start, whole.gaps) == (77_500, 0.0, 1)
    )
    assert file.duration == pytest.approx(whole.duration)
    assert file.problems == whole.problems
    np.testing.assert_array_equal(file.residuals.joint_ratio, whole.residuals.joint_ratio)
    assert 600 <= len(file.residuals.t) <= 1200
    assert np.all(np.diff(file.residuals.t) > 0.0)
    for name in ("energy", "base_force", "joint_torque", "joint_torque_std"):
        np.testing.assert_array_equal(
            getattr(file.residuals, name).max(axis=0), getattr(whole.residuals, name).max(axis=0)
        )


_MEMORY = """
import sys
from contactsense import Scene
from contactsense.service.analysis import analyze
found = analyze(sys.argv[1], Scene(robot="ur5e"), smooth=False)
# getrusage counts what the process that started this one had in memory, too.
status = dict(line.split(":", 1) for line in open("/proc/self/status"))
print(found.samples, int(status["VmHWM"].split()[0]) // 1024)
"""


@pytest.mark.long
def test_memory_does_not_grow_with_the_length(tmp_path: Path) -> None:
    free = simulate(Script.demo().model_copy(update={"contacts": ()}))
    part = pa_parquet.read_table(write_motion(free, tmp_path / "part.parquet", rounds=10))
    at = part.schema.get_field_index("timestamp")
    megabytes = []
    for parts in (1, 10):
        path = tmp_path / f"{parts}.parquet"
        with pa_parquet.ParquetWriter(path, part.schema) as writer:
            for i in range(parts):
                t = part["timestamp"].to_numpy() + i * 260.0
                writer.write_table(part.set_column(at, "timestamp", pa.array(t)))
        run = subprocess.run(
            [sys.executable, "-c", _MEMORY, str(path)], check=True, capture_output=True, text=True
        )
        samples, used = map(int, run.stdout.split())
        assert samples == 130_000 * parts
        megabytes.append(used)
    # Samples of 43 minutes are some 240 MB.
    assert megabytes[1] < megabytes[0] + 100
    assert megabytes[1] < 1000


def test_a_recording_that_never_fits_a_free_arm_accuses_the_scene() -> None:
    samples = stream(300)
    rows = [np.array([getattr(x, name) for x in samples]) for name in ("t", "q", "qd")]
    torque, base = (np.array([getattr(x, name) for x in samples]) for name in ("joint_torque", "base_wrench"))
    recording = Recording("free.csv", *rows, torque, base, None, np.arange(300))
    assert analyze(recording, RIGHT).problems == ()
    tilted = RIGHT.model_copy(update={"mounting": (0.0, 0.15, 0.0)})
    found = analyze(recording, tilted, smooth=False)
    assert found.problems == (FROM_START,)
    assert (False, FROM_START) in health(found)


def test_a_sensor_that_starts_during_a_contact_does_not_accuse_the_scene(tmp_path: Path) -> None:
    """While its observer settles, its residual is neither used nor without contact."""
    motion = demo()
    touch = next(touch for touch in motion.touches if touch.link == "base")  # which torques do not measure
    begin = touch.first - 200
    path = write_motion(motion, tmp_path / "part.parquet", first=begin, last=begin + 5000)
    table = pa_parquet.read_table(path)
    late = np.arange(len(table)) < 500
    for i in range(6):
        name = f"base_wrench_{i}"
        values = np.where(late, np.nan, table[name].to_numpy())
        table = table.set_column(table.schema.get_field_index(name), name, pa.array(values))
    pa_parquet.write_table(table, path)
    found = analyze(path, SCENE)
    assert found.contacts[0].link == touch.link
    assert np.all(found.residuals.base_ratio < 1.3)
    assert np.all(found.residuals.joint_ratio < 1.3)
    assert not warning(found)


def test_recordings_of_ten_samples_a_second(tmp_path: Path) -> None:
    """The contacts are found, and the report says what such a rate cannot tell."""
    motion = demo()
    path = write_motion(motion, tmp_path / "demo.parquet")
    pa_parquet.write_table(pa_parquet.read_table(path).take(np.arange(0, len(motion.t), 50)), path)
    found = analyze(path, SCENE)
    assert [contact.link for contact in found.contacts] == [touch.link for touch in motion.touches]
    assert not warning(found)
    assert any(text.startswith("Samples are 0.1 s apart") for well, text in health(found) if not well)


def test_a_clock_that_jumps_ahead_does_not_make_the_rate_low(tmp_path: Path) -> None:
    """1000 s within the recording: its samples seemed 0.5 s apart, and a higher rate was asked for."""
    path = write_motion(demo(), tmp_path / "demo.parquet", last=2000)
    table = pa_parquet.read_table(path)
    times = table["timestamp"].to_numpy() + np.where(np.arange(2000) < 1000, 0.0, 1000.0)
    pa_parquet.write_table(
        table.set_column(table.column_names.index("timestamp"), "timestamp", [times]), path
    )
    found = analyze(path, SCENE)
    assert found.step == pytest.approx(0.002)
    assert found.duration > 1000.0
    assert not [text for _, text in health(found) if "apart" in text]


@pytest.mark.slow
@pytest.mark.parametrize("as_file", [True, False])
def test_a_recording_without_a_sensor_is_analysed_as_if_the_scene_had_none(
    tmp_path: Path, as_file: bool
) -> None:
    """Places and forces are smoothed, not those of single live estimates."""
    path = write_motion(demo(), tmp_path / "whole.parquet", last=4500)
    table = pa_parquet.read_table(path)
    pa_parquet.write_table(table.drop_columns([f"base_wrench_{i}" for i in range(6)]), path)
    torques = Scene(robot="ur5e", base_wrench=None)
    stated = Scene(robot="ur5e", picks_up=True)
    found, expected = (analyze(path if as_file else read(path, scene), scene) for scene in (stated, torques))
    assert len(found.contacts) == len(expected.contacts) >= 2
    for one, other in zip(found.contacts, expected.contacts, strict=True):
        assert one.smoothed == other.smoothed
        assert one.link == other.link
        assert one.peak_force == pytest.approx(other.peak_force)
        np.testing.assert_allclose(one.point, other.point)
    assert found.residuals.free == expected.residuals.free > 0
    assert found.scene.base_wrench is None
    assert any("base_wrench is not used" in problem for problem in found.problems)
