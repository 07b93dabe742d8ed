"""The report: everything in one file, and the same numbers in all forms."""

import errno
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pa_parquet
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from contactsense import Scene, WrenchSensor
from contactsense.service.analysis import Analysis
from contactsense.service.analysis import analyze as run_analysis
from contactsense.service.analysis.contact_table import contact_table
from contactsense.service.analysis.fleet.report import write_fleet_report
from contactsense.service.analysis.fleet.summary import FleetSummary
from contactsense.service.analysis.health import warning
from contactsense.service.analysis.report import _code
from contactsense.service.analysis.residuals.residual_statistics import ResidualSummary
from contactsense.service.analysis.summary.contact_summary import millimetres
from contactsense.service.cli.analyze import analyze
from contactsense.service.recordings.metadata import metadata
from tests.service.analysis.recordings import demo, write_motion


@pytest.mark.parametrize(
    ("message", "html"),
    [
        ("a < b & `c` `", "a &lt; b &amp; <code>c</code> `"),
        ("`<b>` of `x & y`", "<code>&lt;b&gt;</code> of <code>x &amp; y</code>"),
        ("`` and <i>", "`` and &lt;i&gt;"),
    ],
)
def test_commands_in_messages_are_code_and_nothing_else_is_markup(message: str, html: str) -> None:
    assert _code(message) == html


def test_json_has_the_limits_that_are_exceeded(folder: Path) -> None:
    limits = json.loads((folder / "result.json").read_text())[0]["limits"]
    assert limits["provenance"] == "measured <by> us"
    assert all("N above 22 N (quasi-static)" in texts[0] for texts in limits["exceeded"].values())
    assert limits["exceeded"]


def test_all_files_are_written(folder: Path) -> None:
    assert sorted(path.name for path in (folder / "out").iterdir()) == [
        "contacts.csv", "contacts.parquet", "estimates.parquet", "report.html", "report.md",
    ]  # fmt: skip


@pytest.mark.parametrize("missing", ["joint_torque", "base_wrench"])
def test_a_sensor_that_the_file_lacks_leaves_the_other_one(tmp_path: Path, missing: str) -> None:
    """Samples without it are usable, so that model and noise can be checked."""
    path = write_motion(demo(), tmp_path / "part.parquet", last=500)
    table = pa_parquet.read_table(path)
    pa_parquet.write_table(table.drop_columns([f"{missing}_{i}" for i in range(6)]), path)
    (tmp_path / "scene.yaml").write_text("robot: ur5e\n")
    result = CliRunner().invoke(
        analyze, [str(path), "--scene", str(tmp_path / "scene.yaml"), "--out", str(tmp_path / "out")]
    )
    assert result.exit_code == 0
    assert "nothing touched the arm" in result.output
    assert f"{missing} is not used, though the scene has this sensor" in result.output or (
        missing == "joint_torque" and "joint torques are not used" in result.output
    )
    assert "100 %" not in result.output
    assert "No sample" not in result.output
    assert "residuals without contact" in (tmp_path / "out" / "report.md").read_text()


def test_a_sensor_that_is_refused_throughout_is_a_warning(tmp_path: Path) -> None:
    path = write_motion(demo(), tmp_path / "demo.parquet", last=1500)
    wrong = Scene(robot="ur5e", base_wrench=WrenchSensor(sign="sensor_on_arm"))
    found = run_analysis(path, wrong)
    assert "base_wrench could not be used in any sample" in warning(found)
    assert warning(run_analysis(path, Scene(robot="ur5e"))) == ""


def test_one_sample_at_a_unix_time_has_a_report(tmp_path: Path) -> None:
    path = write_motion(demo(), tmp_path / "one.parquet", last=1)
    table = pa_parquet.read_table(path)
    pa_parquet.write_table(table.set_column(0, "timestamp", [[1.7e9]]), path)
    (tmp_path / "scene.yaml").write_text("robot: ur5e\n")
    result = CliRunner().invoke(
        analyze, [str(path), "--scene", str(tmp_path / "scene.yaml"), "--out", str(tmp_path / "out")]
    )
    assert "no sample could be used" in result.output
    assert (tmp_path / "out" / "report.html").exists()


