"""An installed wheel adds one importable name, and works beside a user's own modules of any name."""

import os
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

from tests.installation import ROOT

pytestmark = pytest.mark.slow
SOURCES = ("robots", "kinematics", "contactsense", "service", "benchmarks")
TESTS = ("tests/test_docs.py", "tests/test_examples.py")
FILES = ("pyproject.toml", "README.md", "LICENSE", "MANIFEST.in", "CHANGELOG.md")


def _copy(target: Path) -> Path:
    """The sources as a checkout has them: setuptools writes beside them."""
    target.mkdir()
    for name in SOURCES:
        shutil.copytree(
            ROOT / name, target / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__", "*.nb?")
        )
    (target / "tests").mkdir()
    for name in (*FILES, *TESTS):
        shutil.copy(ROOT / name, target / name)
    return target


def _build(sources: Path, target: Path) -> Path:
    subprocess.run(
        [sys.executable, "-m", "pip", "wheel", ".", "--no-deps", "--quiet", "--wheel-dir", str(target)],
        cwd=sources,
        check=True,
    )
    (wheel,) = target.glob("*.whl")
    return wheel


@pytest.fixture(scope="session")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _copy(tmp_path_factory.mktemp("checkout") / "contactsense")


@pytest.fixture(scope="session")
def wheel(sources: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    try:
        return _build(sources, tmp_path_factory.mktemp("wheel"))
    except subprocess.CalledProcessError:
        pytest.skip("a wheel cannot be built without a package index for setuptools")


class Installation:
    """An environment with the wheel, and a folder of a user with modules named as ours."""

    def __init__(self, folder: Path, wheel: Path) -> None:
        self._python = folder / "env" / "bin" / "python"
        venv.create(folder / "env", with_pip=True)
        self.run("-m", "pip", "install", "--quiet", "--no-deps", str(wheel), cwd=folder)
        # Dependencies come from the environment that runs the tests; what is installed here goes first.
        packages = next((folder / "env").glob("lib/python*/site-packages"))
        (packages / "dependencies.pth").write_text(sysconfig.get_paths()["purelib"] + "\n")
        self.user = folder / "user"
        (self.user / "service").mkdir(parents=True)
        (self.user / "robots.py").write_text("NAME = 'mine'\n")
        (self.user / "service" / "__init__.py").write_text("NAME = 'mine'\n")

    def run(self, *arguments: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
        """Run its Python in the user's folder."""
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        return subprocess.run(
            [str(self._python), *arguments],
            cwd=cwd or self.user,
            env={**environment, "NUMBA_DISABLE_JIT": "1"},
            capture_output=True,
            text=True,
        )

    def command(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run `contactsense` there."""
        return self.run(str(self._python.with_name("contactsense")), *arguments)


@pytest.fixture(scope="session")
def installation(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Installation:
    return Installation(tmp_path_factory.mktemp("installed"), wheel)


def _contents(wheel: Path) -> set[str]:
    with zipfile.ZipFile(wheel) as archive:
        return set(archive.namelist())


def test_the_wheel_has_one_top_level_name_and_all_data(wheel: Path) -> None:
    names = _contents(wheel)
    assert {name.split("/")[0] for name in names if ".dist-info/" not in name} == {"contactsense"}
    data = [
        path.relative_to(ROOT).as_posix()
        for folder in SOURCES
        for pattern in ("*.yaml", "py.typed", "*.py")
        for path in (ROOT / folder).rglob(pattern)
    ]
    wanted = {path if path.startswith("contactsense/") else f"contactsense/{path}" for path in data}
    assert wanted <= names
    assert "contactsense/robots/ur5e.yaml" in names


@pytest.mark.long
def test_a_source_distribution_builds_the_same_wheel(sources: Path, wheel: Path, tmp_path: Path) -> None:
    venv.create(tmp_path / "env", with_pip=True)
    python = str(tmp_path / "env" / "bin" / "python")
    subprocess.run([python, "-m", "pip", "install", "--quiet", "setuptools>=77"], check=True)
    program = f"from setuptools.build_meta import build_sdist; build_sdist({str(tmp_path)!r})"
    subprocess.run([python, "-c", program], cwd=sources, check=True, capture_output=True)
    (archive,) = tmp_path.glob("*.tar.gz")
    (tmp_path / "unpacked").mkdir()
    shutil.unpack_archive(archive, tmp_path / "unpacked", filter="data")
    (unpacked,) = (tmp_path / "unpacked").iterdir()
    # Of the tests setuptools would take some only, without what they import.
    assert not (unpacked / "tests").exists()
    assert _contents(_build(unpacked, tmp_path)) == _contents(wheel)


def test_it_works_beside_modules_of_the_same_names(installation: Installation) -> None:
    program = (
        "import robots, service, contactsense, contactsense.robots, contactsense.service\n"
        "assert robots.NAME == service.NAME == 'mine'\n"
        "assert contactsense.robots.load('ur5e').name == 'ur5e'\n"
        "print(contactsense.Scene(robot='ur5e').robot.name, contactsense.__file__)\n"
    )
    (installation.user / "program.py").write_text(program)
    done = installation.run("program.py")
    assert done.returncode == 0, done.stderr
    name, place = done.stdout.split()
    assert name == "ur5e"
    assert str(ROOT) not in place


def test_the_commands_work(installation: Installation) -> None:
    done = installation.command("robots")
    assert done.returncode == 0, done.stderr
    assert "ur5e" in done.stdout
    done = installation.command("bench", "--help")
    assert done.returncode == 0, done.stderr
    assert "truth" in done.stdout


def test_a_bench_without_its_data_says_what_it_needs(installation: Installation) -> None:
    done = installation.command("bench", "truth", "nowhere")
    assert done.returncode in (1, 2)
    assert len(done.stderr.strip().splitlines()) == 1
    assert "nowhere" in done.stderr
