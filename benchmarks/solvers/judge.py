"""Errors of the hard cases: against mpmath if there is a formula, else against the constructed contact."""

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from contactsense.benchmarks.solvers.accuracy import EPS, printed_of, reference_of
from contactsense.benchmarks.solvers.cases import DIGITS, Case
from contactsense.solvers import Placed, Solution, Status, Surface, solve


@dataclass(frozen=True)
class Verdict:
    """Result of a hard case."""

    case: Case
    found: Solution
    as_expected: bool
    """Whether the status is as expected."""
    error: float | None
    """Relative error, in ulps times the condition number; None without a reference."""
    printed: float | None
    """The same for the printed formula: NaN if it fails, None if the paper has none."""


def judge(case: Case) -> Verdict:
    """Solve a hard case and measure its error.

    Raises:
        ModuleNotFoundError: mpmath is not installed.
    """
    found = solve(case.surface, case.force, case.moment)
    allowed = (Status.OK, Status.TANGENT, Status.MISS) if case.decided_by_rounding else (case.status,)
    as_expected = found.status in allowed
    if not as_expected or Status.OK not in allowed:
        return Verdict(case, found, as_expected, None, None)
    true = _truth(case) if found.ok else [float(x) for x in case.centroid or ()]
    condition = found.condition if found.ok else _constructed_condition(case)
    scale = EPS * relative_condition(case, condition, true)
    error = _relative(found.centroid, true) / scale
    printed = printed_of(case.surface)
    theirs = None
    if printed is not None:
        with np.errstate(all="ignore"):
            there = printed(np.array([case.force]).T, np.array([case.moment]).T)[:, 0]
        theirs = _relative(there, true) / scale if np.all(np.isfinite(there)) else float("nan")
    return Verdict(case, found, as_expected, error, theirs)


def _constructed_condition(case: Case) -> float:
    """The condition number at the contact that was constructed (theory, section 4: |f| times the norm of
    M^-1)."""
    assert case.centroid is not None, case.name
    assert case.normal is not None, case.name
    n = np.array(case.normal)
    bend = case.torsion * case.surface.shape_operator(np.array(case.centroid), n)
    # J is a rotation by 90 degrees about n, so M acts in the tangent plane; its other singular value, of n
    # n^T, is ignored.
    turn = np.array(((0.0, -n[2], n[1]), (n[2], 0.0, -n[0]), (-n[1], n[0], 0.0)))
    force = np.array(case.force)
    least = np.linalg.svd(float(n @ force) * turn - bend, compute_uv=False)[1]
    return float(np.linalg.norm(force) / least)


def relative_condition(case: Case, condition: float, true: list[Any]) -> float:
    """Relative condition number of the centroid with respect to the wrench."""
    force = np.array(case.force)
    large = float(np.abs(force).max())
    lever = float(np.linalg.norm(np.array(case.moment) / large) / np.linalg.norm(force / large))
    distance = float(np.linalg.norm([float(x) for x in true]))
    return 1.0 + condition * (1.0 + lever / distance)


def _truth(case: Case) -> list[Any]:
    # Imported here, because it is a test dependency.
    mpmath: Any = import_module("mpmath")

    mpmath.mp.dps = DIGITS
    surface: Surface = case.surface
    number = mpmath.mpf
    f = np.array([[number(x)] for x in case.force])
    m = np.array([[number(x)] for x in case.moment])
    origin = np.array([[number(0)]] * 3)
    if isinstance(surface, Placed) and np.array_equal(surface.rotation, np.eye(3)):
        origin = np.array([[number(float(x))] for x in surface.origin])
        m = m - np.cross(origin[:, 0], f[:, 0])[:, None]
        surface = surface.surface
    reference = reference_of(surface, number)
    if reference is not None:
        # Zero has no sign in mpmath: the formula does not apply to tangent lines.
        return list((origin + reference(f, m))[:, 0])
    assert case.centroid is not None, case.name
    return [number(x) for x in case.centroid]


def _relative(found: np.ndarray, true: list[Any]) -> float:
    difference = [x - t for x, t in zip(found.tolist(), true, strict=True)]
    size = sum(t * t for t in true) ** 0.5
    return float(sum(d * d for d in difference) ** 0.5 / size)
