"""Command-line options that the benchmarks of moving arms share."""

from collections.abc import Callable, Iterable
from typing import Any

import click

from contactsense.benchmarks.motion.streams import SUITES
from contactsense.benchmarks.static_truth.cases import COLUMNS
from contactsense.service.cli.options.finite_range import FiniteRange

MODELS = {"exact": (False,), "wrong": (True,), "both": (False, True)}
"""Choice -> whether mass and friction are wrong, one run each."""
Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


def suites(default: tuple[str, ...]) -> Decorator:
    """`--suite`: which runs."""
    return click.option(
        "--suite",
        "suites",
        multiple=True,
        type=click.Choice(SUITES),
        default=default,
        show_default=True,
        help="Suite; may be repeated.",
    )


def levels(default: Iterable[int] = range(len(COLUMNS))) -> Decorator:
    """`--level`: how much noise."""
    return click.option(
        "--level",
        "levels",
        multiple=True,
        type=click.IntRange(0, len(COLUMNS) - 1),
        default=tuple(default),
        show_default=True,
        help=f"Noise column, 0 (none) to {len(COLUMNS) - 1}; may be repeated.",
    )


def model(default: str) -> Decorator:
    """`--model`: whether what is assumed about the arm is true."""
    return click.option(
        "--model",
        type=click.Choice(list(MODELS)),
        default=default,
        show_default=True,
        help="Masses and friction exact, or 2 % and 5 % wrong.",
    )


def velocity_noise() -> Decorator:
    """`--velocity-noise`: how much noise the joint velocities have."""
    return click.option(
        "--velocity-noise",
        type=FiniteRange(0.0),
        default=0.0,
        show_default=True,
        help="Standard deviation of the velocities of joints that move [rad/s]; about 0.001 on a real UR10e.",
    )


def draws(default: int) -> Decorator:
    """`--draws`: how often each run is repeated."""
    return click.option(
        "--draws",
        type=click.IntRange(1),
        default=default,
        show_default=True,
        help="Repetitions of each run, each with other noise; all samples are evaluated together.",
    )
