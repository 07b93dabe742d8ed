"""The most probable path of a contact on one link, from all of its windows together.

In each window the force f and the torsion xi are free; the path of the place (one knot: a fixed place), the
offset h of the real surface at its knots and the biases b of the sensors are shared.
`contactsense.service.analysis.smoothing.path_elimination` eliminates force and torsion; Gauss-Newton runs on
what is shared. The prior of the motion is that of `contactsense.service.analysis.smoothing.path_prior`, the
others are those of `contactsense.solvers.posterior.contact_prior`; those of lean and torsion count once for
the whole contact, as what a contact patch does in one window it does in the next.
"""

import math
from dataclasses import dataclass

import numpy as np

from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.service.analysis.smoothing.path_arrays import (
    STEPS,
    EliminationArrays,
    PathArrays,
    WindowSums,
)
from contactsense.service.analysis.smoothing.path_elimination import eliminate_forces, project_knots
from contactsense.service.analysis.smoothing.path_prior import IncrementPrior, drag_prior, undirected_prior
from contactsense.solvers.posterior.contact_prior import STUDENT_DOF, Prior

ITERATIONS = 25
"""Maximum number of steps of a search."""
FIRST_STEPS = 3
"""After this many steps, a search that is far from the best one is abandoned."""
RESCALED = 8
"""For this many steps, lean and torsion are scaled by the force of the previous step, then by a fixed
force."""
CONVERGED = 1e-2
"""Decrease of the energy that ends the search."""
SURFACE_DOF, SURFACE_SCALE = 2.0, 0.5
"""Degrees of freedom of the Student t distribution of the surface's offset, and its scale as a fraction of
the scene's standard deviation: most of a link is nearer to its primitives than that, its details are farther
away."""
LARGEST_OFFSET = 6.0
"""Maximum offset in units of that standard deviation."""
UNEVENNESS = 0.02
"""Standard deviation of the place from an even motion between two knots, as a fraction of their distance:
nothing slides at a constant speed on a straight line."""
NORMAL_DEVIATION = 0.1
"""Standard deviation of the real surface's normal from that of the primitive [rad]."""
LEAST_SHARE = 0.2
"""Lean and torsion are scaled by at least this fraction of the largest force."""
LOG_PEAK = (
    math.lgamma(0.5 * (SURFACE_DOF + 1.0))
    - math.lgamma(0.5 * SURFACE_DOF)
    + 0.5 * math.log(2.0 / SURFACE_DOF)
)
"""Logarithm of the peak of that distribution at unit scale, over that of a normal distribution's."""


@dataclass(frozen=True, eq=False)
class LinkMeasurement:
    """Measurements of a contact on one link in W windows: y = A w + D b + noise of unit variance, with
    the wrench w in the link's frame, about its origin, and biases b."""

    sums: WindowSums
    """Sums for the wrench."""
    bias_information: np.ndarray
    """Sum of D^T D, shape (B, B)."""
    bias_value: np.ndarray
    """Sum of D^T y, shape (B,)."""
    bias_variance: np.ndarray
    """Prior variance of the biases, shape (B,)."""
    square: float
    """Sum of y^T y."""
    rows: int
    """Number of measurements y."""
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
    knots: np.ndarray
    """Places on the primitives between which the path runs, one if it is fixed, shape (K, 3) [m]."""
    energy: float
    """Energy: half the squared residuals in units of the noise, plus half the squared deviations from the
    prior."""
    freedom: float
    """Degrees of freedom of the residuals: twice the expected energy if the model is correct."""

    @property
    def sliding(self) -> bool:
        """Whether the place moves."""
        return len(self.knots) > 1


