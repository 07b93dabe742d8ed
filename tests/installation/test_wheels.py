"""There are wheels of all that is declared, wherever the README says that contactsense runs."""

from typing import NamedTuple

import httpx
import pytest
from packaging.requirements import Requirement
from packaging.tags import mac_platforms

from tests.installation import declared, wheel_index
from tests.installation.wheel_index import Target, has_wheel, lacking, wheels


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
    "macos-arm64": Platform("darwin", "Darwin", "arm64", tuple(mac_platforms((14, 0), "arm64"))),
    "macos-x86_64": Platform("darwin", "Darwin", "x86_64", tuple(mac_platforms((14, 0), "x86_64"))),
    "windows-amd64": Platform("win32", "Windows", "AMD64", ("win_amd64",)),
}
EXTRAS = ("geometry", "mcap", "notebook", "fleet", "truth")
"""Extras that are looked for too, where developers and CI install them; elsewhere only what runs."""
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
ABSENT = {
    ("llvmlite", "macos-x86_64"): "it has no wheels for Intel Macs any more",
    ("numba", "macos-x86_64"): "it needs llvmlite",
}
"""(package, platform) -> why there is no wheel; the README's line on platforms says the same."""


def target(platform: str, python: str) -> Target:
    """What wheels must be for."""
    chosen = PLATFORMS[platform]
    markers = {
        "sys_platform": chosen.sys_platform,
        "platform_system": chosen.platform_system,
        "platform_machine": chosen.platform_machine,
        "os_name": "nt" if chosen.sys_platform == "win32" else "posix",
        "python_version": python,
        "python_full_version": f"{python}.0",
        "implementation_name": "cpython",
        "platform_python_implementation": "CPython",
    }
    return Target(python, chosen.tags, markers)


def requirements(wanted: Target, *extras: str) -> list[Requirement]:
    """What is declared for this target."""
    return [
        requirement
        for requirement in declared(*extras)
        if requirement.marker is None or requirement.marker.evaluate(dict(wanted.markers))
    ]


@pytest.fixture(scope="session")
def index() -> None:
    """Skips without a package index."""
    try:
        wheels("lazy_loader")
    except httpx.HTTPError as error:
        pytest.skip(f"no package index: {error}")


@pytest.mark.slow
@pytest.mark.usefixtures("index")
@pytest.mark.parametrize("python", PYTHONS)
@pytest.mark.parametrize("platform", PLATFORMS)
def test_every_dependency_has_a_wheel(platform: str, python: str) -> None:
    absent = {name for name, where in ABSENT if where == platform}
    wanted = target(platform, python)
    asked = requirements(wanted, *(EXTRAS if platform == "linux-x86_64" and python != "3.14" else ()))
    assert lacking([each for each in asked if each.name not in absent], wanted) == []
    # What is said to be absent is so: otherwise the table and the README are out of date.
    for each in asked:
        assert each.name not in absent or lacking([each], wanted), each


@pytest.mark.slow
@pytest.mark.usefixtures("index")
@pytest.mark.parametrize(
    ("line", "platform", "there"),
    [
        ("numpy", "linux-x86_64", True),
        ("numpy<1", "linux-x86_64", False),
        ("ur-rtde", "linux-x86_64", True),
        ("ur-rtde", "macos-arm64", False),
        ("embreex", "linux-aarch64", False),
    ],
)
def test_a_wheel_is_seen_to_be_there_or_not(line: str, platform: str, there: bool) -> None:
    assert has_wheel(Requirement(line), target(platform, "3.11")) is there


def test_what_a_package_needs_is_looked_at_too(monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = [Requirement("pydantic")]
    monkeypatch.setattr(wheel_index, "has_wheel", lambda requirement, _: requirement.name != "pydantic-core")
    (found,) = lacking(wanted, target("linux-x86_64", "3.12"))
    assert found.startswith("pydantic-core")
