"""Contacts of the joint optimization: where they start, and how they move on their primitives. Eight at a
time, see `contactsense.multi_contact.memory.joint_layout`."""

import math

import numpy as np

from contactsense.localization.surface.local_prior import nearest_cell, prior_in_cell, tilt_in_cell
from contactsense.localization.surface.mean_surface import mean_frame
from contactsense.localization.surface.placed_surface import PlacedSurface
from contactsense.multi_contact.joint.joint_energy import PRIMITIVE_EXTENT
from contactsense.multi_contact.memory.buffers import UNKNOWNS, JointState
from contactsense.robots.jit.kernel import fused_kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.surface.convex_primitives import Surfaces, project
from contactsense.robots.vectors import Vector, rotate_back, subtract, tangents, vector
from contactsense.solvers.posterior.contact_prior import Prior, pushing_force

from contactsense.multi_contact.memory.joint_layout import (  # isort: skip
    BNX, BNY, BNZ, BX, BY, BZ, D0, D1, D2, D3, D4, D5, D6, ENERGY, EXTENT, FORCE_PRIOR, FRICTION_RATIO, FX,
    FY, FZ, ITERATE, MOMENT_PRIOR, MOVES, MOVING, NX, NY, NZ, OFFSET, OFFSET_STEP, OX, OY, OZ, PX, PY, PZ,
    R00, R01, R02, R10, R11, R12, R20, R21, R22, SX, SY, SZ, TILT, TORSION, TX, TY, TZ,
)  # fmt: skip


@fused_kernel
def set_contact(
    surface: PlacedSurface,
    prior: Prior,
    joint: JointState,
    lane: int,
    i: int,
    p: int,
    point: Vector,
    force: Vector,
) -> None:
    """Set contact i of a lane to the point on primitive p nearest to a point [m], with a pushing force [N],
    base frame. Nothing was known of it before.

    The surface is that of the cell there: the primitive as moved to where the real one is on average, and how
    far it may be from that.
    """
    surfaces, deviations, _ = surface
    block = joint.contact[i]
    joint.primitive[i, lane] = p
    cell = _cell_at(surface, p, point)
    joint.cell[i, lane] = cell
    R, o = mean_frame(surface, p, cell)
    local = prior_in_cell(prior, deviations, cell)
    block[OFFSET_STEP + lane], block[FRICTION_RATIO + lane] = local.surface_deviation, local.friction_ratio
    block[TILT + lane] = tilt_in_cell(prior, deviations, cell)
    d = (point[0] - o[0], point[1] - o[1], point[2] - o[2])
    for k in range(3):
        at = k * LANES + lane
        block[R00 + at], block[R10 + at], block[R20 + at] = R[0, k], R[1, k], R[2, k]
        block[OX + at] = o[k]
        block[BX + at] = R[0, k] * d[0] + R[1, k] * d[1] + R[2, k] * d[2]
        block[FX + at] = force[k]
    _project(surfaces, joint.primitive[i], lane, block)
    _to_base_frame(block)
    block[TORSION + lane], block[OFFSET + lane] = 0.0, 0.0
    block[EXTENT + lane] = 1.0 / (PRIMITIVE_EXTENT * surfaces.radius[p]) ** 2
    block[FORCE_PRIOR + lane], block[MOMENT_PRIOR + lane] = 1.0, 1.0


@fused_kernel
def move_to_cells(
    surface: PlacedSurface, prior: Prior, first: int, count: int, lanes: int, joint: JointState
) -> bool:
    """Set the contacts that have left their cells to the surface of the cells that they are in now.

    Args:
        surface, prior, lanes, joint: After
            `contactsense.multi_contact.joint.joint_optimization.find_joint_modes`.
        first, count: The first contact that may be moved, and the number of all.

    Returns:
        Whether any has left its cell.
    """
    any_moved = False
    for j in range(lanes):
        if joint.lane[ENERGY, j] == math.inf:
            continue
        for i in range(first, count):
            block, p = joint.contact[i], joint.primitive[i, j]
            point, force = vector_of(block, PX, j), vector_of(block, FX, j)
            if _cell_at(surface, p, point) == joint.cell[i, j]:
                continue
            torsion = block[TORSION + j]
            set_contact(surface, prior, joint, j, i, p, point, force)
            push = pushing_force(force, vector_of(block, NX, j))
            for k in range(3):
                block[FX + k * LANES + j] = push[k]
            block[TORSION + j] = torsion
            any_moved = True
    return any_moved


@fused_kernel
def _cell_at(surface: PlacedSurface, p: int, point: Vector) -> int:
    """Cell of primitive p at the point of its surface that is nearest to a point [m], base frame; -1 without
    cells."""
    surfaces, deviations, frames = surface
    local = rotate_back(frames.rotation[p], subtract(point, vector(frames.origin[p])))
    _, x, y, z, _, _, _ = project(surfaces.kind[p], surfaces.size[p], local[0], local[1], local[2])
    return nearest_cell(deviations, p, x, y, z)


@fused_kernel
def vector_of(block: np.ndarray, quantity: int, lane: int) -> Vector:
    """Three numbers of a lane, such as those at `PX`."""
    return (
        float(block[quantity + lane]),
        float(block[quantity + LANES + lane]),
        float(block[quantity + 2 * LANES + lane]),
    )


