"""What an environment gets: declared dependencies, wheels for each platform, one importable name."""

import tomllib
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).parents[2]


def declared(*extras: str) -> list[Requirement]:
    """The dependencies in pyproject.toml, with those of these extras; of all extras for "*"."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    optional = project["optional-dependencies"]
    chosen = optional if "*" in extras else extras
    lines = [*project["dependencies"], *(line for extra in chosen for line in optional[extra])]
    return [Requirement(line) for line in lines]
