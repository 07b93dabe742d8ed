"""A program run with the code of another checkout of this repository, for comparisons in one run."""

import json
import os
import subprocess
import sys
from pathlib import Path

import click

HERE = Path(__file__).resolve().parents[2]
"""This checkout."""


def numbers_printed(folder: Path, cache: Path, program: str, *arguments: str) -> list[float]:
    """The list of numbers that a program prints as JSON, in a process of its own.

    Args:
        folder: The checkout whose code it imports.
        cache: Folder of its compiled kernels.
        program: Source of the program.
        arguments: Its arguments.

    Raises:
        click.ClickException: The program fails.
    """
    done = subprocess.run(
        [sys.executable, "-c", program, *arguments],
        cwd=folder,
        env={**os.environ, "NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
    )
    if done.returncode:
        raise click.ClickException(f"{folder}: {done.stderr.strip().splitlines()[-1]}")
    numbers: list[float] = json.loads(done.stdout)
    return numbers