@fused_kernel
def _project(surfaces: Surfaces, primitive: np.ndarray, lane: int, block: np.ndarray) -> None:
    """Replace a point in the body frame by the nearest one on the surface, with its normal."""
    p = primitive[lane]
    (
        _, block[BX + lane], block[BY + lane], block[BZ + lane], block[BNX + lane], block[BNY + lane],
        block[BNZ + lane],
    ) = project(
        surfaces.kind[p], surfaces.size[p], block[BX + lane], block[BY + lane], block[BZ + lane]
    )  # fmt: skip


@fused_kernel
def _to_base_frame(block: np.ndarray) -> None:
    """Points, normals and tangents in the base frame."""
    for j in range(LANES):
        x, y, z = block[BX + j], block[BY + j], block[BZ + j]
        u, v, w = block[BNX + j], block[BNY + j], block[BNZ + j]
        block[PX + j] = block[OX + j] + block[R00 + j] * x + block[R01 + j] * y + block[R02 + j] * z
        block[PY + j] = block[OY + j] + block[R10 + j] * x + block[R11 + j] * y + block[R12 + j] * z
        block[PZ + j] = block[OZ + j] + block[R20 + j] * x + block[R21 + j] * y + block[R22 + j] * z
        n = (
            block[R00 + j] * u + block[R01 + j] * v + block[R02 + j] * w,
            block[R10 + j] * u + block[R11 + j] * v + block[R12 + j] * w,
            block[R20 + j] * u + block[R21 + j] * v + block[R22 + j] * w,
        )
        s, t = tangents(n)
        block[NX + j], block[NY + j], block[NZ + j] = n
        block[SX + j], block[SY + j], block[SZ + j] = s
        block[TX + j], block[TY + j], block[TZ + j] = t


@fused_kernel
def save_iterate(count: int, joint: JointState) -> None:
    """Save the iterates of all lanes."""
    for i in range(count):
        block = joint.contact[i]
        for q in range(ITERATE):
            block[ITERATE + q] = block[q]
    for q in range(joint.residual.shape[0]):
        joint.saved_residual[q] = joint.residual[q]


@fused_kernel
def restore_iterate(count: int, joint: JointState) -> None:
    """Go back to the saved iterate in the lanes of `MOVING`."""
    for i in range(count):
        block = joint.contact[i]
        for j in range(LANES):
            if joint.lane[MOVING, j] > 0.0:
                for q in range(j, ITERATE, LANES):
                    block[q] = block[ITERATE + q]


@fused_kernel
def take_step(
    surfaces: Surfaces, prior: Prior, count: int, length: np.ndarray, step: np.ndarray, joint: JointState
) -> None:
    """Take a step from the saved iterate, in the lanes of `MOVING`.

    Args:
        surfaces, prior, count, joint: As for
            `contactsense.multi_contact.joint.joint_optimization.find_joint_modes`.
        length: Factor of the step in each lane.
        step: What is subtracted from the unknowns.
    """
    moving = joint.lane[MOVING]
    for i in range(count):
        block = joint.contact[i]
        for a in range(UNKNOWNS):
            for j in range(LANES):
                block[D0 + a * LANES + j] = length[j] * step[(i * UNKNOWNS + a) * LANES + j]
        for j in range(LANES):
            block[MOVES + j] = moving[j]
        _move(prior, block)
        for j in range(LANES):
            if moving[j] > 0.0:
                _project(surfaces, joint.primitive[i], j, block)
        _to_base_frame(block)


@fused_kernel
def _move(prior: Prior, block: np.ndarray) -> None:
    """New forces, torsions and offsets; and points off the surface, in the body frame."""
    for j in range(LANES):
        moves = block[MOVES + j] > 0.0
        before = ITERATE + j
        n = (block[before + NX], block[before + NY], block[before + NZ])
        s = (block[before + SX], block[before + SY], block[before + SZ])
        t = (block[before + TX], block[before + TY], block[before + TZ])
        f0, f1, f2 = block[before + FX], block[before + FY], block[before + FZ]
        F = -(n[0] * f0 + n[1] * f1 + n[2] * f2)
        growth = 1.0 - block[D0 + j]
        scale = -block[FRICTION_RATIO + j] * F
        a, b = scale * block[D1 + j], scale * block[D2 + j]
        g0, g1, g2 = (
            growth * f0 + a * s[0] + b * t[0],
            growth * f1 + a * s[1] + b * t[1],
            growth * f2 + a * s[2] + b * t[2],
        )
        torsion = growth * block[before + TORSION] - prior.torsion_lever * F * block[D3 + j]
        offset = block[before + OFFSET] - block[OFFSET_STEP + j] * block[D6 + j]
        v1, v2 = block[D4 + j], block[D5 + j]
        x = block[before + PX] - v1 * s[0] - v2 * t[0] - block[OX + j]
        y = block[before + PY] - v1 * s[1] - v2 * t[1] - block[OY + j]
        z = block[before + PZ] - v1 * s[2] - v2 * t[2] - block[OZ + j]
        bx = block[R00 + j] * x + block[R10 + j] * y + block[R20 + j] * z
        by = block[R01 + j] * x + block[R11 + j] * y + block[R21 + j] * z
        bz = block[R02 + j] * x + block[R12 + j] * y + block[R22 + j] * z
        block[FX + j] = g0 if moves else block[FX + j]
        block[FY + j] = g1 if moves else block[FY + j]
        block[FZ + j] = g2 if moves else block[FZ + j]
        block[TORSION + j] = torsion if moves else block[TORSION + j]
        block[OFFSET + j] = offset if moves else block[OFFSET + j]
        block[BX + j] = bx if moves else block[BX + j]
        block[BY + j] = by if moves else block[BY + j]
        block[BZ + j] = bz if moves else block[BZ + j]
