"""The most probable contact of a noisy wrench on any surface that has an exact solver: mode of the posterior
(`contactsense.solvers.posterior.equations`), its covariance and its evidence."""

import math
from dataclasses import dataclass, replace
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike

from contactsense.kinematics.linalg.ldl import ldl_solve
from contactsense.robots.jit.flat_buffers import zeros
from contactsense.robots.rotations import cross_matrix
from contactsense.robots.vectors import Vector
from contactsense.sensors.validation import as_floats
from contactsense.solvers.bodies.paper_surfaces import Placed
from contactsense.solvers.bodies.surface import EqualByFields, Surface, vectors
from contactsense.solvers.posterior.contact_prior import (
    Contact,
    Prior,
    SearchBuffers,
    log_prior,
    pushing_force,
)
from contactsense.solvers.posterior.energy import energy_at, inflate_by_surface_deviation, linearize
from contactsense.solvers.posterior.equations import Inflation
from contactsense.solvers.posterior.friction_tails import with_friction_tails
from contactsense.solvers.solution import Status
from contactsense.solvers.solve_wrench import Method, solve_wrench

_MAX_ITERATIONS = 60
_TOLERANCE = 1e-12
"""Converged if a step lowers the energy by less than this, relative to the energy plus one."""
_SHORTEST_STEP = 1e-9
"""Smallest factor of a step in a line search."""


@dataclass(frozen=True, slots=True)
class ContactPrior:
    """What is known of a contact before its wrench is measured; as the fields of `contactsense.Scene`."""

    friction: float = 0.5
    """Coefficient of friction: forces are rarely inclined further than this against the normal."""
    torsion: float = 0.0025
    """Standard deviation of the torsion per normal force [m]."""
    force: float = 20.0
    """Median of the normal force [N]; its logarithm has standard deviation 1."""
    surface_error: float = 0.0
    """Standard deviation of the real surface's offset along the normal [m]."""

    def __post_init__(self) -> None:
        for name in ("friction", "torsion", "force", "surface_error"):
            value = getattr(self, name)
            if not isinstance(value, Real):
                raise TypeError(f"{name}: must be a number, not {value!r:.60}")
            least = "not be negative" if name == "surface_error" else "be positive"
            if not math.isfinite(value) or value < 0.0 or (value == 0.0 and name != "surface_error"):
                raise ValueError(f"{name}: must {least} and finite, not {value}")


@dataclass(frozen=True, slots=True, eq=False)
class ProbableContact(EqualByFields):
    """The most probable contact on a surface."""

    status: Status
    """`OK`; otherwise why there is none: the other fields are zero, covariance and energy infinite."""
    centroid: np.ndarray
    """Contact centroid [m], shape (3,)."""
    normal: np.ndarray
    """Outward unit normal there, shape (3,)."""
    force: np.ndarray
    """Most probable force on the body [N], shape (3,)."""
    torsion: float
    """Most probable moment on the body about the normal [Nm]."""
    covariance: np.ndarray
    """Covariance of the centroid [m^2], shape (3, 3), in the tangent plane; with `surface_error` also along
    the normal."""
    energy: float
    """Negative log posterior at the mode, up to a constant of the noise: half the squared residual wrench in
    units of the noise, plus the terms of the prior. What a wrench that the surface explains exceeds rarely is
    half the quantile of chi-square."""
    log_evidence: float
    """Log of the evidence of a contact near this mode by Laplace's approximation, for a prior of one place
    per m^2: less the log of the surface's area, it compares surfaces."""

    @property
    def ok(self) -> bool:
        """Whether this is a contact."""
        return self.status == Status.OK


