"""`contactsense view` tells in one line what it cannot show; contacts of an analysis."""

import contextlib
import signal
import socket
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow.csv as pa_csv
import pyarrow.parquet as pa_parquet
import pytest
from click.testing import CliRunner

from contactsense.scene import Scene
from contactsense.service.analysis.contact_table import contact_table, write_contacts
from contactsense.service.analysis.summary.contact_summary import ContactSummary
from contactsense.service.cli.analyze import analyze
from contactsense.service.cli.lazy import missing
from contactsense.service.cli.view import view
from contactsense.service.recordings import RecordingError
from contactsense.service.recordings.metadata import metadata
from contactsense.service.viewer.analysis_source import AnalysisSource, is_analysis, tables_instead
from contactsense.service.viewer.viewer import Viewer, serve_page
from tests.service.analysis.recordings import demo, write_motion
from tests.service.viewer.estimates import POSTURE, contact

SCENE = Scene(robot="ur5e")


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (
            ("--url", "localhost:8000"),
            "--url: expected one such as http://127.0.0.1:8000, got 'localhost",
        ),
        (("--url", "http://nowhere.invalid"), "http://nowhere.invalid cannot be reached: "),
        (("nowhere.parquet",), "nowhere.parquet"),
        (("--scene", "nowhere.yaml"), "nowhere.yaml: cannot read the scene"),
        (("--token-file", "nowhere"), "--token-file: nowhere cannot be read: No such file or directory"),
        (("--url", ""), "--url: expected one such as"),
        (("a.parquet", "--url", "http://x"), "FILE: expected no --url, --token-file or --acknowledge"),
        (("--columns", "q=joint"), "--columns: expected FILE, a recording, beside it"),
        (("a.csv", "--columns", "foo=joint"), "column mapping: foo: unknown field"),
        (("--acknowledge", "--host", "0.0.0.0"), "--acknowledge: expected --host 127.0.0.1 beside it"),
    ],
)
def test_what_cannot_be_shown_is_told(
    arguments: tuple[str, ...], complaint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(view, [*arguments, "--port", "0"])
    assert result.exit_code in (1, 2)
    assert complaint in result.output
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_that_a_library_loses_is_one(
    number: signal.Signals, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The page was served, until somebody interrupted it again."""

    def interrupted(*_: object) -> SimpleNamespace:
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(number)
        return SimpleNamespace(problems=())

    recording, scene = write_motion(demo(), tmp_path / "run.parquet"), tmp_path / "scene.yaml"
    scene.write_text("robot: ur5e\n")
    monkeypatch.setattr("contactsense.service.cli.view.RecordedSource", interrupted)
    monkeypatch.setattr("contactsense.service.cli.view._page", lambda *_: pytest.fail("it is served"))
    former = signal.getsignal(number)
    result = CliRunner().invoke(view, [str(recording), "--scene", str(scene), "--port", "0"])
    assert isinstance(result.exception, SystemExit)
    assert result.output.endswith("Aborted!\n")
    assert signal.getsignal(number) is former


@pytest.mark.parametrize("arguments", [("cell.yaml",), ("cell.yaml", "--scene", "cell.yaml")])
def test_a_scene_is_no_recording(
    arguments: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was said to carry no scene."""
    monkeypatch.chdir(tmp_path)
    Path("cell.yaml").write_text("robot: ur5e\n")
    output = " ".join(CliRunner().invoke(view, arguments).output.split())
    assert "cell.yaml: expected a recording, got YAML" in output
    assert "`contactsense scene show` shows it" in output


def test_a_recording_with_other_names_is_read(tmp_path: Path) -> None:
    """What is missing is told with an option that the command has; then comes the page's address, as the
    estimates may take minutes."""
    written = write_motion(demo(), tmp_path / "demo.parquet", last=200)
    table = pa_parquet.read_table(written)
    names = [name.replace("actual_q_", "joint_") for name in table.column_names]
    pa_parquet.write_table(table.rename_columns(names), written)
    (tmp_path / "scene.yaml").write_text("robot: ur5e\n")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        arguments = [str(written), "--scene", str(tmp_path / "scene.yaml"), "--port", str(port)]
        assert "--columns q=NAME names another" in CliRunner().invoke(view, arguments).output
        read = CliRunner().invoke(view, [*arguments, "--columns", "q=joint"]).output
    assert "computed" not in read
    assert f"cannot serve at 127.0.0.1:{port}: Address already in use" in read


@pytest.mark.slow
def test_the_scene_of_an_analysis_is_found_from_anywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its table names the recording as seen from its folder; both may have been moved."""
    (tmp_path / "cell" / "days").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "cell")
    table = pa_parquet.read_table(write_motion(demo(), tmp_path / "a.parquet", last=2300))
    described = table.replace_schema_metadata(metadata(SCENE))
    pa_parquet.write_table(described, "days/Süd 1.parquet")
    done = CliRunner().invoke(analyze, ["days/Süd 1.parquet", "--out", "results"])
    assert done.exit_code == 0, done.output
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cell").rename(tmp_path / "moved")
    results = tmp_path / "moved" / "results"
    names = pa_parquet.read_table(results / "contacts.parquet")["recording"].to_pylist()
    assert set(names) == {"../days/Süd 1.parquet"}
    assert names == pa_csv.read_csv(results / "contacts.csv")["recording"].to_pylist()
    assert AnalysisSource(Path("moved/results/contacts.parquet"), None).scene.robot.name == "ur5e"


def test_the_missing_extra_is_named() -> None:
    command = "pip install '.[viewer]' in the folder of contactsense's sources"
    assert missing("view", "viser") == f"view needs viser: {command}"


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """The table of an analysis with two contacts."""
    found = []
    for number, link in ((1, 3), (2, 2)):
        push = contact(SCENE, POSTURE, link, np.array([-0.2, 0.05, 0.1 * number]), probability=0.75)
        shares = np.zeros(7)
        shares[[link, link + 1]] = 0.7, 0.2
        found.append(
            ContactSummary(
                "demo.parquet", 0, 9, number, 3.0 * number, 0.5, True, push.link, link, 0.75, shares,
                push.point, push.point_base, push.normal_base, push.covariance, push.force_base, 20.0,
                3.0 * number + 0.2, 20.0, 0.0, 8.0, 0.0, 0.1, False, 50.0, POSTURE,
            )
        )  # fmt: skip
    write_contacts(contact_table(found), tmp_path)
    return tmp_path / "contacts.parquet"


def test_the_folder_of_an_analysis_is_not_taken_for_a_recording(table: Path) -> None:
    for name in (table.parent, table.with_suffix(".csv")):
        result = CliRunner().invoke(view, [str(name)])
        assert result.exit_code == 1
        assert f"{name}: expected the table of the contacts, {table}" in result.output


def test_the_tables_of_several_analyses_are_named(table: Path, tmp_path: Path) -> None:
    """Where several recordings or a dataset were analysed, folders and reports are no recordings."""
    results, fleet = tmp_path / "results", tmp_path / "fleet"
    tables = [results / f"run{number}" / "contacts.parquet" for number in (1, 2, 3, 4)]
    part = fleet / "contacts" / "robot=a" / "date=unknown" / "part-0.parquet"
    for copy in (*tables, part):
        copy.parent.mkdir(parents=True)
        copy.write_bytes(table.read_bytes())
    named = " or ".join(map(str, tables[:3]))
    expected = {
        results: f"expected one table of contacts, {named} or 1 other",
        tables[0].with_name("report.html"): f"expected the table of the contacts, {tables[0]}",
        fleet: f"expected the table of the contacts, {part}",
        fleet / "contacts": f"expected the table of the contacts, {part}",
        fleet / "robots.parquet": f"expected the table of the contacts, {part}",
    }
    for file in (tables[0].with_name("report.html"), fleet / "robots.parquet"):
        file.touch()
    for path, text in expected.items():
        assert f"{path}: {text}\n" in CliRunner().invoke(view, [str(path)]).output
    (results / "a.parquet").touch()
    assert tables_instead(results) == []  # a recording beside its analyses
    with pytest.raises(RecordingError, match=r"--scene names the scene$"):
        AnalysisSource(part, None)
    (fleet / "scenes").mkdir()
    (fleet / "scenes" / "a.yaml").touch()
    with pytest.raises(RecordingError, match=r"--scene names the scene, such as .*scenes.a.yaml$"):
        AnalysisSource(part, None)


def test_contacts_of_an_analysis_are_shown_as_they_were_found(table: Path) -> None:
    assert is_analysis(table)
    frame = AnalysisSource(table, SCENE).frame()
    truth = contact(SCENE, POSTURE, 3, np.array([-0.2, 0.05, 0.1]), probability=0.75)
    assert frame.estimate is not None
    (shown,) = frame.estimate.contacts
    assert (shown.link, shown.probability) == ("forearm", 0.75)
    assert frame.estimate.status == "ambiguous"
    assert frame.estimate.other == pytest.approx(0.1)  # the rest is that of another link
    assert AnalysisSource(table, SCENE).note().endswith("over the whole contact: wrist_1 (20 %)")
    for name in ("point", "point_base", "normal_base", "force_base", "covariance"):
        np.testing.assert_array_equal(getattr(shown, name), getattr(truth, name))
    np.testing.assert_array_equal(frame.q, POSTURE)


def test_the_controls_say_what_they_are_for(table: Path) -> None:
    source = AnalysisSource(table, SCENE)
    viewer = Viewer(serve_page("127.0.0.1", 0), SCENE)
    try:
        assert not viewer.controls.visible
        viewer.add_controls(source.title, source.add_controls)
        assert (viewer.controls.visible, viewer.controls.label) == (True, "Contacts")
    finally:
        viewer.close()


def test_a_table_without_its_recording_needs_a_scene(table: Path) -> None:
    with pytest.raises(RecordingError, match=r"demo\.parquet is not here; --scene names the scene"):
        AnalysisSource(table, None)
