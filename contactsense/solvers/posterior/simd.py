"""Energies and Gauss-Newton steps of one contact on each of up to eight primitives, with the formulas of
`contactsense.solvers.posterior.equations`.

Loops over the lanes of a block are vectorized by the compiler as long as they contain arithmetic only. The
first `lanes` are in use; all lanes of their halves are computed, and the caller passes over the others.
"""

import numpy as np

from contactsense.kinematics.linalg.ldl import ldl_solve_unrolled
from contactsense.kinematics.spatial import Six
from contactsense.kinematics.wrench_information import matvec, rotate_block, shift_information
from contactsense.robots.jit.array_views import view
from contactsense.robots.jit.kernel import fused_kernel, inlined_fused_kernel
from contactsense.robots.jit.lanes import HALF, LANES
from contactsense.robots.surface.convex_primitives import REVOLVED, project
from contactsense.robots.surface.simd_revolved import Profile, curvature_revolved, profile, project_revolved
from contactsense.robots.vectors import Vector
from contactsense.solvers.posterior.contact_prior import Contact, Prior
from contactsense.solvers.posterior.equations import (
    Information,
    energy_of,
    inflate,
)
from contactsense.solvers.posterior.gauss_newton import gauss_newton_equations

from contactsense.solvers.posterior.block import (  # isort: skip
    AX, AY, AZ, BX, BY, BZ, CX, CY, CZ, D00, D01, D02, D10, D11, D12, D20, D21, D22, DECREASE, DET,
    DISTANCE, ENERGY, F00, F01, F02, F11, F12, F22, FRICTION_RATIO, FX, FY, FZ, GAIN, KXX, KXY, KXZ, KYY,
    KYZ, KZZ, LENGTH, LOG_FORCE, M00, M01, M02, M11, M12, M22, NORMAL_FORCE, NX, NY, NZ, OFFSET_VARIANCE,
    OX, OY, OZ, P0, P1, P2, P3, P4, P5, P6, QX, QY, QZ, R00, R01, R02, R10, R11, R12, R20, R21, R22,
    RADIUS, S0, S1, S2, S3, S4, S5, SCALE, SEARCH, T1X, T1Y, T1Z, T2X, T2Y, T2Z, TRIAL_ENERGY,
    TRIAL_LOG_FORCE, U0, U1, U2, U3, U4, U5, V11, V12, V22, VARIANCE_RATIO, W0, W1, W2, W3, W4, W5, XI,
)  # fmt: skip


@fused_kernel
def load_primitive(j: int, kind: int, size: np.ndarray, radius: float, block: np.ndarray) -> None:
    """Put a primitive into lane j.

    kind, size, radius: as in `contactsense.robots.surface.convex_primitives.Surfaces`. One that is no body of
    revolution is replaced by the can about its bounding ball: what depends on its shape is for the caller.
    """
    h, R0, R1, r = (size[0], size[1], size[2], size[3]) if kind == REVOLVED else (radius, radius, radius, 0.0)
    P = profile(h, R0, R1, r)
    for i in range(7):
        block[P0 + LANES * i + j] = P[i]
    block[RADIUS + j] = radius


@fused_kernel
def load_wrench(j: int, w: np.ndarray, L: np.ndarray, block: np.ndarray) -> None:
    """Put a fused wrench and its information matrix, shapes (6,) and (6, 6), into lane j."""
    for i in range(6):
        block[W0 + LANES * i + j] = w[i]
    block[F00 + j], block[F01 + j], block[F02 + j] = L[0, 0], L[0, 1], L[0, 2]
    block[F11 + j], block[F12 + j], block[F22 + j] = L[1, 1], L[1, 2], L[2, 2]
    block[M00 + j], block[M01 + j], block[M02 + j] = L[3, 3], L[3, 4], L[3, 5]
    block[M11 + j], block[M12 + j], block[M22 + j] = L[4, 4], L[4, 5], L[5, 5]
    for i in range(3):
        for k in range(3):
            block[D00 + LANES * (3 * i + k) + j] = L[i + 3, k]


