"""The most probable place of a contact on one link, from all of its windows together.

In each window the force f and the torsion xi are free; place c (fixed, or moving between knots), offset h of
the real surface and the biases b of the sensors are shared. With the wrench G u = (f, p x f + xi n), u = (f,
xi), p = c + h n, in the link's frame, a window's measurement in units of its noise is y = A G u + D b + e,
linear in u: u is eliminated window by window, and Gauss-Newton runs on what is shared. The priors are those
of `contactsense.localization.posterior`; those of lean and torsion count once for the whole contact, as what
a contact patch does in one window it does in the next.
"""

from dataclasses import dataclass

import numpy as np

from contactsense.localization.posterior import STUDENT_DOF, Prior
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.robots.surface.union import distances

ITERATIONS = 25
FIRST_STEPS = 3
"""After so many steps a search that is far from the best is given up."""
CONVERGED = 1e-2
"""Decrease of the energy that ends the search."""
SLIDING_SPEED = 0.2
"""Speed at which contacts slide over a link, standard deviation [m/s]."""
LEAST_SHARE = 0.2
"""Lean and torsion are measured by at least this part of the largest force."""


@dataclass(frozen=True, eq=False)
class LinkMeasurement:
    """What W windows say of a contact on one link, in units of the noise; m rows each."""

    value: np.ndarray
    """y, shape (W, m)."""
    matrix: np.ndarray
    """A: rows of a wrench in the link's frame, about its origin, shape (W, m, 6)."""
    bias: np.ndarray
    """D: rows of the biases, shape (W, m, B)."""
    bias_variance: np.ndarray
    """Variance of the biases before, shape (B,)."""
    t: np.ndarray
    """Middle of each window [s], shape (W,)."""


@dataclass(frozen=True, eq=False)
class Place:
    """A place on one link, in the link's frame."""

    link: int
    """Number of the link."""
    log_evidence: float
    """Logarithm of the evidence, up to a constant that all links share."""
    point: np.ndarray
    """Place in each window [m], shape (W, 3)."""
    normal: np.ndarray
    """Outward normal there, shape (W, 3)."""
    force: np.ndarray
    """Force in each window, link axes [N], shape (W, 3)."""
    covariance: np.ndarray
    """Covariance of the place in each window [m^2], shape (W, 3, 3)."""
    sliding: bool
    """Whether the place moves."""
    energy: float
    """Energy: half the squared residuals in units of the noise, and of what departs from the prior."""
    freedom: float
    """Degrees of freedom of the residuals: twice the energy that is expected where the model is right."""