def most_probable_contact(
    surface: Surface,
    force: ArrayLike,
    moment: ArrayLike,
    covariance: ArrayLike,
    prior: ContactPrior | None = None,
) -> ProbableContact:
    """Find the most probable contact of a noisy wrench.

    Gauss-Newton steps in force, torsion and place. A step leaves the surface to second order; the contact of
    the wrench that it leads to, by the exact solver, is on the surface again. So every surface with an exact
    solver is treated alike, those without a signed distance too.

    Args:
        surface: The surface.
        force: Measured force on the body [N], shape (3,).
        moment: Measured moment on the body about the frame's origin [Nm], shape (3,).
        covariance: Covariance of the measured wrench, force first [N^2, N^2 m, N^2 m^2], shape (6, 6).
        prior: What is known beforehand; None: the defaults.

    Returns:
        The contact, in the frame of the wrench; `NOT_CONVERGED` if no search has found a mode. No measurement
        makes this raise.

    Raises:
        ValueError: A shape is wrong, or the covariance is not symmetric and positive definite.
        TypeError: `surface` or `prior` is none.
    """
    f, m = vectors("force", force, 1), vectors("moment", moment, 1)
    P = _checked_covariance(covariance)
    given = ContactPrior() if prior is None else prior
    if not isinstance(given, ContactPrior):
        raise TypeError(f"prior: expected a ContactPrior, got {given!r:.60}")
    if isinstance(surface, Placed):
        R, p = surface.rotation, surface.origin
        adjoint = np.zeros((6, 6))
        adjoint[:3, :3] = adjoint[3:, 3:] = R.T
        adjoint[3:, :3] = -R.T @ cross_matrix(p)
        w = adjoint @ np.concatenate((f, m))
        found = most_probable_contact(surface.surface, w[:3], w[3:], adjoint @ P @ adjoint.T, given)
        if not found.ok:
            return found
        return replace(
            found,
            centroid=p + R @ found.centroid,
            normal=R @ found.normal,
            force=R @ found.force,
            covariance=R @ found.covariance @ R.T,
        )
    search = _Search(surface, np.concatenate((f, m)), np.linalg.inv(P), given)
    status, starts = search.starts(f)
    if starts and f @ f < np.trace(P[:3, :3]):
        # The line of a force below its noise can be anywhere, and so can these starts.
        direction = f / np.abs(f).max()
        starts += search.starts(given.force / np.linalg.norm(direction) * direction)[1]
    modes = search.modes(starts)
    if starts and not modes:
        status = Status.NOT_CONVERGED
    return min(modes, key=lambda contact: contact.energy, default=search.nothing(status))


@dataclass(frozen=True, slots=True)
class _State:
    """A contact on the surface."""

    c: np.ndarray
    n: np.ndarray
    f: np.ndarray
    xi: float

    def contact(self) -> Contact:
        return Contact(_tuple(self.c), _tuple(self.n), _tuple(self.f), float(self.xi))