@fused_kernel
def scale_information(factor: float, block: np.ndarray) -> None:
    """Multiply the information matrices of all lanes by a factor."""
    for i in range(F00, M22 + LANES):
        block[i] *= factor


@fused_kernel
def load_frame(j: int, R: np.ndarray, o: np.ndarray, block: np.ndarray) -> None:
    """Put a body frame into lane j: its axes (columns) and its origin in the base frame [m]."""
    for i in range(3):
        block[OX + LANES * i + j] = o[i]
        for k in range(3):
            block[R00 + LANES * (3 * i + k) + j] = R[i, k]


@inlined_fused_kernel
def load_prior(j: int, prior: Prior, block: np.ndarray) -> None:
    """Put the prior of a contact about its place into lane j."""
    block[FRICTION_RATIO + j] = prior.friction_ratio
    block[OFFSET_VARIANCE + j] = prior.surface_deviation * prior.surface_deviation


@fused_kernel
def wrenches_to_body_frames(block: np.ndarray) -> None:
    """Transform the wrenches and their information matrices from the base frame to the body frames, as
    `contactsense.kinematics.wrench_information.to_body_frame` does."""
    for j in range(LANES):
        x, y, z = block[OX + j], block[OY + j], block[OZ + j]
        w = _wrench(j, block)
        axes = (
            (block[R00 + j], block[R10 + j], block[R20 + j]),
            (block[R01 + j], block[R11 + j], block[R21 + j]),
            (block[R02 + j], block[R12 + j], block[R22 + j]),
        )
        force = matvec(axes, (w[0], w[1], w[2]))
        moment = matvec(
            axes, (w[3] - y * w[2] + z * w[1], w[4] - z * w[0] + x * w[2], w[5] - x * w[1] + y * w[0])
        )
        F, D, M = shift_information(*_information(j, block), x, y, z)
        F, D, M = rotate_block(axes, F), rotate_block(axes, D), rotate_block(axes, M)
        block[W0 + j], block[W1 + j], block[W2 + j] = force
        block[W3 + j], block[W4 + j], block[W5 + j] = moment
        block[F00 + j], block[F01 + j], block[F02 + j] = F[0]
        block[F11 + j], block[F12 + j], block[F22 + j] = F[1][1], F[1][2], F[2][2]
        block[D00 + j], block[D01 + j], block[D02 + j] = D[0]
        block[D10 + j], block[D11 + j], block[D12 + j] = D[1]
        block[D20 + j], block[D21 + j], block[D22 + j] = D[2]
        block[M00 + j], block[M01 + j], block[M02 + j] = M[0]
        block[M11 + j], block[M12 + j], block[M22 + j] = M[1][1], M[1][2], M[2][2]


@inlined_fused_kernel
def project_place(j: int, place: Vector, block: np.ndarray) -> None:
    """Surface point nearest to a place beside the surface in lane j, of a body of revolution."""
    x, y, z = place
    distance, ax, ay, az, bx, by, bz = project_revolved(_profile(j, block), x, y, z)
    block[QX + j], block[QY + j], block[QZ + j] = x, y, z
    block[DISTANCE + j] = distance
    block[AX + j], block[AY + j], block[AZ + j] = ax, ay, az
    block[BX + j], block[BY + j], block[BZ + j] = bx, by, bz


@fused_kernel
def project_others(kind: np.ndarray, size: np.ndarray, primitives: np.ndarray, block: np.ndarray) -> None:
    """`project_place` of primitives that are no bodies of revolution.

    Args:
        kind, size: Primitives, as in `contactsense.robots.surface.convex_primitives.Surfaces`.
        primitives: The number of that of each lane in use, shape (lanes,), int64.
        block: The block.
    """
    for j in range(primitives.shape[0]):
        p = primitives[j]
        if kind[p] != REVOLVED:
            distance, ax, ay, az, bx, by, bz = project(
                kind[p], size[p], block[QX + j], block[QY + j], block[QZ + j]
            )
            block[DISTANCE + j] = distance
            block[AX + j], block[AY + j], block[AZ + j] = ax, ay, az
            block[BX + j], block[BY + j], block[BZ + j] = bx, by, bz


