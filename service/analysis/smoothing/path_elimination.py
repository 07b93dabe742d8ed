"""Energy of a path of contact places, its gradient and Gauss-Newton matrix, from all windows of a contact.

In each window w a contact at p = c + h n acts with the force f and the torsion xi, u = (f, xi): the wrench in
the link's frame is G u = (f, p x f + xi n). With the measurement's rows A, the biases b and their rows D the
residuals are y - A G u - D b. Here A and y come as L = A^T A, a = A^T y and M = A^T D, summed over a window's
rows. Each window's u is linear and is eliminated (Schur complement). What is left are the unknowns that
windows share: two tangential coordinates and the surface's offset h at each knot of the path, and b.
"""

import math

import numpy as np

from contactsense.kinematics.linalg.cholesky import cholesky
from contactsense.robots.jit.kernel import kernel
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.robots.surface.union import nearest
from contactsense.robots.vectors import Vector, add_scaled, cross, dot, scale, tangents, vector
from contactsense.service.analysis.smoothing.path_arrays import EliminationArrays, PathArrays, WindowSums
from contactsense.service.analysis.smoothing.surface_way import fill_chord_fractions


@kernel
def project_knots(surfaces: Surfaces, link: int, places: np.ndarray, frames: np.ndarray) -> None:
    """Move places (K, 3), link frame, to the link's surface; fill `frames` (K, 2, 3) with tangents."""
    for k in range(places.shape[0]):
        normal = (0.0, 0.0, 1.0)
        for _ in range(2):
            place, normal = _nearest(surfaces, link, vector(places[k]))
            places[k, 0], places[k, 1], places[k, 2] = place
        for i, tangent in enumerate(tangents(normal)):
            frames[k, i, 0], frames[k, i, 1], frames[k, i, 2] = tangent


@kernel
def eliminate_forces(
    surfaces: Surfaces,
    link: int,
    prior_rows: np.ndarray,
    windows: WindowSums,
    path: PathArrays,
    b: np.ndarray,
    out: EliminationArrays,
    derivatives: bool,
) -> float:
    """Eliminate force and torsion of every window.

    Args:
        surfaces: Primitives of all links.
        link: The link.
        prior_rows: Precision of tangential force, any force and torsion in each window, shape (W, 3).
        windows: L, a and M of each window, see `WindowSums`.
        path: Knots on the surface and their tangents, and between which knots a window lies, see
            `PathArrays`.
        b: Biases, shape (B,).
        out: Results, see `EliminationArrays`; matrix and gradient are added to.
        derivatives: Whether matrix and gradient are asked for.

    Returns:
        Sum over the windows of -1/2 r^T H^-1 r, r being the right-hand side of the equations for u and H
        their matrix; infinite where a window does not determine u.
    """
    L, a, M = windows.information, windows.value, windows.bias
    biases, knots = b.shape[0], path.places.shape[0]
    energy = 0.0
    G, LG, H, E = out.G, out.LG, out.H, out.E
    fill_chord_fractions(surfaces, link, path)
    for w in range(a.shape[0]):
        place, normal = _place(w, surfaces, link, path, out)
        _fill_moments(place, normal, G)
        # a - M b, the right-hand side of a free wrench.
        for i in range(6):
            s = a[w, i]
            for k in range(biases):
                s -= M[w, i, k] * b[k]
            out.rhs[i] = s
        _normal_equations(L[w], G, LG, H, out.rhs, out.r)
        _add_prior(prior_rows[w], normal, H)
        for i in range(4):
            for k in range(i + 1):
                out.total[i, k] += H[i, k]
        if cholesky(H, 4) == math.inf:
            return math.inf
        u = out.u[w]
        energy -= _solve(H, out.r, u)
        if not derivatives:
            continue
        k = path.knot[w]
        _fill_moment_changes(w, path, normal, vector(u), E)
        _scatter(L[w], M[w], out, u, k, min(k + 1, knots - 1), knots)
    return energy


@kernel
def _nearest(surfaces: Surfaces, link: int, place: Vector) -> tuple[Vector, Vector]:
    """Nearest point of the link's surface, and the outward normal there."""
    _, _, point, normal = nearest(surfaces, surfaces.start[link], surfaces.start[link + 1], place)
    return point, normal


