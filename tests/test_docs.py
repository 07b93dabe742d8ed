"""What README and docs say holds: links, paths, commands with their options, code, the example scene."""

import json
import re
import shlex
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
import yaml
from pydantic import BaseModel

from contactsense import Localizer, forward_model
from contactsense.robots.rotations import rotation_from_rpy
from contactsense.robots.tool import Tool
from contactsense.scene import Scene
from contactsense.sensors.settings import Friction, JointTorqueSensor, LinkInertia, WrenchSensor
from contactsense.service.analysis.contact_columns import columns_in_markdown
from contactsense.service.cli.main import cli
from contactsense.service.scene.page import scene_page
from contactsense.service.scene.summary import scene_warnings
from contactsense.solvers import Status

ROOT = Path(__file__).parents[1]
PAGES = sorted(
    [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("*.md")], key=lambda page: page.name
)
SCENE = (ROOT / "docs" / "scene.md").read_text(encoding="utf-8")
pages = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)


def _prose(page: Path) -> str:
    return re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)


def _anchors(page: Path) -> set[str]:
    headings = re.findall(r"^#+ (.*)$", _prose(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def _blocks(page: str, language: str) -> list[str]:
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)


@pages
def test_links_lead_to_files_and_headings(page: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", _prose(page)):
        if target.startswith("http"):
            continue
        path, _, anchor = target.partition("#")
        there = (page.parent / path).resolve() if path else page
        assert there.exists(), target
        assert not anchor or anchor in _anchors(there), target


@pages
def test_paths_that_are_named_exist(page: Path) -> None:
    folders = "robots|kinematics|contactsense|service|benchmarks|tests|docs"
    for path in re.findall(rf"`((?:{folders})/[\w/.]*)`", _prose(page)):
        assert (ROOT / path).exists(), path


def test_every_page_is_named_in_the_readme() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    for page in (ROOT / "docs").glob("*.md"):
        assert f"docs/{page.name}" in readme


def _commands(page: Path) -> set[str]:
    text = page.read_text(encoding="utf-8")
    text = text.replace("\\\n", " ")  # a command may go on in the next line
    lines = re.findall(r"^ {4}(contactsense .*)$", text, re.MULTILINE)
    return {line.split("  #")[0].strip() for line in [*lines, *re.findall(r"`(contactsense [^`]+)`", text)]}


@pages
def test_commands_and_their_options_exist(page: Path) -> None:
    for line in _commands(page):
        command: click.Command = cli
        words = shlex.split(line)[1:]
        while words and isinstance(command, click.Group) and not words[0].startswith("-"):
            below = command.get_command(click.Context(command), words.pop(0))
            assert below is not None, line
            command = below
        options = {
            name for parameter in command.params for name in (*parameter.opts, *parameter.secondary_opts)
        }
        for word in words:
            if word.startswith("--"):
                assert word.partition("=")[0] in options | {"--help", "--version"}, line


def test_the_newcomers_pages_name_commands() -> None:
    for name in ("README.md", "docs/first_touch.md", "docs/service.md", "docs/calibration.md"):
        assert _commands(ROOT / name), name


def test_modules_that_are_run_exist() -> None:
    named = {
        module
        for page in PAGES
        for module in re.findall(r"python -m (?:contactsense\.)?([\w.]+)", page.read_text(encoding="utf-8"))
        if (ROOT / module.split(".")[0]).is_dir()
    }
    assert named
    for module in named:
        path = ROOT.joinpath(*module.split("."))
        assert path.with_suffix(".py").exists() or (path / "__main__.py").exists(), module


@pages
def test_python_compiles(page: Path) -> None:
    for code in re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL):
        compile(code, str(page), "exec")


def test_the_solvers_run_as_shown() -> None:
    names: dict[str, Any] = {}
    for code in _blocks("solvers.md", "python"):
        exec(code, names)
    assert names["contact"].status == names["probable"].status == Status.OK


@pytest.mark.slow
def test_the_sample_of_a_controller_is_a_push_on_the_forearm() -> None:
    sample = json.loads(_blocks("controllers.md", "json")[0])
    readings = {name: np.array(sample[name]) for name in ("base_wrench", "joint_torque")}
    found = Localizer(Scene(robot="ur5e")).locate(np.array(sample["q"]), **readings, external=False)
    assert (found.status, found.contacts[0].link) == ("contact", "forearm")
    assert np.linalg.norm(found.contacts[0].force_base) == pytest.approx(20.0, abs=0.1)


@pytest.mark.slow
def test_the_first_touch_in_python_runs(capsys: pytest.CaptureFixture[str]) -> None:
    text = (ROOT / "docs" / "first_touch.md").read_text(encoding="utf-8")
    for code in re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL):
        exec(compile(code, "docs/first_touch.md", "exec"), {})
    printed = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
    assert printed == re.findall(r"^    (\d\.\d\d s: .*)$", text, flags=re.MULTILINE)