@inlined_fused_kernel
def _profile(j: int, block: np.ndarray) -> Profile:
    return (
        block[P0 + j], block[P1 + j], block[P2 + j], block[P3 + j], block[P4 + j], block[P5 + j],
        block[P6 + j],
    )  # fmt: skip


@inlined_fused_kernel
def _wrench(j: int, block: np.ndarray) -> Six:
    return block[W0 + j], block[W1 + j], block[W2 + j], block[W3 + j], block[W4 + j], block[W5 + j]


@inlined_fused_kernel
def _information(j: int, block: np.ndarray) -> Information:
    f01, f02, f12 = block[F01 + j], block[F02 + j], block[F12 + j]
    m01, m02, m12 = block[M01 + j], block[M02 + j], block[M12 + j]
    return (
        ((block[F00 + j], f01, f02), (f01, block[F11 + j], f12), (f02, f12, block[F22 + j])),
        (
            (block[D00 + j], block[D01 + j], block[D02 + j]),
            (block[D10 + j], block[D11 + j], block[D12 + j]),
            (block[D20 + j], block[D21 + j], block[D22 + j]),
        ),
        ((block[M00 + j], m01, m02), (m01, block[M11 + j], m12), (m02, m12, block[M22 + j])),
    )


@inlined_fused_kernel
def contact_of(j: int, block: np.ndarray) -> Contact:
    """The contact in lane j."""
    return Contact(
        (block[CX + j], block[CY + j], block[CZ + j]),
        (block[NX + j], block[NY + j], block[NZ + j]),
        (block[FX + j], block[FY + j], block[FZ + j]),
        block[XI + j],
    )


@fused_kernel
def shape_operators(lanes: int, block: np.ndarray) -> None:
    """Shape operators at the contacts, as if all primitives were bodies of revolution."""
    for first in range(0, lanes, HALF):
        half = view(block, first, (LENGTH - first,))
        for j in range(HALF):
            K = curvature_revolved(
                _profile(j, half), half[CX + j], half[CY + j], half[NX + j], half[NY + j], half[NZ + j]
            )
            half[KXX + j], half[KXY + j], half[KXZ + j] = K[0], K[1], K[2]
            half[KYY + j], half[KYZ + j], half[KZZ + j] = K[3], K[4], K[5]


@fused_kernel
def gauss_newton_steps(torsion_lever: float, lanes: int, block: np.ndarray) -> None:
    """Gauss-Newton step from each contact, and the Gauss-Newton matrix there.

    Where no search goes on (`SEARCH` is not positive), a lane keeps its `ENERGY`, `DET`, `VARIANCE_RATIO` and
    `V11` to `T2Z`.
    """
    for first in range(0, lanes, HALF):
        half = view(block, first, (LENGTH - first,))
        for j in range(HALF):
            contact, information = contact_of(j, half), _information(j, half)
            inflation = inflate(information, half[OFFSET_VARIANCE + j], contact)
            u, gain, variance_ratio = inflation
            shape_operator = (
                half[KXX + j], half[KXY + j], half[KXZ + j],
                half[KYY + j], half[KYZ + j], half[KZZ + j],
            )  # fmt: skip
            H, g, (t1, t2), energy = gauss_newton_equations(
                _wrench(j, half), information, half[FRICTION_RATIO + j], torsion_lever, inflation,
                shape_operator, contact, half[LOG_FORCE + j],
            )  # fmt: skip
            det, positive, decrease, (v11, v12, v22), s = ldl_solve_unrolled(H, g)
            half[S0 + j], half[S1 + j], half[S2 + j] = s[0], s[1], s[2]
            half[S3 + j], half[S4 + j], half[S5 + j] = s[3], s[4], s[5]
            half[U0 + j], half[U1 + j], half[U2 + j] = u[0], u[1], u[2]
            half[U3 + j], half[U4 + j], half[U5 + j] = u[3], u[4], u[5]
            half[GAIN + j], half[DECREASE + j] = gain, decrease
            active = half[SEARCH + j] > 0.0
            half[ENERGY + j] = energy if active else half[ENERGY + j]
            half[DET + j] = (det if positive else 0.0) if active else half[DET + j]
            half[VARIANCE_RATIO + j] = variance_ratio if active else half[VARIANCE_RATIO + j]
            half[V11 + j] = v11 if active else half[V11 + j]
            half[V12 + j] = v12 if active else half[V12 + j]
            half[V22 + j] = v22 if active else half[V22 + j]
            half[T1X + j] = t1[0] if active else half[T1X + j]
            half[T1Y + j] = t1[1] if active else half[T1Y + j]
            half[T1Z + j] = t1[2] if active else half[T1Z + j]
            half[T2X + j] = t2[0] if active else half[T2X + j]
            half[T2Y + j] = t2[1] if active else half[T2Y + j]
            half[T2Z + j] = t2[2] if active else half[T2Z + j]


