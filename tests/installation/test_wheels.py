"""pip alone installs what is declared, from wheels, wherever the README says that contactsense runs."""

import re
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.installation import ROOT, declared


class Platform(NamedTuple):
    """A platform as markers and as wheel tags name it."""

    sys_platform: str
    platform_system: str
    platform_machine: str
    tags: tuple[str, ...]


def _manylinux(machine: str) -> tuple[str, ...]:
    return (f"manylinux2014_{machine}", *(f"manylinux_2_{minor}_{machine}" for minor in range(17, 35)))


PLATFORMS = {
    "linux-x86_64": Platform("linux", "Linux", "x86_64", _manylinux("x86_64")),
    "linux-aarch64": Platform("linux", "Linux", "aarch64", _manylinux("aarch64")),
    "macos-arm64": Platform("darwin", "Darwin", "arm64", ("macosx_14_0_arm64", "macosx_14_0_universal2")),
    "macos-x86_64": Platform("darwin", "Darwin", "x86_64", ("macosx_14_0_x86_64", "macosx_14_0_universal2")),
    "windows-amd64": Platform("win32", "Windows", "AMD64", ("win_amd64",)),
}
EXTRAS = ("geometry", "mcap", "notebook", "fleet", "truth")
"""Extras that are resolved too, where developers and CI install them; all other cases resolve what runs."""
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
ABSENT = {
    ("numba", "macos-x86_64"): "llvmlite, which it needs, has no wheels for Intel Macs any more",
}
"""(package, platform) -> why there is no wheel; the README's line on platforms says the same."""


def requirements(platform: str, python: str, *extras: str) -> list[str]:
    """What is declared for this platform, without markers."""
    target = PLATFORMS[platform]
    environment = {
        "sys_platform": target.sys_platform,
        "platform_system": target.platform_system,
        "platform_machine": target.platform_machine,
        "python_version": python,
        "python_full_version": f"{python}.0",
        "implementation_name": "cpython",
    }
    return [
        f"{requirement.name}{requirement.specifier}"
        for requirement in declared(*extras)
        if requirement.marker is None or requirement.marker.evaluate(environment)
    ]


def resolve(wanted: list[str], platform: str, python: str, *more: str) -> subprocess.CompletedProcess[str]:
    """Let pip choose wheels for that platform, without installing them."""
    tags = [argument for tag in PLATFORMS[platform].tags for argument in ("--platform", tag)]
    command = [
        *(sys.executable, "-m", "pip", "install", "--dry-run", "--ignore-installed", "--quiet"),
        *("--disable-pip-version-check", "--target", "nowhere", "--only-binary=:all:", *tags),
        *("--python-version", python, "--implementation", "cp", "-c", str(ROOT / "constraints.txt")),
    ]
    return subprocess.run([*command, *more, *wanted], capture_output=True, text=True)


@pytest.fixture(scope="session")
def index() -> None:
    """Skips without a package index."""
    done = resolve(["lazy_loader"], "linux-x86_64", "3.12", "--no-deps", "--retries", "0", "--timeout", "10")
    if done.returncode != 0:
        pytest.skip(f"no package index: {done.stderr.strip().splitlines()[-1]}")


@pytest.mark.slow
@pytest.mark.index
# pip loads whole wheels to see what they need, in CI at the lowest priority beside the other tests.
@pytest.mark.timeout(1800)
@pytest.mark.usefixtures("index")
@pytest.mark.parametrize("python", PYTHONS)
@pytest.mark.parametrize("platform", PLATFORMS)
def test_every_dependency_has_a_wheel(
    platform: str, python: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    absent = {name for name, where in ABSENT if where == platform}
    wanted = requirements(
        platform, python, *(EXTRAS if platform == "linux-x86_64" and python != "3.14" else ())
    )
    done = resolve([line for line in wanted if _name(line) not in absent], platform, python)
    assert done.returncode == 0, done.stderr
    # What is said to be absent is so: otherwise the table and the README are out of date.
    for line in wanted:
        if _name(line) in absent:
            assert resolve([line], platform, python).returncode != 0, line


def _name(line: str) -> str:
    return re.split(r"[<>=!~]", line, maxsplit=1)[0]