@kernel
def _place(
    w: int, surfaces: Surfaces, link: int, path: PathArrays, out: EliminationArrays
) -> tuple[Vector, Vector]:
    """Place of a window, by the surface's offset outside the primitives, and normal there; fills `out.point`
    and `out.normal`."""
    knots = path.places.shape[0]
    k, alpha = path.knot[w], path.fraction[w]
    following = min(k + 1, knots - 1)
    if w > 0 and knots == 1:
        point, normal = vector(out.point[0]), vector(out.normal[0])
    else:
        c = path.chord[w]
        a, b = scale(1.0 - c, vector(path.places[k])), vector(path.places[following])
        point, normal = _nearest(surfaces, link, add_scaled(a, c, b))
    out.point[w, 0], out.point[w, 1], out.point[w, 2] = point
    out.normal[w, 0], out.normal[w, 1], out.normal[w, 2] = normal
    h = (1.0 - alpha) * path.offset[k] + alpha * path.offset[following]
    return add_scaled(point, h, normal), normal


@kernel
def _fill_moments(place: Vector, normal: Vector, G: np.ndarray) -> None:
    """The lower half of G: moments of unit forces and of unit torsion."""
    x, y, z = place
    nx, ny, nz = normal
    G[3, 0], G[3, 1], G[3, 2], G[3, 3] = 0.0, -z, y, nx
    G[4, 0], G[4, 1], G[4, 2], G[4, 3] = z, 0.0, -x, ny
    G[5, 0], G[5, 1], G[5, 2], G[5, 3] = -y, x, 0.0, nz


@kernel
def _add_prior(precision: np.ndarray, normal: Vector, H: np.ndarray) -> None:
    """Add the precisions of tangential force, any force and torsion, shape (3,), to H (lower triangle)."""
    lean, size, torsion = precision[0], precision[1], precision[2]
    nx, ny, nz = normal
    H[0, 0] += lean * (1.0 - nx * nx) + size
    H[1, 1] += lean * (1.0 - ny * ny) + size
    H[2, 2] += lean * (1.0 - nz * nz) + size
    H[1, 0] -= lean * nx * ny
    H[2, 0] -= lean * nx * nz
    H[2, 1] -= lean * ny * nz
    H[3, 3] += torsion


@kernel
def _solve(factor: np.ndarray, r: np.ndarray, u: np.ndarray) -> float:
    """Fill u = H^-1 r, given the Cholesky factor of H; returns 1/2 r^T H^-1 r."""
    half = 0.0
    for i in range(4):
        s = r[i]
        for k in range(i):
            s -= factor[i, k] * u[k]
        u[i] = s / factor[i, i]
        half += 0.5 * u[i] * u[i]
    for i in range(3, -1, -1):
        s = u[i]
        for k in range(i + 1, 4):
            s -= factor[k, i] * u[k]
        u[i] = s / factor[i, i]
    return half


@kernel
def _fill_moment_changes(w: int, path: PathArrays, normal: Vector, force: Vector, E: np.ndarray) -> None:
    """Change of a window's moment by the unknowns of the knots before and after it: tangents and offset."""
    k, alpha = path.knot[w], path.fraction[w]
    following = min(k + 1, path.places.shape[0] - 1)
    for c in range(6):
        knot, weight = (k, 1.0 - alpha) if c < 3 else (following, alpha)
        move = normal
        if c % 3 < 2:
            tangent = vector(path.frames[knot, c % 3])
            move = add_scaled(tangent, -dot(tangent, normal), normal)
        E[c, 0], E[c, 1], E[c, 2] = cross(scale(weight, move), force)


@kernel
def _normal_equations(
    L: np.ndarray, G: np.ndarray, LG: np.ndarray, H: np.ndarray, rhs: np.ndarray, r: np.ndarray
) -> None:
    """L G; lower triangle of H = G^T L G; r = G^T rhs. The upper half of G is (1 0)."""
    for i in range(6):
        for k in range(3):
            LG[i, k] = L[i, k] + L[i, 3] * G[3, k] + L[i, 4] * G[4, k] + L[i, 5] * G[5, k]
        LG[i, 3] = L[i, 3] * G[3, 3] + L[i, 4] * G[4, 3] + L[i, 5] * G[5, 3]
    for i in range(4):
        r[i] = G[3, i] * rhs[3] + G[4, i] * rhs[4] + G[5, i] * rhs[5]
        if i < 3:
            r[i] += rhs[i]
        for k in range(i + 1):
            H[i, k] = G[3, i] * LG[3, k] + G[4, i] * LG[4, k] + G[5, i] * LG[5, k]
            if i < 3:
                H[i, k] += LG[i, k]


