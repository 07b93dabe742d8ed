"""Derivatives of the wrench of one of several contacts, and what its priors add to matrix and gradient.

The unknowns and the energy are those of `contactsense.multi_contact.joint.joint_energy`. With unit normal n,
unit tangents s and t, the place c + h n and the curvatures k along the tangents, a unit step along s turns
the normal by k11 s + k12 t and moves the place by s + h (k11 s + k12 t); along t likewise.
"""

from typing import NamedTuple

import numpy as np

from contactsense.kinematics.wrench_information import cross, dot, symmetric_matvec, transposed_matvec
from contactsense.robots.jit.kernel import fused_kernel, inlined_fused_kernel
from contactsense.robots.jit.lanes import LANES
from contactsense.robots.vectors import Vector
from contactsense.solvers.posterior.contact_prior import STUDENT_DOF, Prior

from contactsense.multi_contact.memory.joint_layout import (  # isort: skip
    EXTENT, FORCE_PRIOR, FRICTION_RATIO, FX, FY, FZ, JACOBIAN, LOG_FORCE, MOMENT_PRIOR, NX, NY, NZ, OFFSET,
    OFFSET_STEP, PRIOR_GRADIENT, PRIOR_MATRIX, PX, PY, PZ, R00, R01, R02, R10, R11, R12, R20, R21, R22, S00,
    S01, S02, S11, S12, S22, SX, SY, SZ, TORSION, TORSION_STEP, TX, TY, TZ, W0,
)  # fmt: skip


class _Contact(NamedTuple):
    """A contact, base axes."""

    normal: Vector
    """Outward unit normal n."""
    tangents: tuple[Vector, Vector]
    """Unit tangents s and t."""
    force: Vector
    """Force on the arm [N]."""
    normal_force: float
    """F = -n . f, positive [N]."""
    torsion: float
    """xi [Nm]."""
    offset: float
    """h, of the real surface from the primitive [m]."""


@fused_kernel
def linearize_contacts(prior: Prior, block: np.ndarray) -> None:
    """Derivatives of the wrenches of one contact in all lanes, and what its priors add.

    Args:
        prior: Prior of contacts.
        block: Of `contactsense.multi_contact.memory.joint_layout`, with places, forces, wrenches, shape
            operators and logarithms of the forces; `JACOBIAN`, `TORSION_STEP`, `PRIOR_GRADIENT` and
            `PRIOR_MATRIX` are filled.
    """
    inverse_lever = 1.0 / prior.torsion_lever
    for j in range(LANES):
        contact = _contact(j, block)
        curvature = _curvature(j, contact.tangents, block)
        _put_jacobian(j, prior.torsion_lever, contact, curvature, block)
        _put_prior(j, inverse_lever, contact, curvature, block)


@inlined_fused_kernel
def _contact(j: int, block: np.ndarray) -> _Contact:
    """The contact in lane j; one that pulls has next to no normal force."""
    n, f = (block[NX + j], block[NY + j], block[NZ + j]), (block[FX + j], block[FY + j], block[FZ + j])
    s, t = (block[SX + j], block[SY + j], block[SZ + j]), (block[TX + j], block[TY + j], block[TZ + j])
    return _Contact(n, (s, t), f, max(-dot(n, f), 1e-300), block[TORSION + j], block[OFFSET + j])


@inlined_fused_kernel
def _curvature(j: int, tangents: tuple[Vector, Vector], block: np.ndarray) -> Vector:
    """Curvatures (k11, k12, k22) along the tangents of lane j [1/m]."""
    R = (
        (block[R00 + j], block[R01 + j], block[R02 + j]),
        (block[R10 + j], block[R11 + j], block[R12 + j]),
        (block[R20 + j], block[R21 + j], block[R22 + j]),
    )
    S = block[S00 + j], block[S01 + j], block[S02 + j], block[S11 + j], block[S12 + j], block[S22 + j]
    s, t = transposed_matvec(R, tangents[0]), transposed_matvec(R, tangents[1])
    turn_s, turn_t = symmetric_matvec(S, s), symmetric_matvec(S, t)
    return dot(s, turn_s), dot(t, turn_s), dot(t, turn_t)


