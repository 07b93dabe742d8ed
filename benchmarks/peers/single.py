"""Fit of one contact at one point to a measurement, and helpers of the particle filters."""

from math import exp

from contactsense.benchmarks.peers.friction import EDGES, columns, edges, gram
from contactsense.benchmarks.peers.stage import load, to_base, turned_to_base
from contactsense.robots.jit.kernel import allocating_kernel, kernel


@kernel
def add_contact(  # type: ignore[no-untyped-def]
    noise, motion, friction, link, place, normal, b, number, A, G, h, directions, rows
):
    """Add the four edge forces of one contact to the problem as contact `number`.

    Args:
        noise, motion: Sensors, and poses of the links.
        friction: Coefficient of friction.
        link, place, normal: The contact, in its link's frame.
        b: Measurement in units of its noise, shape (m,).
        number: Index of the contact: columns 4 `number` to 4 `number` + 3; previous columns are already
            filled.
        A, G, h: Columns as rows (columns, m), Gram matrix, A^T b; filled.
        directions: Filled: its edge forces in base axes, shape (4, 3).
        rows: Scratch, shape (m, 3).
    """
    nx, ny, nz = turned_to_base(motion, link, normal[0], normal[1], normal[2])
    x, y, z = to_base(motion, link, place[0], place[1], place[2])
    edges(nx, ny, nz, friction, directions)
    load(noise, motion, link, x, y, z, rows)
    first = EDGES * number
    columns(rows, directions, A, first)
    gram(A, b, first, first + EDGES, G, h)


@kernel
def force_of(directions, weights, first, out):  # type: ignore[no-untyped-def]
    """Force of a contact from the weights of its four edge forces; fills `out` (3,)."""
    for i in range(3):
        total = 0.0
        for k in range(EDGES):
            total += weights[first + k] * directions[k, i]
        out[i] = total


@allocating_kernel
def resample(rng, cost, chosen):  # type: ignore[no-untyped-def]
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
