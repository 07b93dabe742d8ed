"""The contact on a surface that balances a wrench, one or many."""

from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from contactsense.solvers.bodies.paper_surfaces import Placed
from contactsense.solvers.bodies.surface import EqualByFields, Problem, Surface, vectors
from contactsense.solvers.solution import Status
from contactsense.solvers.solver_batch import solve_rows
from contactsense.solvers.units import is_pure_force
from contactsense.solvers.wrench import wrench_of

Method = Literal["exact", "wrench_axis", "newton", "descent"]
_CANCELLED = 1e-15
"""A sum of three products that is larger than this, relative to its terms, is not zero."""


@dataclass(frozen=True, slots=True, eq=False)
class Solution(EqualByFields):
    """A soft-finger contact that balances a wrench, or the nearest surface point."""

    status: Status
    """Validity of the other fields."""
    centroid: np.ndarray
    """Contact centroid [m], shape (3,)."""
    normal: np.ndarray
    """Outward unit normal there, shape (3,)."""
    force: np.ndarray
    """Force on the body, as measured [N], shape (3,)."""
    moment: np.ndarray
    """Moment on the body about the frame's origin, as measured [Nm], shape (3,)."""
    torsion: float
    """Moment on the body about the outward normal [Nm]."""
    residual: float
    """Unbalanced moment, relative to moment and lever."""
    condition: float
    """Shift on the surface per shift of the force's line: 1 for a normal force on a plane, infinite for a
    tangential one. The shift is small, or that to the twin contact (`contactsense.solvers.solution`)."""
    method: Method = "exact"
    """How it was found."""

    @property
    def ok(self) -> bool:
        """Whether this is a contact."""
        return self.status == Status.OK


@dataclass(frozen=True, slots=True, eq=False)
class Solutions(EqualByFields):
    """One solution per row."""

    status: np.ndarray
    """Numbers of `Status`, shape (N,)."""
    centroid: np.ndarray
    """Contact centroids [m], shape (N, 3)."""
    normal: np.ndarray
    """Outward unit normals, shape (N, 3)."""
    force: np.ndarray
    """Forces on the body [N], shape (N, 3)."""
    moment: np.ndarray
    """Moments on the body about the frame's origin [Nm], shape (N, 3)."""
    torsion: np.ndarray
    """Moments about the normals [Nm], shape (N,)."""
    residual: np.ndarray
    """Relative residuals, shape (N,)."""
    condition: np.ndarray
    """Condition numbers, shape (N,)."""
    method: Method = "exact"
    """How they were found."""

    @property
    def ok(self) -> np.ndarray:
        """Which rows are contacts, shape (N,)."""
        return np.asarray(self.status == Status.OK)


METHODS: tuple[Method, ...] = get_args(Method)


def problem_of(surface: Surface, method: Method) -> Problem:
    """The kernel that solves a surface by a method, and its arguments after the wrench.

    Raises:
        ValueError: The method is unknown, or cannot solve this surface.
        TypeError: `surface` is none.
    """
    if isinstance(surface, type) or not hasattr(surface, "problem"):
        raise TypeError(f"surface: expected one such as Sphere(0.01), got {surface!r:.60}")
    if method == "exact":
        return surface.problem()
    if method == "wrench_axis":
        return surface.line_problem()
    if method not in METHODS:
        raise ValueError(f"no method {method!r}; there are {', '.join(METHODS)}")
    found: Problem | None = getattr(surface, f"{method}_problem", lambda: None)()
    if found is None:
        raise ValueError(f"{type(surface).__name__} cannot be solved by {method}")
    return found


def solve_wrench(surface: Surface, force: ArrayLike, moment: ArrayLike, method: Method = "exact") -> Solution:
    """Find where a wrench enters a surface.

    Args:
        surface: The surface.
        force: Force on the body [N], shape (3,).
        moment: Moment on the body about the frame's origin [Nm], shape (3,).
        method: `exact`, with torsion; `wrench_axis`, the paper's section 4, as if there were none; on
            spheres, ellipsoids and smooth bodies also `newton`; on spheres and ellipsoids also `descent`, the
            paper's section 6.

    Returns:
        The solution, in the frame of the wrench. No measurement makes this raise.

    Raises:
        ValueError: The method is unknown, or cannot solve this surface; force or moment has another shape.
        TypeError: `surface` is none.
    """
    f, m = vectors("force", force, 1), vectors("moment", moment, 1)
    if isinstance(surface, Placed):
        R, p = surface.rotation, surface.origin
        own = "wrench_axis" if method == "exact" and is_pure_force(wrench_of(f, m)) else method
        local = solve_wrench(surface.surface, R.T @ f, R.T @ (m - np.cross(p, f)), own)
        centroid, normal = p + R @ local.centroid, R @ local.normal
        return replace(local, centroid=centroid, normal=normal, force=f, moment=m, method=method)
    solver, size = problem_of(surface, method)
    answer = solver(wrench_of(f, m), *size)
    return Solution(
        Status(answer.status),
        np.array(answer.centroid),
        np.array(answer.normal),
        f,
        m,
        answer.torsion,
        answer.residual,
        answer.condition,
        method,
    )


def solve_batch(surface: Surface, force: ArrayLike, moment: ArrayLike, method: Method = "exact") -> Solutions:
    """Find where many wrenches enter a surface.

    Args:
        surface: The surface.
        force: Forces on the body [N], shape (N, 3).
        moment: Moments on the body about the frame's origin [Nm], shape (N, 3).
        method: As for `solve_wrench`.

    Returns:
        One solution per row, in the frame of the wrenches.

    Raises:
        ValueError: As for `solve_wrench`; or there are not as many moments as forces.
    """
    f, m = vectors("force", force, 2), vectors("moment", moment, 2)
    if len(f) != len(m):
        raise ValueError(f"moment: expected {len(f)} rows, as many as of force, not {len(m)}")
    if isinstance(surface, Placed):
        R, p = surface.rotation, surface.origin
        own_f, own_m = f @ R, (m - np.cross(p, f)) @ R
        local = solve_batch(surface.surface, own_f, own_m, method)
        if method == "exact" and len(pure := _pure_forces(f, m)) > 0:
            axis = solve_batch(surface.surface, own_f[pure], own_m[pure], "wrench_axis")
            for name in ("status", "centroid", "normal", "torsion", "residual", "condition"):
                getattr(local, name)[pure] = getattr(axis, name)
        return replace(local, centroid=p + local.centroid @ R.T, normal=local.normal @ R.T, force=f, moment=m)
    solver, size = problem_of(surface, method)
    wrenches = np.concatenate((f, m), axis=1)
    status = np.empty(len(wrenches), dtype=np.int64)
    out = np.empty((len(wrenches), 9))
    solve_rows(solver, wrenches, size, status, out)
    return Solutions(status, out[:, :3], out[:, 3:6], f, m, out[:, 6], out[:, 7], out[:, 8], method)


def _pure_forces(force: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """Rows that `is_pure_force` holds for, shape (K,); arguments of shape (N, 3)."""
    with np.errstate(all="ignore"):
        terms = force * moment
        near = np.abs(terms.sum(axis=1)) <= _CANCELLED * np.abs(terms).sum(axis=1)
    rows = [i for i in np.flatnonzero(near).tolist() if is_pure_force(wrench_of(force[i], moment[i]))]
    return np.array(rows, dtype=np.int64)