@pytest.mark.parametrize(
    ("columns", "scale", "complaint"),
    [
        (["timestamp"], 1000.0, "timestamp: expected samples at most 0.15 s apart, got 2 s on average"),
        (["timestamp"], 0.001, "timestamp: expected samples at least 0.0005 s apart, got 2e-06 s on average"),
        ([f"actual_q_{i}" for i in range(6)], 180.0 / np.pi, "are read with --columns angle_unit=deg"),
    ],
)
def test_unusable_samples_are_not_said_to_be_free_of_contact(
    tmp_path: Path, columns: list[str], scale: float, complaint: str
) -> None:
    path = write_motion(demo(), tmp_path / "wrong.parquet", last=500)
    table = pa_parquet.read_table(path)
    for name in columns:
        values = table[name].to_numpy() * scale
        table = table.set_column(table.column_names.index(name), name, [values])
    pa_parquet.write_table(table, path)
    (tmp_path / "scene.yaml").write_text("robot: ur5e\n")
    result = CliRunner().invoke(
        analyze, [str(path), "--scene", str(tmp_path / "scene.yaml"), "--out", str(tmp_path / "out")]
    )
    assert result.exit_code == 1
    assert complaint in result.output
    assert "no sample could be used: whether anything touched the arm is not known" in result.output
    assert "nothing touched" not in result.output
    for name in ("report.md", "report.html"):
        text = (tmp_path / "out" / name).read_text()
        assert "No sample could be used" in text
        assert "Nothing touched" not in text


def test_rows_in_no_order_are_told_without_a_time_between_them(tmp_path: Path) -> None:
    path = write_motion(demo(), tmp_path / "shuffled.parquet", last=500)
    table = pa_parquet.read_table(path)
    pa_parquet.write_table(table.take(np.random.default_rng(0).permutation(500)), path)
    (tmp_path / "scene.yaml").write_text("robot: ur5e\n")
    result = CliRunner().invoke(
        analyze, [str(path), "--scene", str(tmp_path / "scene.yaml"), "--out", str(tmp_path / "out")]
    )
    assert result.exit_code == 1
    assert run_analysis(path, Scene(robot="ur5e")).start == 0.0
    assert "timestamp: expected rows in the order of time" in result.output
    assert not any(text in result.output for text in ("apart", "scene does not fit", "residuals"))
    assert "999 s" not in (tmp_path / "out" / "report.md").read_text()
    assert "1.0 s" in (tmp_path / "out" / "report.md").read_text()


