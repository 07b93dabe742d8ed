"""The command: what it refuses, what it depends on, what the localizer makes of its files."""

import ast
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from contactsense.benchmarks.truth.arm import read as arm
from contactsense.benchmarks.truth.command import main
from contactsense.benchmarks.truth.universal_robots import LINKS
from contactsense.robots.urdf.meshes import from_folder
from contactsense.service.cli.main import cli

ROOT = Path(__file__).parents[3]
PACKAGE = ROOT / "benchmarks" / "truth"


def make(*arguments: str) -> Result:
    return CliRunner().invoke(main, ["make", *arguments])


@pytest.mark.slow
def test_nothing_of_contactsense_is_imported() -> None:
    """Neither written down nor loaded."""
    for path in PACKAGE.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                assert not any(alias.name.startswith("contactsense") for alias in node.names), path
            elif isinstance(node, ast.ImportFrom):
                assert node.level <= 1, path
                assert not (node.module or "").startswith(("contactsense", "benchmarks")), path
    modules = sorted(path.stem for path in PACKAGE.glob("[!_]*.py"))
    imports = "".join(f"import benchmarks.truth.{module}\n" for module in modules)
    code = f"import sys\n{imports}assert 'contactsense' not in sys.modules"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.long
def test_a_seed_gives_the_same_files(tmp_path: Path) -> None:
    """Of both suites with contacts; another seed gives others."""
    written = []
    for name, seed in (("one", "2"), ("same", "2"), ("other", "3")):
        into = tmp_path / "new" / name
        suites = ("--suite", "static", *(() if name == "other" else ("--suite", "motion")))
        arguments = ("--into", str(into), "--contacts", "3", "--runs", "1", "--seed", seed, *suites)
        done = make("--robot", "ur5e", *arguments)
        assert done.exit_code == 0, done.output
        assert "static_points_ur5e.npz: 3 contacts" in done.output
        written.append({path.name: path.read_bytes() for path in into.iterdir()})
    one, same, other = written
    assert sorted(one) == ["motion_ur5e.npz", "static_points_ur5e.npz"]
    assert one == same
    assert one["static_points_ur5e.npz"] != other["static_points_ur5e.npz"]


def test_the_meshes_are_those_of_the_arm(tmp_path: Path) -> None:
    """In the frames of the links, as `--detail skin` reads them; a file has single precision."""
    done = make("--robot", "ur3e", "--into", str(tmp_path), "--suite", "meshes")
    assert done.output.startswith(f"{tmp_path}/meshes/ur3e: 7 meshes, ")
    read = from_folder(tmp_path / "meshes" / "ur3e", LINKS)
    for link in arm("ur3e").links:
        mesh = read[link.name]
        np.testing.assert_allclose(mesh.vertices[mesh.faces], link.vertices[link.faces], rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--robot", "ur9"), "Invalid value for '--robot': 'ur9' is not one of 'ur3e', 'ur5e', 'panda'."),
        (("--contacts", "0"), "Invalid value for '--contacts': 0 is not in the range x>=1."),
        (("--runs", "0"), "Invalid value for '--runs': 0 is not in the range x>=1."),
        (("--seed", "-1"), "Invalid value for '--seed': -1 is not in the range x>=0."),
        (
            ("--suite", "probe"),
            "Invalid value for '--suite': 'probe' is not one of 'static', 'motion', 'meshes'.",
        ),
    ],
)
def test_bad_input_is_named(tmp_path: Path, arguments: tuple[str, ...], message: str) -> None:
    done = make("--into", str(tmp_path), *arguments)
    assert done.exit_code == 2
    assert [line for line in done.output.splitlines() if line.startswith("Error: ")] == [f"Error: {message}"]


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    into = tmp_path / "file" / "folder"
    done = make("--robot", "ur5e", "--into", str(into))
    assert done.exit_code == 1
    assert done.output == f"Error: {into}: cannot write: Not a directory\n"


def test_a_file_that_cannot_be_finished_is_not_left(tmp_path: Path) -> None:
    (tmp_path / "static_points_ur5e.npz").mkdir()
    done = make("--robot", "ur5e", "--into", str(tmp_path), "--suite", "static", "--contacts", "1")
    assert done.exit_code == 1
    assert "cannot write" in done.output
    assert [path.name for path in tmp_path.iterdir()] == ["static_points_ur5e.npz"]


def test_absent_packages_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("contactsense.benchmarks.truth.command.find_spec", lambda _name: None)
    done = make("--into", str(tmp_path))
    assert done.exit_code == 1
    command = "pip install '.[truth]' in the folder of the sources"
    assert done.output == f"Error: airo_models, mujoco, trimesh cannot be imported: {command}\n"


@pytest.mark.slow
def test_the_localizer_finds_what_was_made(tmp_path: Path) -> None:
    """Without noise it names 99 % of the links; sixty contacts may miss three by chance, not more."""
    done = make("--robot", "ur5e", "--into", str(tmp_path), "--suite", "static", "--contacts", "60")
    assert done.exit_code == 0, done.output
    done = CliRunner().invoke(cli, ["bench", "truth", str(tmp_path), "--robot", "ur5e", "--json"])
    assert done.exit_code == 0, done.output
    results = json.loads(done.stdout)["results"]
    right = np.array([row["link_right"] for row in results])
    assert len(right) == 4
    assert right[0] >= 0.95
    assert right[-1] >= 0.75


@pytest.mark.long
def test_the_table_of_the_readme(tmp_path: Path) -> None:
    """By its two commands; another processor may round otherwise, which moves a few of the contacts."""
    arguments = ("--robot", "ur5e", "--suite", "static", "--seed", "1", "--into", str(tmp_path))
    assert make(*arguments).exit_code == 0
    done = CliRunner().invoke(cli, ["bench", "truth", str(tmp_path), "--robot", "ur5e", "--json"])
    measured = np.array(
        [
            (
                100.0 * row["link_right"],
                100.0 * row["ambiguous"],
                row["error_mm"]["median"],
                row["error_mm"]["p95"],
                row["error_mm_clear"]["p95"],
            )
            for row in json.loads(done.stdout)["results"]
        ]
    )
    rows = re.findall(r"^\| (?:none|[\d.]+ N.*?) \| (.*) \|$", (ROOT / "README.md").read_text(), re.MULTILINE)
    columns = np.array([[float(figure) for figure in re.findall(r"[\d.]+", row)] for row in rows])
    right, median, of_95, ambiguous, clear = columns.T
    shares, errors = np.array([right, ambiguous]).T, np.array([median, of_95, clear]).T
    assert shares == pytest.approx(measured[:, :2], abs=0.2)
    assert errors == pytest.approx(measured[:, 2:], rel=0.05)
