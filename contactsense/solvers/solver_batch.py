"""Many wrenches through one solver, in compiled code."""

from functools import lru_cache
from typing import Any

import numpy as np
from numba import njit

from contactsense.robots.jit.kernel import in_cache, kernel, with_names
from contactsense.solvers.bodies.surface import Kernel
from contactsense.solvers.closed_form.plane import solve_plane
from contactsense.solvers.wrench import Wrench


def solve_rows(
    solver: Kernel, wrenches: np.ndarray, size: tuple[Any, ...], status: np.ndarray, out: np.ndarray
) -> None:
    """Solve rows of wrenches (N, 6) into `status` (N,) and `out` (N, 9), the other fields of each answer.

    Args:
        solver, size: As `contactsense.solvers.solve_wrench.problem_of` returns them.
        wrenches, status, out: As above.
    """
    compiled_rows(solver)(wrenches, size, status, out)


@lru_cache(maxsize=64)
def compiled_rows(solver: Kernel) -> Any:
    """The loop over the rows with this solver compiled in; for a user's own body anew in each process, as its
    solver is."""
    bound = with_names(_rows, _solver=solver)
    return kernel(bound) if in_cache(solver) else njit(error_model="numpy")(bound)


_solver: Kernel = solve_plane
"""Each version of `_rows` has its own."""


def _rows(wrenches: np.ndarray, size: tuple[Any, ...], status: np.ndarray, out: np.ndarray) -> None:
    for i in range(wrenches.shape[0]):
        w = wrenches[i]
        answer = _solver(Wrench((w[0], w[1], w[2]), (w[3], w[4], w[5])), *size)
        status[i] = answer.status
        row = out[i]
        row[0], row[1], row[2] = answer.centroid
        row[3], row[4], row[5] = answer.normal
        row[6], row[7], row[8] = answer.torsion, answer.residual, answer.condition