class PlaceSearch:
    """The search on one link."""

    def __init__(
        self,
        surfaces: Surfaces,
        link: int,
        prior: Prior,
        measured: LinkMeasurement,
        times: np.ndarray,
        speed: float = 0.0,
    ) -> None:
        """`times`: increasing times of the knots, from the first window to the last one, shape (K,) [s]; a
        fixed place has one. `speed`: standard deviation of the velocity in each tangential direction, as long
        as its direction is unknown [m/s]."""
        self._surfaces, self._link, self._prior, self._m = surfaces, link, prior, measured
        self._knots, self._share = len(times), 1.0 / len(measured.t)
        step = np.diff(times)
        self._knot = np.clip(np.searchsorted(times, measured.t, side="right") - 1, 0, max(len(step) - 1, 0))
        self._fraction = (
            (measured.t - times[self._knot]) / step[self._knot] if len(step) else 0.0 * measured.t
        )
        self._sigma = speed * step

    def run(self, start: np.ndarray, limit: float = np.inf) -> Place | None:
        """Search from a point, shape (3,), or a path of knots, shape (K, 3), near the surface, link frame
        [m]; None if no push fits, if the measurements do not determine one, or if the energy is not below
        `limit` after a few steps."""
        try:
            return self._run(start, limit)
        except np.linalg.LinAlgError:
            return None

    def _run(self, start: np.ndarray, limit: float) -> Place | None:
        K, B = self._knots, len(self._m.bias_value)
        places = np.array(np.broadcast_to(start, (K, 3)), dtype=np.float64)
        h, b = np.zeros(K), np.zeros(B)
        largest = LARGEST_OFFSET * self._prior.surface_deviation
        state = self._evaluate(places, h, b, None, False)
        scale, increments = state.scale, state.increments
        for iteration in range(ITERATIONS):
            if iteration == FIRST_STEPS and state.energy > limit:
                return None
            if iteration < RESCALED:
                scale, increments = self._scale(state), self._increments(state)
            state = self._evaluate(state.places, h, b, scale, True, increments)
            if not np.isfinite(state.energy):
                return None
            step = -np.linalg.solve(state.matrix, state.gradient)
            change = step[: 3 * K].reshape(K, 3)
            v = np.einsum("ki,kij->kj", change[:, :2], state.frames)
            length = float(np.sqrt(np.max(np.sum(v * v, axis=1))))
            size = min(1.0, 0.1 / max(length, 1e-12))
            gained = 0.0
            for _ in range(5):
                h1 = np.clip(h + size * change[:, 2], -largest, largest)
                b1 = b + size * step[3 * K :]
                tried = self._evaluate(state.places + size * v, h1, b1, scale, False, increments)
                if tried.energy < state.energy and (tried.push > 0.0 or state.push <= 0.0):
                    gained = state.energy - tried.energy
                    h, b, state = h1, b1, tried
                    break
                size *= 0.4
            if gained < CONVERGED:
                break
        scale, increments = self._scale(state), self._increments(state)
        return self._result(self._evaluate(state.places, h, b, scale, True, increments), h)

    def _scale(self, state: "_State") -> np.ndarray:
        """Magnitude of the normal force and weight of the lean's prior in each window, shape (W, 2)."""
        f, n = state.u[:, :3], state.normal
        push = -np.einsum("wi,wi->w", f, n)
        F = np.abs(push)
        F = np.maximum(F, LEAST_SHARE * max(float(F.max()), 1e-3))
        lean = np.einsum("wi,wi->w", f, f) - push * push
        rho = lean / (self._prior.friction_ratio * F) ** 2
        return np.column_stack((F, (STUDENT_DOF + 2.0) / (STUDENT_DOF + rho)))

    def _increments(self, state: "_State") -> IncrementPrior:
        """What the forces tell of the increments of the path."""
        return drag_prior(state.u[:, :3], state.normal, self._knot, self._sigma)

    def _evaluate(
        self,
        places: np.ndarray,
        h: np.ndarray,
        b: np.ndarray,
        scale: np.ndarray | None,
        derivatives: bool,
        increments: IncrementPrior | None = None,
    ) -> "_State":
        m, prior, K = self._m, self._prior, self._knots
        W, B = len(m.t), len(b)
        if scale is None:
            scale = np.column_stack((np.full(W, prior.force), np.full(W, (STUDENT_DOF + 2.0) / STUDENT_DOF)))
        F = scale[:, 0]
        rows = np.empty((W, 3))
        rows[:, 0] = self._share * scale[:, 1] / (prior.friction_ratio * F) ** 2
        rows[:, 1] = 0.25 * self._share / prior.force**2
        rows[:, 2] = self._share / (prior.torsion_lever * F) ** 2
        path = PathArrays(
            places, h, np.empty((K, 2, 3)), self._knot, self._fraction, np.empty(W), np.empty(STEPS + 1)
        )
        size = 3 * K + B
        out = EliminationArrays(
            np.empty((W, 3)), np.empty((W, 3)), np.empty((W, 4)), np.zeros((size, size)), np.zeros(size),
            np.zeros((4, 4)),
            np.zeros((6, 4)), np.empty((6, 4)), np.empty((4, 4)), np.empty((4, 6 + B)), np.empty((6, 3)),
            np.empty(6), np.empty(4), np.empty(6), np.empty(6 + B, dtype=np.int64),
        )  # fmt: skip
        project_knots(self._surfaces, self._link, places, path.frames)
        energy = eliminate_forces(self._surfaces, self._link, rows, m.sums, path, b, out, derivatives)
        Nb = m.bias_information @ b
        energy += 0.5 * m.square - float(b @ m.bias_value) + 0.5 * float(b @ Nb)
        s = SURFACE_SCALE * prior.surface_deviation
        offset = (h / s) ** 2
        energy += 0.5 * (SURFACE_DOF + 1.0) * float(np.sum(np.log1p(offset / SURFACE_DOF)))
        energy += 0.5 * float(np.sum(b * b / m.bias_variance))
        S, g = out.matrix, out.gradient
        if derivatives:
            S[3 * K :, 3 * K :] += m.bias_information + np.diag(1.0 / m.bias_variance)
            g[3 * K :] += Nb - m.bias_value + b / m.bias_variance
            weight = (SURFACE_DOF + 1.0) / (SURFACE_DOF + offset) / s**2
            at = np.arange(2, 3 * K, 3)
            S[at, at] += weight
            g[at] += weight * h
        if increments is None:
            increments = undirected_prior(self._sigma)
        energy += increments.energy(places)
        if derivatives:
            increments.add_derivatives(places, path.frames, S, g)
        return _State(
            energy, places, path.frames, S, g, out.point, out.normal, out.u, out.total, scale, increments
        )

    def _result(self, state: "_State", h: np.ndarray) -> Place | None:
        """The result of the search."""
        prior, K, W = self._prior, self._knots, len(self._m.t)
        f, n = state.u[:, :3], state.normal
        if state.push <= 0.0:
            return None
        # The force hardly changes from window to window: its integral counts once, as for one common force.
        # Counted in each window, it would favour places whose moment is least affected by the force's noise.
        log_det_force = 2.0 * float(np.sum(np.log(np.diag(np.linalg.cholesky(state.total)))))
        sign, log_det = np.linalg.slogdet(state.matrix)
        if sign <= 0.0 or not np.isfinite(log_det):
            return None
        F = state.scale[:, 0]
        log_prior = self._share * float(
            np.sum(
                -np.log(prior.torsion_lever * F / prior.force)
                - 2.0 * np.log(prior.friction_ratio * F / prior.force)
                - 0.5 * np.log(F / prior.force) ** 2
            )
        )
        # Laplace's integral over the first place (uniform over the link), increments and offsets.
        log_prior += prior.log_link_density[self._link]
        log_prior += np.log(2.0 * np.pi / prior.area) - state.increments.log_scale
        log_prior += K * (LOG_PEAK - np.log(SURFACE_SCALE * prior.surface_deviation))
        evidence = log_prior - state.energy - 0.5 * log_det - 0.5 * log_det_force
        # The peak of the offset's distribution is narrower than the distribution.
        S, at = state.matrix.copy(), np.arange(2, 3 * K, 3)
        s = SURFACE_SCALE * prior.surface_deviation
        weight = (SURFACE_DOF + 1.0) / (SURFACE_DOF + (h / s) ** 2) / s**2
        S[at, at] += np.minimum(weight, prior.surface_deviation**-2) - weight
        C = np.linalg.inv(S)[: 3 * K, : 3 * K]
        tangential = np.eye(3) - n[:, :, None] * n[:, None, :]
        hat = np.zeros((W, K))
        hat[np.arange(W), self._knot] = 1.0 - self._fraction
        hat[np.arange(W), np.minimum(self._knot + 1, K - 1)] += self._fraction
        rows = np.zeros((W, K, 3, 3))
        rows[..., :2] = hat[:, :, None, None] * (tangential[:, None] @ np.swapaxes(state.frames, 1, 2)[None])
        rows[..., 2] = hat[:, :, None] * n[:, None]
        jacobian = np.swapaxes(rows, 1, 2).reshape(W, 3, 3 * K)
        covariance = jacobian @ C @ np.swapaxes(jacobian, 1, 2)
        # The moment of the torsion rotates with the normal, which shifts the place.
        lever = float(np.sum(np.abs(F * state.u[:, 3])) / np.sum(F * F))
        covariance += (NORMAL_DEVIATION * lever) ** 2 * tangential
        if K > 1:
            length = np.linalg.norm(np.diff(state.places, axis=0), axis=1)[self._knot]
            covariance += (UNEVENNESS * length[:, None, None]) ** 2 * tangential
        return Place(
            self._link,
            float(evidence),
            state.point + (hat @ h)[:, None] * n,
            n,
            f,
            covariance,
            state.places,
            state.energy,
            float(self._m.rows - 4 * W),
        )


@dataclass(frozen=True, eq=False)
class _State:
    energy: float
    places: np.ndarray
    frames: np.ndarray
    matrix: np.ndarray
    gradient: np.ndarray
    point: np.ndarray
    normal: np.ndarray
    u: np.ndarray
    total: np.ndarray
    scale: np.ndarray
    increments: IncrementPrior

    @property
    def push(self) -> float:
        """Sum of the normal forces; negative where the contact would pull [N]."""
        return -float(np.einsum("wi,wi->", self.u[:, :3], self.normal))
