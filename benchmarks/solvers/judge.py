"""Errors of the hard cases: against the exact contact in mpmath, with its own condition number."""

from dataclasses import dataclass

import numpy as np

from contactsense.benchmarks.solvers.accuracy import printed_of, reference_of
from contactsense.benchmarks.solvers.cases import Case
from contactsense.benchmarks.solvers.level_sets import Vector, numbers, patches, vector
from contactsense.benchmarks.solvers.reference import Reference, cross, dot, error_in_ulps, normal_at, refine
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
    origin, local, moment = _in_its_frame(case)
    reference = _exact(case, origin, local, moment)
    if reference is None:
        # A force so nearly tangential that its rounded moment has no contact.
        return Verdict(case, found, case.decided_by_rounding, None, None)
    error = _error(found.centroid, reference, case, origin)
    printed = printed_of(case.surface)
    theirs = None
    if printed is not None:
        with np.errstate(all="ignore"):
            there = printed(np.array([case.force]).T, np.array([case.moment]).T)[:, 0]
        theirs = _error(there, reference, case, origin) if np.all(np.isfinite(there)) else float("nan")
    return Verdict(case, found, as_expected, error, theirs)


def _error(centroid: np.ndarray, reference: Reference, case: Case, origin: Vector) -> float:
    return error_in_ulps(centroid, reference, case.force, case.moment, origin)


def _in_its_frame(case: Case) -> tuple[Vector, Surface, Vector]:
    """Origin of the surface's frame, the surface in it, and the moment about that origin."""
    moment = vector(case.moment)
    if not isinstance(case.surface, Placed):
        return vector((0.0, 0.0, 0.0)), case.surface, moment
    assert np.array_equal(case.surface.rotation, np.eye(3)), case.name
    origin = vector(case.surface.origin)
    arm = cross(origin, vector(case.force))
    return origin, case.surface.surface, [a - b for a, b in zip(moment, arm, strict=True)]


def _exact(case: Case, origin: Vector, surface: Surface, moment: Vector) -> Reference | None:
    force = vector(case.force)
    if case.centroid is not None:
        start = [a - b for a, b in zip(vector(case.centroid), origin, strict=True)]
    else:
        formula = reference_of(surface, numbers().mpf)
        assert formula is not None, case.name
        start = list(formula(np.array([[x] for x in force]), np.array([[x] for x in moment]))[:, 0])
    # As a rule the one that holds the contact comes first; the others take long to fail.
    for patch in sorted(patches(case.same or surface), key=lambda patch: abs(patch.level(start)[0])):
        n = normal_at(patch, start)
        rest = [a - b for a, b in zip(moment, cross(start, force), strict=True)]
        found = refine(patch, force, moment, start, dot(rest, n))
        if found is not None:
            return found
    return None