@kernel
def _scatter(
    L: np.ndarray, M: np.ndarray, out: EliminationArrays, u: np.ndarray, k0: int, k1: int, knots: int
) -> None:
    """Add one window's part of the Schur complement to the matrix, and that of the gradient."""
    G, LG, Y, index = out.G, out.LG, out.Y, out.unknown
    local = 6 + M.shape[1]
    # What is left of the right-hand side once the wrench is explained.
    for i in range(6):
        out.rhs[i] -= LG[i, 0] * u[0] + LG[i, 1] * u[1] + LG[i, 2] * u[2] + LG[i, 3] * u[3]
    for i in range(3):
        out.wrench[i] = u[i]
        out.wrench[3 + i] = G[3 + i, 0] * u[0] + G[3 + i, 1] * u[1] + G[3 + i, 2] * u[2] + G[3 + i, 3] * u[3]
    for c in range(3):
        index[c], index[3 + c] = 3 * k0 + c, 3 * k1 + c
    for c in range(6, local):
        index[c] = 3 * knots + c - 6
    _scatter_direct(L, M, out)
    _solve_coupling(M, out)
    for c in range(local):
        for d in range(local):
            out.matrix[index[c], index[d]] -= (
                Y[0, c] * Y[0, d] + Y[1, c] * Y[1, d] + Y[2, c] * Y[2, d] + Y[3, c] * Y[3, d]
            )


@kernel
def _solve_coupling(M: np.ndarray, out: EliminationArrays) -> None:
    """Y = chol(H)^-1 [G^T L E, G^T M]: how the window's wrench depends on the other unknowns."""
    G, LG, H, Y, E = out.G, out.LG, out.H, out.Y, out.E
    for c in range(6 + M.shape[1]):
        for i in range(4):
            if c < 6:
                s = LG[3, i] * E[c, 0] + LG[4, i] * E[c, 1] + LG[5, i] * E[c, 2]
            else:
                s = G[3, i] * M[3, c - 6] + G[4, i] * M[4, c - 6] + G[5, i] * M[5, c - 6]
                if i < 3:
                    s += M[i, c - 6]
            for k in range(i):
                s -= H[i, k] * Y[k, c]
            Y[i, c] = s / H[i, i]


@kernel
def _scatter_direct(L: np.ndarray, M: np.ndarray, out: EliminationArrays) -> None:
    """Add the part of matrix and gradient that does not come from eliminating the window's wrench."""
    E, S, g, index = out.E, out.matrix, out.gradient, out.unknown
    local = 6 + M.shape[1]
    for c in range(6):
        e0 = L[3, 3] * E[c, 0] + L[3, 4] * E[c, 1] + L[3, 5] * E[c, 2]
        e1 = L[4, 3] * E[c, 0] + L[4, 4] * E[c, 1] + L[4, 5] * E[c, 2]
        e2 = L[5, 3] * E[c, 0] + L[5, 4] * E[c, 1] + L[5, 5] * E[c, 2]
        g[index[c]] -= E[c, 0] * out.rhs[3] + E[c, 1] * out.rhs[4] + E[c, 2] * out.rhs[5]
        for d in range(6):
            S[index[c], index[d]] += e0 * E[d, 0] + e1 * E[d, 1] + e2 * E[d, 2]
        for d in range(6, local):
            s = M[3, d - 6] * E[c, 0] + M[4, d - 6] * E[c, 1] + M[5, d - 6] * E[c, 2]
            S[index[c], index[d]] += s
            S[index[d], index[c]] += s
    for c in range(6, local):
        s = 0.0
        for i in range(6):
            s += M[i, c - 6] * out.wrench[i]
        g[index[c]] += s