@inlined_fused_kernel
def _put_jacobian(j: int, lever: float, contact: _Contact, curvature: Vector, block: np.ndarray) -> None:
    """Derivatives of the wrench, one unknown after the other; torsion, steps and offset change no force."""
    n, (s, t), f, F, xi, h = contact
    k11, k12, k22 = curvature
    place = (block[PX + j] + h * n[0], block[PY + j] + h * n[1], block[PZ + j] + h * n[2])
    G = JACOBIAN + j
    for k in range(6):  # by the logarithm of the force: the wrench itself
        block[G + k * LANES] = block[W0 + k * LANES + j]
    scale = block[FRICTION_RATIO + j] * F
    a, b = (scale * s[0], scale * s[1], scale * s[2]), (scale * t[0], scale * t[1], scale * t[2])
    _put(a, G + 6 * LANES, block)
    _put(cross(place, a), G + 9 * LANES, block)
    _put(b, G + 12 * LANES, block)
    _put(cross(place, b), G + 15 * LANES, block)
    torsion = lever * F
    block[TORSION_STEP + j] = torsion
    _put((torsion * n[0], torsion * n[1], torsion * n[2]), G + 21 * LANES, block)
    e11, e12, e22 = 1.0 + h * k11, h * k12, 1.0 + h * k22
    _put(_moment_of_step(contact, (e11, e12), (xi * k11, xi * k12)), G + 27 * LANES, block)
    _put(_moment_of_step(contact, (e12, e22), (xi * k12, xi * k22)), G + 33 * LANES, block)
    deviation, moment = block[OFFSET_STEP + j], cross(n, f)
    _put((deviation * moment[0], deviation * moment[1], deviation * moment[2]), G + 39 * LANES, block)


@inlined_fused_kernel
def _moment_of_step(contact: _Contact, move: tuple[float, float], turn: tuple[float, float]) -> Vector:
    """Moment of the force at the place moved along the tangents, and of the torsion as the normal turns."""
    s, t = contact.tangents
    (a, b), (c, d) = move, turn
    m = cross((a * s[0] + b * t[0], a * s[1] + b * t[1], a * s[2] + b * t[2]), contact.force)
    return (
        m[0] + c * s[0] + d * t[0],
        m[1] + c * s[1] + d * t[1],
        m[2] + c * s[2] + d * t[2],
    )


@inlined_fused_kernel
def _put(a: Vector, at: int, block: np.ndarray) -> None:
    """Put three numbers into a lane, from an index on."""
    block[at], block[at + LANES], block[at + 2 * LANES] = a


@inlined_fused_kernel
def _put_prior(j: int, inverse_lever: float, contact: _Contact, curvature: Vector, block: np.ndarray) -> None:
    """What the priors add. With constant force and torsion, a step turns the normal and so changes the
    ratios."""
    _, (s, t), f, F, xi, h = contact
    k11, k12, k22 = curvature
    alpha, beta, inverse_ratio = dot(s, f) / F, dot(t, f) / F, 1.0 / block[FRICTION_RATIO + j]
    q1, q2 = -(alpha * k11 + beta * k12), -(alpha * k12 + beta * k22)
    chi = xi * inverse_lever / F
    # How much the priors of the force, and of torsion and offset, count.
    wf, wm = block[FORCE_PRIOR + j], block[MOMENT_PRIOR + j]
    # Weight of the Student t term: the factor that gives a quadratic the same gradient.
    squared_ratio = (alpha * alpha + beta * beta) * inverse_ratio * inverse_ratio
    ww = wf * (STUDENT_DOF + 2.0) / (STUDENT_DOF + squared_ratio)
    a4, a5 = inverse_ratio * (k11 - alpha * q1), inverse_ratio * (k12 - alpha * q2)
    b4, b5 = inverse_ratio * (k12 - beta * q1), inverse_ratio * (k22 - beta * q2)
    ra, rb = ww * inverse_ratio * alpha, ww * inverse_ratio * beta
    lf, one = wf * block[LOG_FORCE + j], wf + wm * chi * chi
    g = PRIOR_GRADIENT + j
    block[g], block[g + LANES], block[g + 2 * LANES], block[g + 3 * LANES] = lf, ra, rb, wm * chi
    block[g + 4 * LANES] = lf * q1 - wm * chi * chi * q1 + ra * a4 + rb * b4
    block[g + 5 * LANES] = lf * q2 - wm * chi * chi * q2 + ra * a5 + rb * b5
    block[g + 6 * LANES] = wm * h / block[OFFSET_STEP + j]
    H = PRIOR_MATRIX + j
    block[H], block[H + 2 * LANES] = wf, ww
    block[H + 5 * LANES], block[H + 9 * LANES] = ww, wm
    _put((wf * q1, ww * a4, ww * b4), H + 10 * LANES, block)
    block[H + 13 * LANES] = -wm * chi * q1
    block[H + 14 * LANES] = one * q1 * q1 + ww * (a4 * a4 + b4 * b4) + block[EXTENT + j]
    _put((wf * q2, ww * a5, ww * b5), H + 15 * LANES, block)
    block[H + 18 * LANES] = -wm * chi * q2
    block[H + 19 * LANES] = one * q1 * q2 + ww * (a4 * a5 + b4 * b5)
    block[H + 20 * LANES] = one * q2 * q2 + ww * (a5 * a5 + b5 * b5) + block[EXTENT + j]
    block[H + 27 * LANES] = wm
