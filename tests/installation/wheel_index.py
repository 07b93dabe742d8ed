"""The wheels that the package index has, by the tags in their names; none is loaded.

What a package needs is read from the one that is installed here: all wheels of a version declare the same.
"""

import functools
import os
from collections.abc import Iterable, Iterator, Mapping
from importlib.metadata import PackageNotFoundError, requires
from typing import NamedTuple

import httpx
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.tags import Tag, compatible_tags, cpython_tags
from packaging.utils import InvalidWheelFilename, canonicalize_name, parse_wheel_filename
from packaging.version import Version

from tests.installation import ROOT

INDEX = os.environ.get("PIP_INDEX_URL", "https://pypi.org/simple").rstrip("/")
"""The index that pip asks."""
JSON = "application/vnd.pypi.simple.v1+json"
"""An index lists its files in this form (PEP 691)."""


class Wheel(NamedTuple):
    """A wheel in the index."""

    version: Version
    tags: frozenset[Tag]
    pythons: SpecifierSet
    """Versions of Python that it is for."""


class Target(NamedTuple):
    """What wheels are wanted for."""

    python: str
    platforms: tuple[str, ...]
    """Tags of platforms, the best first."""
    markers: Mapping[str, str]
    """Values of environment markers."""


@functools.cache
def wheels(name: str) -> tuple[Wheel, ...]:
    """All wheels of that package.

    Raises:
        httpx.HTTPError: The index does not answer, or not in JSON.
    """
    answer = httpx.get(
        f"{INDEX}/{canonicalize_name(name)}/", headers={"Accept": JSON}, timeout=60.0, follow_redirects=True
    )
    answer.raise_for_status()
    if JSON not in answer.headers["content-type"]:
        raise httpx.DecodingError(f"{INDEX}: expected {JSON}, got {answer.headers['content-type']}")
    return tuple(_wheels(answer.json()["files"]))


def _wheels(files: Iterable[Mapping[str, object]]) -> Iterator[Wheel]:
    for file in files:
        try:
            _, version, _, tags = parse_wheel_filename(str(file["filename"]))
        except InvalidWheelFilename:
            continue  # a source archive
        if not file.get("yanked"):
            yield Wheel(version, tags, SpecifierSet(str(file.get("requires-python") or "")))


@functools.cache
def pinned() -> Mapping[str, str]:
    """Versions in constraints.txt, by canonical name."""
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    return {canonicalize_name(name): version for name, version in (line.split("==") for line in lines)}


def has_wheel(requirement: Requirement, target: Target) -> bool:
    """Whether a wheel for the target meets the requirement, in the pinned version if there is one."""
    version = pinned().get(canonicalize_name(requirement.name))
    wanted = requirement.specifier & SpecifierSet(f"=={version}" if version else "")
    interpreter = tuple(int(part) for part in target.python.split("."))
    tags = {
        *cpython_tags(interpreter, platforms=target.platforms),
        *compatible_tags(interpreter, f"cp{target.python.replace('.', '')}", target.platforms),
    }
    return any(
        wheel.version in wanted and f"{target.python}.0" in wheel.pythons and not tags.isdisjoint(wheel.tags)
        for wheel in wheels(requirement.name)
    )


def lacking(wanted: Iterable[Requirement], target: Target) -> list[str]:
    """Requirements without a wheel for the target, among those wanted and all that these need in turn."""
    found = []
    waiting, seen = list(wanted), set()
    while waiting:
        requirement = waiting.pop()
        key = (canonicalize_name(requirement.name), str(requirement.specifier), frozenset(requirement.extras))
        if key in seen:
            continue
        seen.add(key)
        if not has_wheel(requirement, target):
            found.append(str(requirement))
        waiting += _needs(requirement, target)
    return found


def _needs(requirement: Requirement, target: Target) -> Iterator[Requirement]:
    try:
        lines = requires(requirement.name) or ()
    except PackageNotFoundError:
        return  # only other platforms need it
    for needed in map(Requirement, lines):
        extras = ("", *requirement.extras)
        if needed.marker is None or any(
            needed.marker.evaluate({**target.markers, "extra": extra}) for extra in extras
        ):
            yield needed