@fused_kernel
def project_trials(lanes: int, block: np.ndarray) -> None:
    """Project the places to which the steps lead onto the surfaces, of bodies of revolution."""
    for first in range(0, lanes, HALF):
        half = view(block, first, (LENGTH - first,))
        for j in range(HALF):
            v1, v2 = -half[SCALE + j] * half[S4 + j], -half[SCALE + j] * half[S5 + j]
            place = (
                half[CX + j] + v1 * half[T1X + j] + v2 * half[T2X + j],
                half[CY + j] + v1 * half[T1Y + j] + v2 * half[T2Y + j],
                half[CZ + j] + v1 * half[T1Z + j] + v2 * half[T2Z + j],
            )
            project_place(j, place, half)


@inlined_fused_kernel
def trial_of(j: int, block: np.ndarray) -> Contact:
    """The contact that is tried in lane j."""
    scale = block[SCALE + j]
    return Contact(
        (block[AX + j], block[AY + j], block[AZ + j]),
        (block[BX + j], block[BY + j], block[BZ + j]),
        (
            block[FX + j] - scale * block[S0 + j],
            block[FY + j] - scale * block[S1 + j],
            block[FZ + j] - scale * block[S2 + j],
        ),
        block[XI + j] - scale * block[S3 + j],
    )


@fused_kernel
def energies_of_trials(torsion_lever: float, median_force: float, lanes: int, block: np.ndarray) -> None:
    """Energies of the contacts that are tried, with the inflation of the contacts from which they start."""
    for first in range(0, lanes, HALF):
        half = view(block, first, (LENGTH - first,))
        for j in range(HALF):
            u = (
                half[U0 + j], half[U1 + j], half[U2 + j], half[U3 + j], half[U4 + j], half[U5 + j],
            )  # fmt: skip
            energy, normal_force, log_force = energy_of(
                _wrench(j, half),
                _information(j, half),
                half[FRICTION_RATIO + j],
                torsion_lever,
                median_force,
                (u, half[GAIN + j], 1.0),
                trial_of(j, half),
            )
            half[TRIAL_ENERGY + j], half[NORMAL_FORCE + j] = energy, normal_force
            half[TRIAL_LOG_FORCE + j] = log_force


@inlined_fused_kernel
def store_contact(j: int, contact: Contact, log_force: float, block: np.ndarray) -> None:
    """Put a contact into lane j, and the log of its normal force relative to the prior's."""
    (cx, cy, cz), (nx, ny, nz), (fx, fy, fz), xi = contact
    block[CX + j], block[CY + j], block[CZ + j] = cx, cy, cz
    block[NX + j], block[NY + j], block[NZ + j] = nx, ny, nz
    block[FX + j], block[FY + j], block[FZ + j] = fx, fy, fz
    block[XI + j], block[LOG_FORCE + j] = xi, log_force