class PlaceSearch:
    """The search on one link."""

    def __init__(
        self, surfaces: Surfaces, link: int, prior: Prior, measured: LinkMeasurement, knots: int
    ) -> None:
        """`knots`: 1 for a place that is fixed, else the number of places between which it moves."""
        self._surfaces, self._link, self._prior, self._m = surfaces, link, prior, measured
        windows = len(measured.t)
        self._share = 1.0 / windows
        self._times = np.linspace(measured.t[0], measured.t[-1], knots) if knots > 1 else measured.t[:1]
        hats = np.eye(knots)
        self._hat = (
            np.column_stack([np.interp(measured.t, self._times, row) for row in hats])
            if knots > 1
            else np.ones((windows, 1))
        )

    def run(self, start: np.ndarray, limit: float = np.inf) -> Place | None:
        """Search from a point near the surface, link frame [m]; None where no push fits, or where the energy
        is not below `limit` after a few steps."""
        knots, biases = len(self._times), self._m.bias.shape[2]
        places = np.repeat(start[None], knots, axis=0)
        places, _ = self._project(places)
        h, b = 0.0, np.zeros(biases)
        scale: np.ndarray | None = None
        state = self._evaluate(places, h, b, scale)
        for iteration in range(ITERATIONS):
            if iteration == FIRST_STEPS and state.energy > limit:
                return None
            scale = state.scale
            state = self._evaluate(places, h, b, scale)
            step = -np.linalg.solve(state.matrix, state.gradient)
            length = float(np.max(np.linalg.norm(step[: 3 * knots].reshape(-1, 3), axis=1)))
            size = min(1.0, 0.1 / max(length, 1e-12))
            gained = 0.0
            for _ in range(5):
                moved, _ = self._project(places + size * step[: 3 * knots].reshape(-1, 3))
                tried = self._evaluate(
                    moved, h + size * step[3 * knots], b + size * step[3 * knots + 1 :], scale
                )
                if tried.energy < state.energy:
                    gained = state.energy - tried.energy
                    places, h, b = moved, h + size * step[3 * knots], b + size * step[3 * knots + 1 :]
                    state = tried
                    break
                size *= 0.4
            if gained < CONVERGED:
                break
        return self._result(state, h)

    def _project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Nearest points of the link's surface, and normals there."""
        for _ in range(2):
            d, _, normal = distances(self._surfaces, np.ascontiguousarray(points), self._link)
            points = points - d[:, None] * normal
        return points, normal

    def _evaluate(self, places: np.ndarray, h: float, b: np.ndarray, scale: np.ndarray | None) -> "_State":
        m, prior = self._m, self._prior
        knots, biases = len(places), len(b)
        if knots == 1:
            c, n = self._project(places)
            c, n = (np.repeat(x, len(m.t), axis=0) for x in (c, n))
        else:
            c, n = self._project(self._hat @ places)
        p = c + h * n
        # Wrench of (f, xi) about the link's origin.
        G = np.zeros((len(m.t), 6, 4))
        G[:, :3, :3] = np.eye(3)
        G[:, 3:, :3] = _cross(p)
        G[:, 3:, 3] = n
        J = m.matrix @ G
        y = m.value - m.bias @ b
        rhs = np.einsum("wmi,wm->wi", J, y)
        H = np.einsum("wmi,wmk->wik", J, J)
        if scale is None:
            scale = np.full((len(m.t), 2), prior.force)
            scale[:, 1] = (STUDENT_DOF + 2.0) / STUDENT_DOF
        # Priors of torsion and lean, both relative to the force; and of the size of the force.
        P = np.zeros((len(m.t), 4, 4))
        F = scale[:, 0]
        tangential = np.eye(3) - np.einsum("wi,wk->wik", n, n)
        lean = self._share * scale[:, 1] / (prior.friction_ratio * F) ** 2
        P[:, :3, :3] = lean[:, None, None] * tangential
        P[:, :3, :3] += (0.25 * self._share / prior.force**2) * np.eye(3)
        P[:, 3, 3] = self._share / (prior.torsion_lever * F) ** 2
        H = H + P
        u = np.linalg.solve(H, rhs[..., None])[..., 0]
        e = y - np.einsum("wmi,wi->wm", J, u)
        d = places - np.roll(places, 1, axis=0)
        walk = 0.0
        if knots > 1:
            sigma = SLIDING_SPEED * (self._times[1] - self._times[0])
            walk = float(np.sum(d[1:] ** 2)) / sigma**2
        energy = 0.5 * (
            float(np.sum(e * e)) + float(np.einsum("wi,wik,wk->", u, P, u))
            + (h / prior.surface_deviation) ** 2 + float(np.sum(b * b / m.bias_variance)) + walk
        )  # fmt: skip
        # Shared unknowns: knots (3 each), offset, biases.
        f = u[:, :3]
        size = 3 * knots + 1 + biases
        dw = np.zeros((len(m.t), 6, size))
        turn = -_cross(f) @ tangential
        for k in range(knots):
            dw[:, 3:, 3 * k : 3 * k + 3] = self._hat[:, k, None, None] * turn
        dw[:, 3:, 3 * knots] = np.cross(n, f)
        Js = m.matrix @ dw
        Js[:, :, 3 * knots + 1 :] = m.bias
        Hus = np.einsum("wmi,wms->wis", J, Js)
        S = np.einsum("wms,wmr->sr", Js, Js) - np.einsum("wis,wir->sr", Hus, np.linalg.solve(H, Hus))
        g = -np.einsum("wms,wm->s", Js, e)
        S[3 * knots, 3 * knots] += 1.0 / prior.surface_deviation**2
        g[3 * knots] += h / prior.surface_deviation**2
        diagonal = np.arange(3 * knots + 1, size)
        S[diagonal, diagonal] += 1.0 / m.bias_variance
        g[diagonal] += b / m.bias_variance
        # Along the normal a place does not move; somewhere on the link it is.
        extent = 0.5 * float(np.max(self._surfaces.radius))
        S[np.arange(3 * knots), np.arange(3 * knots)] += 1.0 / extent**2
        if knots > 1:
            for k in range(1, knots):
                for i in range(3):
                    a, z = 3 * k + i, 3 * (k - 1) + i
                    S[a, a] += 1.0 / sigma**2
                    S[z, z] += 1.0 / sigma**2
                    S[a, z] -= 1.0 / sigma**2
                    S[z, a] -= 1.0 / sigma**2
                    g[a] += d[k, i] / sigma**2
                    g[z] -= d[k, i] / sigma**2
        push = -np.einsum("wi,wi->w", f, n)
        least = LEAST_SHARE * float(np.max(np.abs(push), initial=1e-3))
        F = np.maximum(np.abs(push), least)
        rho = np.sum(np.einsum("wik,wk->wi", tangential, f) ** 2, axis=1) / (prior.friction_ratio * F) ** 2
        weight = (STUDENT_DOF + 2.0) / (STUDENT_DOF + rho)
        return _State(energy, S, g, c, n, u, np.linalg.slogdet(H)[1].sum(), np.column_stack((F, weight)))

    def _result(self, state: "_State", h: float) -> Place | None:
        """What the search has ended with."""
        prior, knots = self._prior, len(self._times)
        f, n = state.u[:, :3], state.normal
        impulse = -np.einsum("wi,wi->", f, n)
        if impulse <= 0.0:
            return None
        sign, log_det = np.linalg.slogdet(state.matrix)
        if sign <= 0.0:
            return None
        F = state.scale[:, 0]
        log_prior = self._share * float(
            np.sum(
                -np.log(prior.torsion_lever * F / prior.force)
                - 2.0 * np.log(prior.friction_ratio * F / prior.force)
                - 0.5 * np.log(F / prior.force) ** 2
            )
        )
        extent = 0.5 * float(np.max(self._surfaces.radius))
        # The normal directions of the knots carry the ridge alone.
        log_prior += np.log(2.0 * np.pi / prior.area) - np.log(extent) * knots
        if knots > 1:
            sigma = SLIDING_SPEED * (self._times[1] - self._times[0])
            log_prior -= 2.0 * (knots - 1) * np.log(sigma)
        evidence = log_prior - state.energy - 0.5 * log_det - 0.5 * state.log_det_windows
        C = np.linalg.inv(state.matrix)[: 3 * knots + 1, : 3 * knots + 1]
        freedom = float(self._m.value.size - 4 * len(n))
        tangential = np.eye(3) - np.einsum("wi,wk->wik", n, n)
        map_ = np.zeros((len(n), 3, 3 * knots + 1))
        for k in range(knots):
            map_[:, :, 3 * k : 3 * k + 3] = self._hat[:, k, None, None] * tangential
        map_[:, :, 3 * knots] = n
        covariance = map_ @ C @ np.swapaxes(map_, 1, 2)
        return Place(
            self._link,
            float(evidence),
            state.point + h * n,
            n,
            f,
            covariance,
            knots > 1,
            state.energy,
            freedom,
        )


@dataclass(frozen=True, eq=False)
class _State:
    energy: float
    matrix: np.ndarray
    gradient: np.ndarray
    point: np.ndarray
    normal: np.ndarray
    u: np.ndarray
    log_det_windows: float
    scale: np.ndarray
    """Size of the normal force and weight of the lean's prior in each window, shape (W, 2)."""


def _cross(v: np.ndarray) -> np.ndarray:
    """Matrices of the cross product v x, shape (W, 3, 3)."""
    X = np.zeros((len(v), 3, 3))
    X[:, 0, 1], X[:, 0, 2] = -v[:, 2], v[:, 1]
    X[:, 1, 0], X[:, 1, 2] = v[:, 2], -v[:, 0]
    X[:, 2, 0], X[:, 2, 1] = -v[:, 1], v[:, 0]
    return X
