"""The measurement as rows in units of the noise, and which rows see contacts on which link."""

import math

from contactsense.arm import Arm
from contactsense.memory import Memory
from contactsense.several.memory import Rows
from robots.compiled import fused_kernel


@fused_kernel
def fill_rows(
    arm: Arm,
    memory: Memory,
    has_base: bool,
    has_torque: bool,
    has_wrist: bool,
    scale: float,
    rows: Rows,
) -> int:
    """Write the external parts in `memory` as rows of variance one; returns how many.

    Args:
        arm: The scene's constants.
        memory: With poses and external parts.
        has_base, has_torque, has_wrist: Which sensors have a value.
        scale: Factor on all variances of the scene's noise.
        rows: Filled.
    """
    A, y, seen = rows.matrix, rows.value, rows.seen
    A[:] = 0.0
    seen[:] = 0.0
    links = seen.shape[0]
    m = 0
    if has_base:
        # Upper factor U of the information matrix U^T U: U times the noise has unit variance.
        for i in range(6):
            for k in range(i, 6):
                x = arm.sensors.base_information[i, k] / scale
                for r in range(i):
                    x -= A[r, i] * A[r, k]
                A[i, k] = math.sqrt(x) if k == i else x / A[i, i]
        for i in range(6):
            y[i] = 0.0
            for k in range(i, 6):
                y[i] += A[i, k] * memory.base_wrench[k]
            for link in range(links):
                seen[link, i] = 1.0
        m = 6
    if has_torque:
        for j in range(memory.torque.shape[0]):
            weight = 1.0 / math.sqrt(arm.sensors.torque_variance[j] * scale + memory.unexplained[j] ** 2)
            for k in range(6):
                A[m, k] = memory.motion.screw[j, k] * weight
            y[m] = memory.torque[j] * weight
            for link in range(links):
                if arm.sensors.depth[link] > j:
                    seen[link, m] = 1.0
            m += 1
    if has_wrist:
        ox, oy, oz = memory.wrist_origin[0], memory.wrist_origin[1], memory.wrist_origin[2]
        force = 1.0 / math.sqrt(arm.sensors.wrist_variance[0] * scale)
        moment = 1.0 / math.sqrt(arm.sensors.wrist_variance[1] * scale)
        for i in range(3):
            A[m + i, i] = force
            A[m + 3 + i, 3 + i] = moment
        # Moment about the sensor's origin: m - o x f.
        A[m + 3, 1], A[m + 3, 2] = oz * moment, -oy * moment
        A[m + 4, 0], A[m + 4, 2] = -oz * moment, ox * moment
        A[m + 5, 0], A[m + 5, 1] = oy * moment, -ox * moment
        for _ in range(6):
            y[m] = 0.0
            for k in range(6):
                y[m] += A[m, k] * memory.wrist_wrench[k]
            for link in range(links):
                if arm.sensors.beyond_wrist[link]:
                    seen[link, m] = 1.0
            m += 1
    return m


@fused_kernel
def rank_of(rows, m, links, count, scratch):  # type: ignore[no-untyped-def]
    """Rank of the map from the wrenches of contacts on `links` to the rows: how many numbers the sensors say.

    Args:
        rows, m: The measurement and the number of its rows.
        links: Numbers of the touched links, shape (>= count,).
        count: Number of contacts.
        scratch: Shape (>= m, >= 6 * count).
    """
    n = 6 * count
    for r in range(m):
        size = 0.0
        for k in range(6):
            size = max(size, abs(rows.matrix[r, k]))
        for i in range(count):
            for k in range(6):
                scratch[r, 6 * i + k] = rows.seen[links[i], r] * rows.matrix[r, k] / size
    rank = 0
    for _ in range(min(m, n)):
        # Gauss elimination with full pivoting.
        best, row, column = 1e-9, -1, -1
        for r in range(rank, m):
            for c in range(n):
                if abs(scratch[r, c]) > best:
                    best, row, column = abs(scratch[r, c]), r, c
        if row < 0:
            break
        for c in range(n):
            scratch[row, c], scratch[rank, c] = scratch[rank, c], scratch[row, c]
        for r in range(rank + 1, m):
            factor = scratch[r, column] / scratch[rank, column]
            for c in range(n):
                scratch[r, c] -= factor * scratch[rank, c]
            scratch[r, column] = 0.0
        rank += 1
    return rank