def test_readings_are_converted_as_the_cell_page_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Readings of turned and displaced sensors, with opposite signs and biases, of a push on the wrist."""
    sensor: dict[str, Any] = {
        "rpy": [3.0, 0.2, 0.8], "translation": [0.1, 0.0, -0.2], "sign": "sensor_on_arm",
        "bias": [5, 4, 3, 0.3, 0.2, 0.1],
    }  # fmt: skip
    cell = {"robot": "ur5e", "tool": {"mass": 1.0}, "base_wrench": sensor, "wrist_wrench": sensor}
    (tmp_path / "scene.yaml").write_text(yaml.safe_dump(cell), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs" / "cell.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    given: dict[str, Any] = {}
    exec(compile(code, "docs/cell.md", "exec"), given)
    q, rest = np.array([0.3, -1.3, 1.6, -1.9, -1.57, 0.4]), np.zeros(6)
    push = np.array([0.03, 0.0, 0.0]), np.array([3.0, -20.0, 5.0])
    truth = forward_model(given["scene"], q, "wrist_3", *push)
    turned = rotation_from_rpy((3.0, 0.2, 0.8))
    place = np.array([0.1, 0.0, -0.2])
    force, moment = truth.base_wrench[:3], truth.base_wrench[3:]
    own = np.concatenate([turned.T @ force, turned.T @ (moment - np.cross(place, force))])
    base_reading = np.array(sensor["bias"]) - own
    wrist_reading = given["wrist"].reading(q, truth.wrist_wrench)
    made = given["sample"](0.0, q, rest, truth.joint_torque, base_reading, wrist_reading)
    np.testing.assert_allclose(made.base_wrench, truth.base_wrench, atol=1e-9)
    np.testing.assert_allclose(made.wrist_wrench, truth.wrist_wrench, atol=1e-9)


def test_the_scene_of_a_cell_loads(tmp_path: Path) -> None:
    example = re.search(r"```yaml\n(.*?)```", SCENE, re.DOTALL)
    assert example is not None
    path = tmp_path / "scene.yaml"
    path.write_text(example[1], encoding="utf-8")
    scene = Scene.load(path)
    assert scene.link_names[-1] == "gripper"
    assert scene.orientation.magnitude() == pytest.approx(yaml.safe_load(example[1])["mounting"][1])
    assert not scene_warnings(scene)


@pytest.mark.parametrize("model", [Scene, WrenchSensor, JointTorqueSensor, Friction, Tool, LinkInertia])
def test_the_scene_page_names_every_field(model: type[BaseModel]) -> None:
    assert set(model.model_fields) <= set(re.findall(r"^\| `(\w+)` \|", SCENE, re.MULTILINE))


def test_the_scene_page_is_what_the_code_says() -> None:
    assert scene_page() == SCENE, "python -m contactsense.service.scene.page > docs/scene.md"


def test_the_columns_of_contacts_are_those_of_the_code() -> None:
    page = (ROOT / "docs" / "analysis.md").read_text(encoding="utf-8")
    assert f"\n\n{columns_in_markdown()}\n\n" in page, (
        "python -m contactsense.service.analysis.contact_columns prints the table of docs/analysis.md"
    )


def _rows(page: str) -> dict[str, list[str]]:
    """Figures by noise of a Markdown table."""
    row = re.compile(r"^\| (none|[\d.]+ (?:N|/).*?) \| (.*) \|$", re.MULTILINE)
    return {
        "0/0/0" if noise == "none" else "/".join(re.findall(r"[\d.]+", noise)): re.findall(r"[\d.]+", cells)
        for noise, cells in row.findall((ROOT / page).read_text(encoding="utf-8"))
    }


def test_figures_of_the_readme_are_those_of_the_results() -> None:
    readme = _rows("README.md")
    results = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")
    # Link right, median, 95 %, then median and 95 % of the answers that are clear, and the ambiguous ones.
    row = re.compile(
        r"^ur5e +([\d./]+) +([\d.]+)% +([\d.]+) +([\d.]+) +[\d.]+ +([\d.]+) +([\d.]+)%", re.MULTILINE
    )
    assert readme == {
        noise: [*found, ambiguous, clear] for noise, *found, clear, ambiguous in row.findall(results)
    }
    assert len(readme) == 4


def test_figures_of_the_readme_are_those_of_the_ground_truth_page() -> None:
    """Beside each of our figures that page has the one of the given files."""
    assert _rows("README.md") == {noise: cells[::2] for noise, cells in _rows("docs/ground_truth.md").items()}
