"""Fit of one contact at one point to a measurement, and helpers of the particle filters."""

from math import exp
from typing import NamedTuple

import numpy as np

from contactsense.benchmarks.peers.friction import EDGES, columns, edges, gram, solve
from contactsense.benchmarks.peers.stage import Stage, load, to_base, turned_to_base
from contactsense.robots.jit.kernel import allocating_kernel, kernel


class Problem(NamedTuple):
    """Least squares over the edge forces of several contacts: m measurements, four columns per contact."""

    b: np.ndarray
    """Measurement in units of its noise, shape (m,)."""
    A: np.ndarray
    """Columns as rows, shape (columns, m)."""
    G: np.ndarray
    """Gram matrix, shape (columns, columns)."""
    h: np.ndarray
    """A^T b, shape (columns,)."""
    x: np.ndarray
    """Weights of the edge forces, shape (columns,)."""
    L: np.ndarray
    """Scratch of `solve`, as the next two, shape (columns, columns)."""
    s: np.ndarray
    """Shape (columns,)."""
    order: np.ndarray
    """Shape (columns,), int64."""
    directions: np.ndarray
    """Edge forces of each contact in the order of the columns, base axes, shape (contacts, 4, 3)."""
    rows: np.ndarray
    """Scratch: measurement by force of one contact, shape (m, 3)."""


@allocating_kernel
def new_problem(contacts: int, m: int) -> Problem:
    """Arrays for up to that many contacts and m measurements."""
    width = EDGES * contacts
    return Problem(
        np.empty(m), np.empty((width, m)), np.empty((width, width)), np.empty(width), np.empty(width),
        np.empty((width, width)), np.empty(width), np.empty(width, dtype=np.int64),
        np.empty((contacts, EDGES, 3)), np.empty((m, 3)),
    )  # fmt: skip


@kernel
def add_contact(
    stage: Stage, link: int, place: np.ndarray, normal: np.ndarray, number: int, problem: Problem
) -> None:
    """Add the four edge forces of one contact to the problem as contact `number`.

    Args:
        stage: Sensors, poses of the links, and friction.
        link, place, normal: The contact, in its link's frame.
        number: Index of the contact: columns 4 `number` to 4 `number` + 3; previous columns are already
            filled.
        problem: The columns, their products and `directions` are filled.
    """
    nx, ny, nz = turned_to_base(stage.motion, link, normal[0], normal[1], normal[2])
    x, y, z = to_base(stage.motion, link, place[0], place[1], place[2])
    directions, first = problem.directions[number], EDGES * number
    edges(nx, ny, nz, stage.friction, directions)
    load(stage.noise, stage.motion, link, x, y, z, problem.rows)
    columns(problem.rows, directions, problem.A, first)
    gram(problem.A, problem.b, first, first + EDGES, problem.G, problem.h)


@kernel
def solve_contacts(problem: Problem, square: float, count: int) -> float:
    """Find the forces of the first `count` contacts; `square`: b^T b. Returns the squared residual."""
    return solve(problem.G, problem.h, square, EDGES * count, problem.x, problem.L, problem.s, problem.order)


@allocating_kernel
def resample(rng: np.random.Generator, cost: np.ndarray, chosen: np.ndarray) -> None:
    """Systematic resampling: fills `chosen` (K,) with particle indices, each in proportion to its weight.

    Args:
        rng: A NumPy generator.
        cost: Squared residual of each particle in units of the noise, shape (K,): weight exp(-cost / 2).
        chosen: Filled, int64.
    """
    count = cost.shape[0]
    least = cost.min()
    total = 0.0
    for i in range(count):
        total += exp(-0.5 * (cost[i] - least))
    step = total / count
    at = step * rng.random()
    reached = 0.0
    k = 0
    for i in range(count):
        reached += exp(-0.5 * (cost[i] - least))
        while k < count and at <= reached:
            chosen[k] = i
            k += 1
            at += step
    while k < count:
        chosen[k] = chosen[k - 1]
        k += 1