def test_an_uncalibrated_scene_is_warned_of_before_its_contacts(tmp_path: Path) -> None:
    path = write_motion(demo(), tmp_path / "demo.parquet", last=500)
    # The other arm's masses: everything looks like a contact.
    (tmp_path / "scene.yaml").write_text("robot: ur10e\n")
    arguments = [str(path), "--scene", str(tmp_path / "scene.yaml"), "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(analyze, arguments)
    assert result.exit_code == 0, result.output
    warning = "The scene does not fit this recording"
    assert result.stdout.index(f"warning: {warning}") < result.stdout.index("place in link")
    assert "contactsense calibrate" in result.stdout
    # Said once.
    assert "line of the scene is wrong" not in result.stdout
    markdown, html = ((tmp_path / "out" / name).read_text() for name in ("report.md", "report.html"))
    for text in (markdown, html):
        assert text.index(warning) < text.index("begin")
    # Backticks are Markdown's; in HTML they stood around the command.
    assert "Run <code>contactsense calibrate</code> on" in html
    assert "`" not in html[: html.index("begin")]
    assert "Run `contactsense calibrate` on" in markdown


def test_residuals_far_above_the_noise_are_warned_of() -> None:
    scene = Scene(robot="ur5e")
    found = Analysis(
        scene=scene, recording="a.csv", samples=100, start=0.0, duration=1.0, gaps=0, problems=(),
        contacts=(),
        residuals=ResidualSummary(
            *(np.zeros(0) for _ in range(4)), np.zeros((0, 6)), np.zeros((0, 6)), np.ones(6), np.full(6, 2.9),
            free=100, usable=100, touched=0, degraded=0, inconsistent=0, missing=(0, 0),
        ),
    )  # fmt: skip
    assert warning(found) == ""
    found = replace(found, residuals=replace(found.residuals, joint_ratio=np.full(6, 3.1)))
    assert "up to 3.1 times" in warning(found)
    # Without a sample that is free of contact, the ratios say nothing.
    assert warning(replace(found, residuals=replace(found.residuals, free=0))) == ""


def test_the_report_needs_nothing_from_elsewhere(folder: Path) -> None:
    text = (folder / "out" / "report.html").read_text()
    assert not re.findall(r"""(?:src|href)\s*=(?!"#)|url\(|@import|https?://""", text)
    assert "measured &lt;by&gt; us" in text
    assert "no conformity test" in text


def test_numbers_are_on_the_right_and_names_on_the_left(folder: Path) -> None:
    """The third column of each table was on the left, also that of the transient limits."""
    text = (folder / "out" / "report.html").read_text()
    style = text[: text.index("</style>")]
    assert "nth-child" not in style
    assert ".text { text-align: left" in style
    assert re.findall(r'<th class="text">(\w+)', text) == ["link", "region"]
    names = re.findall(r'<td class="text">(?:<i [^>]*></i>)?([^<]*)', text)
    assert names == ["forearm", "upper_arm", "wrist_1", "hand"]
    assert "<td>900</td>" in text


def test_a_folder_that_cannot_be_made_is_told_before_the_analysis(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording = write_motion(demo(), tmp_path / "a.parquet", last=500)
    analyzed = []
    monkeypatch.setattr("contactsense.service.cli.analyze.run", lambda *_, **__: analyzed.append(1))
    arguments = [str(recording), "--scene", str(folder / "scene.yaml"), "--out", str(recording)]
    result = CliRunner().invoke(analyze, arguments)
    assert result.exit_code == 1
    assert "a.parquet: cannot write: File exists" in result.stderr
    assert analyzed == []


def test_a_full_disk_leaves_the_reports_of_before(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_motion(demo(), tmp_path / "a.parquet", last=500)
    arguments = [str(tmp_path / "a.parquet"), "--scene", str(folder / "scene.yaml"), "--out", str(tmp_path)]
    assert CliRunner().invoke(analyze, arguments).exit_code == 0
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    write = Path.write_text

    def full(path: Path, text: str, **how: str) -> None:
        write(path, text[: len(text) // 2], **how)
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr(Path, "write_text", full)
    result = CliRunner().invoke(analyze, arguments)
    assert result.exit_code == 1
    assert "report.html: cannot write: No space left on device" in result.stderr
    for name in ("report.html", "report.md"):
        assert (tmp_path / name).read_bytes() == before[name]
    assert {path.name for path in tmp_path.iterdir()} == set(before)
    with pytest.raises(OSError, match=r"fleet\.html"):
        write_fleet_report(FleetSummary((), contact_table([]), (), 0), tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == set(before)


def test_every_contact_has_its_drawing(folder: Path) -> None:
    text = (folder / "out" / "report.html").read_text()
    data = json.loads(re.search(r'<script id="data"[^>]*>(.*?)</script>', text, re.DOTALL).group(1))  # type: ignore[union-attr]
    contacts = json.loads((folder / "result.json").read_text())[0]["contacts"]
    assert [contact["link"] for contact in contacts] == ["forearm", "upper_arm", "wrist_1"]
    assert list(data["views"]) == [str(contact["contact"]) for contact in contacts]
    assert len(data["geometry"]) == 7
    for contact in contacts:
        view = data["views"][str(contact["contact"])]
        expected = [1e3 * contact[f"point_base_{a}"] for a in "xyz"]
        assert view["point"] == pytest.approx(expected, abs=0.01)
        assert f'data-contact="{contact["contact"]}"' in text
        assert view["region"]["link"] == contact["link_index"]
        assert view["region"]["faces"]


def test_the_markdown_says_the_same(folder: Path) -> None:
    text = (folder / "out" / "report.md").read_text()
    for contact in json.loads((folder / "result.json").read_text())[0]["contacts"]:
        assert f"| {contact['contact']} | {contact['begin']:.3f} | {contact['link']} |" in text
        assert f"{contact['peak_force']:.1f} N" in text
    assert "above your limits: hand: " in text
    assert "no conformity test" in text


def test_a_broken_file_is_reported_and_the_others_are_analysed(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "broken.parquet").write_bytes(b"nothing")
    scene = str(folder / "scene.yaml")
    files = [str(tmp_path / "broken.parquet"), str(folder / "demo.parquet")]
    result = CliRunner().invoke(analyze, [*files, "--scene", scene, "--out", str(tmp_path / "out")])
    assert result.exit_code == 1
    assert "broken.parquet: cannot read the recording" in result.stderr
    assert (tmp_path / "out" / "demo" / "report.html").exists()
    alone = CliRunner().invoke(analyze, [files[0], "--scene", scene, "--out", str(tmp_path / "out")])
    assert alone.exit_code == 1


def test_files_of_one_name_are_refused(folder: Path, tmp_path: Path) -> None:
    files = [str(folder / "demo.parquet"), str(tmp_path / "demo.csv")]
    result = CliRunner().invoke(
        analyze, [*files, "--scene", str(folder / "scene.yaml"), "--out", str(tmp_path)]
    )
    assert result.exit_code == 2
    assert "expected distinct file names" in result.stderr


def test_a_recording_that_carries_its_scene_needs_no_other(folder: Path, tmp_path: Path) -> None:
    scene = Scene.load(folder / "scene.yaml")
    table = pa_parquet.read_table(folder / "demo.parquet").slice(0, 2600)
    path = tmp_path / "own.parquet"
    pa_parquet.write_table(table.replace_schema_metadata(metadata(scene)), path)
    result = CliRunner().invoke(analyze, [str(path), "--out", str(tmp_path / "out"), "--json"])
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)[0]["contacts"][0]["link"] == "forearm"
    other = CliRunner().invoke(analyze, [str(folder / "demo.parquet"), "--out", str(tmp_path / "out")])
    assert other.exit_code == 1
    assert "the file carries no scene: name one with --scene" in other.stderr


def test_the_terminal_compares_with_limits_and_names_their_source(folder: Path, tmp_path: Path) -> None:
    table = pa_parquet.read_table(folder / "demo.parquet").slice(0, 2600)
    pa_parquet.write_table(table, tmp_path / "first.parquet")

    def shown(force: float) -> str:
        limits = tmp_path / "limits.yaml"
        limits.write_text(
            "provenance: measured [by us]\n"
            f"regions: [{{name: hand, quasi_static: {force}, transient: {force}}}]\n"
        )
        words = [tmp_path / "first.parquet", "--scene", folder / "scene.yaml", "--out", tmp_path / "out"]
        result = CliRunner().invoke(analyze, [*map(str, words), "--limits", str(limits)])
        assert result.exit_code == 0, result.output
        return result.stdout

    exceeded, within = shown(2.0), shown(900.0)
    assert re.search(
        r"above your limits: contact at [\d.]+ s: hand: [\d.]+ N above 2 N \(transient\)", exceeded
    )
    times = re.findall(r"above your limits: contact at ([\d.]+) s", exceeded)
    assert len(times) == len(set(times)) == 2  # each above two limits
    assert "above your limits: none" in within
    for text in (exceeded, within):
        assert "limits from: measured [by us]. Forces are estimates" in text
    rows = within.partition("duration")[2].partition("above")[0].splitlines()
    assert "m/s" in rows[1]
    assert max(len(row.rstrip()) for row in rows) <= 80


def test_contacts_as_arrows(folder: Path, tmp_path: Path) -> None:
    make_reader = pytest.importorskip("mcap.reader").make_reader
    factory = pytest.importorskip("mcap_ros2.decoder").DecoderFactory()
    arguments = [str(folder / "demo.parquet"), "--scene", str(folder / "scene.yaml"), "--out", str(tmp_path)]
    result = CliRunner().invoke(analyze, [*arguments, "--mcap", "--json"])
    assert result.exit_code == 0, result.output
    (contact, *_) = json.loads(result.stdout)[0]["contacts"]
    with (tmp_path / "contacts.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[factory])
        messages = reader.iter_decoded_messages(topics=["/contacts"])
        found = [(1e-9 * message.log_time, update) for _, _, message, update in messages]
    end = contact["begin"] + contact["duration"]
    on = [(t, update.entities[0].arrows[0]) for t, update in found if update.entities and t < end]
    off = [t for t, update in found if update.deletions]
    assert len(on) == pytest.approx(25.0 * contact["duration"], abs=2)
    assert off[0] == pytest.approx(end)
    # Each arrow ends at the contact; the arm moves, so the largest force is where the table says it is.
    strongest = max((arrow for _, arrow in on), key=lambda arrow: arrow.shaft_length)
    position, turn = strongest.pose.position, strongest.pose.orientation
    length = strongest.shaft_length + strongest.head_length
    along = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).apply([length, 0.0, 0.0])
    tip = np.array([position.x, position.y, position.z]) + along
    place = [contact[f"point_base_{a}"] for a in "xyz"]
    np.testing.assert_allclose(tip, place, atol=2e-3)


def test_other_names_of_columns(folder: Path, tmp_path: Path) -> None:
    table = pa_parquet.read_table(folder / "demo.parquet").slice(0, 2600)
    names = [name.replace("actual_q_", "position_") for name in table.column_names]
    path = tmp_path / "other.parquet"
    pa_parquet.write_table(table.rename_columns(names), path)
    arguments = [str(path), "--scene", str(folder / "scene.yaml"), "--out", str(tmp_path / "out"), "--json"]
    failed = CliRunner().invoke(analyze, arguments)
    assert failed.exit_code == 1
    assert "q: expected a column actual_q_0, found timestamp, position_0" in failed.stderr
    result = CliRunner().invoke(analyze, [*arguments, "--columns", "q=position"])
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)[0]["contacts"][0]["link"] == "forearm"


def test_a_place_in_millimetres_has_no_negative_zero() -> None:
    assert millimetres(np.array([-0.0004, 0.0, -0.1747])) == "0, 0, -175"


def test_other_places_on_the_same_link_are_explanations_too(tmp_path: Path) -> None:
    """From torques alone: the probability that is stated is that of one place."""
    path = write_motion(demo(), tmp_path / "demo.parquet", last=8000)
    (tmp_path / "scene.yaml").write_text("robot: ur5e\nbase_wrench: null\n")
    out = tmp_path / "out"
    arguments = [str(path), "--scene", str(tmp_path / "scene.yaml"), "--out", str(out)]
    assert CliRunner().invoke(analyze, arguments).exit_code == 0
    rows = pa_parquet.read_table(out / "contacts.parquet").to_pylist()
    elsewhere = [row["link_probability"][row["link_index"]] - row["probability"] for row in rows]
    assert max(elsewhere) > 0.05
    sections = (out / "report.md").read_text().split("other explanations: ")[1:]
    for row, section, share in zip(rows, sections, elsewhere, strict=True):
        here = section.splitlines()[0]
        assert (f"another place on {row['link']}" in here) == (row["smoothed"] and share >= 0.01)