class _Search:
    """Gauss-Newton on one surface."""

    def __init__(self, surface: Surface, wrench: np.ndarray, information: np.ndarray, given: ContactPrior):
        self.surface, self.w = surface, wrench
        self.L = np.ascontiguousarray(0.5 * (information + information.T))
        self.prior = Prior(
            friction_ratio=given.friction / 2.0,
            torsion_lever=given.torsion,
            surface_deviation=given.surface_error,
            force=given.force,
            clearance=0.0,
            area=1.0,
            log_link_density=np.zeros(1),
        )
        self.buffers: SearchBuffers = zeros(SearchBuffers)

    def starts(self, force: np.ndarray) -> tuple[Status, list[_State]]:
        """The contact of a force with the measured moment, and the place that their axis enters or comes
        nearest to."""
        states = []
        statuses = []
        methods: tuple[Method, ...] = ("exact", "wrench_axis")
        for method in methods:
            found = solve_wrench(self.surface, force, self.w[3:], method)
            statuses.append(found.status)
            if found.status.degenerate or found.status == Status.SHARP:
                continue
            f = np.array(pushing_force(_tuple(force), _tuple(found.normal)))
            xi = found.torsion if found.ok and method == "exact" else 0.0
            state = self.on_surface(found.centroid, f, xi * found.normal)
            if state is not None:
                states.append(state)
        return statuses[0], states

    def on_surface(self, c: np.ndarray, f: np.ndarray, torsion: np.ndarray) -> _State | None:
        """The contact of the wrench of a force at a place beside the surface and a moment; None if there is
        none."""
        found = solve_wrench(self.surface, f, np.cross(c, f) + torsion)
        return _State(found.centroid, found.normal, f, found.torsion) if found.ok else None

    def inflation(self, s: _State) -> Inflation:
        found: Inflation = inflate_by_surface_deviation(self.L, self.prior, s.contact())
        return found

    def energy(self, s: _State, inflation: Inflation) -> float:
        return float(energy_at(self.w, self.L, self.prior, inflation, s.contact()))

    def modes(self, starts: list[_State]) -> list[ProbableContact]:
        """The modes that steps from these starts lead to, as far as they are regular."""
        found = [self.descend(start) for start in starts]
        return [contact for contact in found if contact.log_evidence > -math.inf]

    def descend(self, s: _State) -> ProbableContact:
        """The mode that steps from a start lead to."""
        for _ in range(_MAX_ITERATIONS):
            inflation = self.inflation(s)
            energy = self.energy(s, inflation)
            log_det, predicted, variances = self.linearize(s, inflation)
            if log_det == math.inf or predicted <= _TOLERANCE * (1.0 + energy):
                break
            trial = self.shorter(s, inflation, energy)
            if trial is None:
                break
            s = trial
        return self.contact(s, variances, log_det)

    def linearize(self, s: _State, inflation: Inflation) -> tuple[float, float, tuple[float, float, float]]:
        """Write the step to the buffers.

        Returns:
            Log determinant, predicted decrease of the energy, variances along the tangents [m^2].
        """
        W = self.surface.shape_operator(s.c, s.n)
        upper = (W[0, 0], W[0, 1], W[0, 2], W[1, 1], W[1, 2], W[2, 2])
        linearize(self.w, self.L, self.prior, inflation, upper, s.contact(), self.buffers)
        log_det, predicted, v11, v12, v22 = ldl_solve(self.buffers.normal_equations, self.buffers.gradient)
        return log_det, predicted, (v11, v12, v22)

    def shorter(self, s: _State, inflation: Inflation, energy: float) -> _State | None:
        """The contact after the longest of the halved steps that lowers the energy."""
        step, T = self.buffers.gradient.copy(), self.buffers.frame[:, 1:].copy()
        W = self.surface.shape_operator(s.c, s.n)
        scale = 1.0
        while scale > _SHORTEST_STEP:
            shift = -scale * (T @ step[4:])
            f, xi = s.f - scale * step[:3], s.xi - scale * step[3]
            trial = self.on_surface(s.c + shift, f, xi * (s.n + W @ shift))
            if trial is not None and self.energy(trial, inflation) < energy:
                return trial
            scale *= 0.5
        return None

    def contact(self, s: _State, variances: tuple[float, float, float], log_det: float) -> ProbableContact:
        inflation = self.inflation(s)
        energy = self.energy(s, inflation)
        T = self.buffers.frame[:, 1:]
        K = T.T @ self.surface.shape_operator(s.c, s.n) @ T
        curvature = (float(K[0, 0]), float(K[0, 1]), float(K[1, 1]))
        v11, v12, v22 = with_friction_tails(variances, curvature, s.contact(), self.prior.friction_ratio)
        covariance = T @ np.array(((v11, v12), (v12, v22))) @ T.T
        covariance += self.prior.surface_deviation**2 * np.outer(s.n, s.n)
        evidence = -math.inf
        if log_det < math.inf:
            evidence = log_prior(self.prior, float(np.linalg.norm(s.f))) - energy
            evidence -= 0.5 * (log_det + math.log(inflation[2]))
        return ProbableContact(Status.OK, s.c, s.n, s.f, s.xi, covariance, energy, evidence)

    @staticmethod
    def nothing(status: Status) -> ProbableContact:
        """Why there is no contact."""
        zero = np.zeros(3)
        shown = Status.MISS if status == Status.OK else status
        return ProbableContact(shown, zero, zero, zero, 0.0, np.full((3, 3), math.inf), math.inf, -math.inf)


def _checked_covariance(covariance: ArrayLike) -> np.ndarray:
    P = np.array(as_floats("covariance", covariance))
    if P.shape != (6, 6):
        raise ValueError(f"covariance: expected shape (6, 6), not {P.shape}")
    size = np.sqrt(np.abs(np.diag(P)))
    if not np.isfinite(P).all() or not np.allclose(P, P.T, rtol=0.0, atol=1e-9 * np.outer(size, size).max()):
        raise ValueError("covariance: must be finite and symmetric")
    try:
        np.linalg.cholesky(P)
    except np.linalg.LinAlgError:
        raise ValueError("covariance: must be positive definite") from None
    return P


def _tuple(array: np.ndarray) -> Vector:
    """The first three numbers of an array."""
    x, y, z = array[:3].tolist()
    return x, y, z
