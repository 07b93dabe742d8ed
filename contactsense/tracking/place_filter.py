"""Filter of the place of a contact, for joint torques alone: what all samples since its onset tell of it.

One sample of n torques leaves the place open. But on a moving arm the same touch is seen through changing
screws, so that samples at different times together exclude places, and links, that each of them allows. A
window's mean cannot use that: without a base sensor it mixes postures.

The cells of the surface (`contactsense.localization.surface_samples`) are hypotheses. The unknowns of each
are those of `contactsense.localization.laplace_evidence`, fixed to the link on which the cell lies: logarithm
phi of the normal force relative to the median F0 of its prior, friction ratios alpha and beta, torsion ratio
chi, a shift (v1, v2) in the tangent plane. With the cell's centre c0, its normal n and its tangents t1, t2

    F = F0 exp(phi),   d = -n + alpha t1 + beta t2,   f = F d,   m = (c0 + v1 t1 + v2 t2) x f + F chi n,
    r_j = a_jk(t) . (f, m) + noise for the joints j up to link k,   r_j = noise for those beyond,

where a_jk(t) is the screw of joint j in the frame of link k at time t. An extended Kalman filter per cell, in
information form, estimates x = (phi, alpha, beta, chi, v1, v2). Between blocks x drifts as a random walk: the
force changes quickly, its direction and the place slowly. With Lambda the information of x after the last
block, Q the covariance of the drift, H = dr/dx and S the noise,

    Lambda' = (Lambda^-1 + Q)^-1,   N = Lambda' + H^T S^-1 H,
    log weight += -min_x [ 1/2 (x - x0)^T Lambda' (x - x0) + 1/2 (r - a . w(x))^T S^-1 (r - a . w(x)) ]
                  + 1/2 log det Lambda' - 1/2 log det N,

the logarithm of the probability of the new torques, given all torques before, under the hypothesis. A large
friction ratio or torsion that a place would need at any instant counts against it by the prior of x, once and
not once per sample. Before each block the differences between log weights shrink, see `FORGETTING_TIME`.

The observer's residuals are correlated over its time constant 1 / K. With e = exp(-K dt), the numbers
r_{i-1} + (r_i - r_{i-1}) / (1 - e) undo its low-pass and are white; blocks of them are averaged. The error of
the model of a torque is not white: it counts as constant over `ERROR_TIME`.
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from contactsense.kinematics.linalg.ldl import ldl_solve
from contactsense.kinematics.linalg.outer_product import add_outer_product, add_scaled_vector
from contactsense.kinematics.model import Motion
from contactsense.kinematics.spatial import Six
from contactsense.localization.surface_samples import SurfaceSamples
from contactsense.robots.jit.array_views import copy
from contactsense.robots.jit.declaration import Floats, Records, record
from contactsense.robots.jit.kernel import fused_kernel, kernel
from contactsense.robots.vectors import Vector, add, cross, dot, rotate_back, scale, tangents, vector
from contactsense.solvers.posterior import Prior, SearchBuffers

BLOCK_TIME = 0.02
"""Time over which increments of the residuals are averaged [s]."""
ERROR_TIME = 1.0
"""Time over which the error of the model of a torque counts as constant [s]."""
FORCE_DRIFT, DIRECTION_DRIFT, TORSION_DRIFT, PLACE_DRIFT = 20.0, 0.1, 1e-5, 1e-4
"""Variances per second of the random walks of the log force, of the friction ratios, of the torsion ratio
[m^2] and of the place [m^2]: a hand is unsteady, and a contact may slide."""
FORGETTING_TIME = 0.8
"""Differences between log weights decay with this time constant [s]: the errors of successive blocks, due to
the surface and to the assumed drifts, are not independent, so their sum would be too certain."""
FIRST_ITERATIONS, ITERATIONS = 8, 2
"""Largest number of Gauss-Newton steps for the first torques, and for later ones."""
CONVERGED = 0.05
"""The steps end if the predicted decrease of the energy is less than this."""
MAX_FORCE_STEP = 1.0
"""Maximum step in the logarithm of the force."""
DROPPED = 16.0
"""Cells whose log weight is below the best by more than this are dropped."""
REJECTED = 4.0
"""A cell is dropped early unless this many times the predicted decrease brings it above that limit."""
COMPARED = 8.0
"""Cells within this of the best one must explain a block, or the filter restarts ..."""
MISFIT = 9.0
"""... which means: half the squared innovation is within this many standard deviations of its mean."""


@record
class PlaceFilterStatus:
    """How far the filter is."""

    contact: int
    """Number of the contact; 0: the filter must start again."""
    samples: int
    """Samples in the present block."""
    blocks: int
    """Blocks since the filter started."""
    time: float
    """Duration of the present block [s]."""


class PlaceFilter(NamedTuple):
    """State of the filter."""

    unknowns: Annotated[Floats, "samples, 6"]
    """Most probable x of each cell."""
    information: Annotated[Floats, "samples, 6, 6"]
    """Its information matrix, upper triangle."""
    log_determinant: Annotated[Floats, "samples"]
    """Log determinant of that."""
    log_weight: Annotated[Floats, "samples"]
    """Log evidence of each cell; minus infinity for cells that are dropped."""
    variance: Annotated[Floats, "samples, 3"]
    """Covariance of the shift (v1, v2): entries 11, 12 and 22 [m^2]."""
    score: Annotated[Floats, "samples"]
    """Log weights at the last block for the posture then, see `contactsense.tracking.place_candidates`."""
    remaining: Annotated[Floats, "samples"]
    """Scratch: probability of cells that are not part of a candidate."""
    residual: Annotated[Floats, "joints"]
    """Residual of the last sample [Nm]."""
    torque: Annotated[Floats, "joints"]
    """Sum, then mean, of the torques of a block [Nm]."""
    torque_variance: Annotated[Floats, "joints"]
    """Variance of that mean [Nm^2]."""
    noise: Annotated[Floats, "joints"]
    """Scratch: variance of the white noise of one sample of each torque [Nm^2]."""
    model_error: Annotated[Floats, "joints"]
    """Scratch: variance of the error of its model [Nm^2]."""
    screw: Annotated[Floats, "links, joints, 6"]
    """Sum, then mean, of the screws in the frame of each link."""
    status: Annotated[Records[PlaceFilterStatus], "1"]


@kernel
def _add_screws(places: PlaceFilter, depth: np.ndarray, motion: Motion) -> None:
    """Add the screws at this instant, in the frame of each link, to the sums.

    With w' the wrench w about the link's origin o, link axes: s . w = (R^T (s_f + s_m x o), R^T s_m) . w'.
    """
    for link in range(depth.shape[0]):
        R, o = motion.rotation[depth[link]], vector(motion.origin[depth[link]])
        for j in range(depth[link]):
            screw, out = motion.screw[j], places.screw[link, j]
            moment = (screw[3], screw[4], screw[5])
            a, b = rotate_back(R, add(vector(screw), cross(moment, o))), rotate_back(R, moment)
            for i in range(3):
                out[i] += a[i]
                out[3 + i] += b[i]


@kernel
def _clear_block(places: PlaceFilter) -> None:
    places.torque[:] = 0.0
    places.screw[:] = 0.0
    places.status[0].samples, places.status[0].time = 0, 0.0


@kernel
def start_filter(
    places: PlaceFilter,
    samples: SurfaceSamples,
    link_of: np.ndarray,
    depth: np.ndarray,
    motion: Motion,
    residual: np.ndarray,
    variance: np.ndarray,
    prior: Prior,
    buffers: SearchBuffers,
) -> None:
    """Start the filter from the residuals of one sample.

    Args:
        places: Filled, but for `status.contact`.
        samples: Cells of the surface.
        link_of: Link of each primitive.
        depth: Number of joints between the base and each link.
        motion: Poses.
        residual: Residual of each joint torque [Nm].
        variance: Its variance [Nm^2].
        prior: Prior of contacts.
        buffers: Scratch.
    """
    _clear_block(places)
    _add_screws(places, depth, motion)
    copy(residual, places.residual)
    copy(residual, places.torque)
    copy(variance, places.torque_variance)
    places.status[0].blocks = 0
    ratio, torsion = prior.friction_ratio**-2.0, prior.torsion_lever**-2.0
    for s in range(samples.point.shape[0]):
        spread = samples.spread[s] ** -2.0
        places.unknowns[s] = 0.0
        places.information[s] = 0.0
        log_determinant = 0.0
        for i in range(6):
            diagonal = (1.0, ratio, ratio, torsion, spread, spread)[i]
            places.information[s, i, i] = diagonal
            log_determinant += math.log(diagonal)
        places.log_determinant[s] = log_determinant
        places.log_weight[s] = samples.log_share[s] + prior.log_link_density[link_of[samples.primitive[s]]]
    _update_cells(places, samples, link_of, depth, prior, FIRST_ITERATIONS, buffers)
    _clear_block(places)


@kernel
def add_sample(
    places: PlaceFilter, depth: np.ndarray, motion: Motion, residual: np.ndarray, dt: float, bandwidth: float
) -> bool:
    """Add the residuals of a sample to the present block; returns whether the block is complete.

    Args:
        places: Changed in place.
        depth, motion, residual: As for `start_filter`.
        dt: Time since the last sample [s].
        bandwidth: Cut-off frequency of the observers [Hz].
    """
    undone = 1.0 / (1.0 - math.exp(-2.0 * math.pi * bandwidth * dt))
    for j in range(residual.shape[0]):
        places.torque[j] += places.residual[j] + undone * (residual[j] - places.residual[j])
        places.residual[j] = residual[j]
    _add_screws(places, depth, motion)
    status = places.status[0]
    status.samples += 1
    status.time += dt
    return bool(status.time >= BLOCK_TIME - 0.5 * dt)


@kernel
def end_block(
    places: PlaceFilter,
    samples: SurfaceSamples,
    link_of: np.ndarray,
    depth: np.ndarray,
    noise: np.ndarray,
    error: np.ndarray,
    prior: Prior,
    buffers: SearchBuffers,
) -> bool:
    """Update all cells with the block that `add_sample` has completed.

    Args:
        places: Changed in place.
        samples, link_of, depth, prior, buffers: As for `start_filter`.
        noise: Variance of the white noise of one sample of each torque [Nm^2].
        error: Variance of its model's error [Nm^2].

    Returns:
        Whether a probable place explains the block; if none does, the contact is another one than before.
    """
    status = places.status[0]
    count = float(status.samples)
    for j in range(noise.shape[0]):
        places.torque[j] /= count
        places.torque_variance[j] = noise[j] / count + error[j] * max(ERROR_TIME / status.time, 1.0)
    for link in range(depth.shape[0]):
        for j in range(depth[link]):
            for i in range(6):
                places.screw[link, j, i] /= count
    for s in range(samples.point.shape[0]):
        if places.log_weight[s] > -math.inf:
            _drift(places, s, status.time)
    _forget(places, math.exp(-status.time / FORGETTING_TIME))
    misfit = _update_cells(places, samples, link_of, depth, prior, ITERATIONS, buffers)
    status.blocks += 1
    _clear_block(places)
    n = noise.shape[0]
    return bool(misfit <= 0.5 * (n + MISFIT * math.sqrt(2.0 * n)))


@fused_kernel
def _forget(places: PlaceFilter, kept: float) -> None:
    """Multiply the differences between log weights by `kept`."""
    weight, best = places.log_weight, -math.inf
    for s in range(weight.shape[0]):
        best = max(best, weight[s])
    for s in range(weight.shape[0]):
        if weight[s] > -math.inf:
            weight[s] = best + kept * (weight[s] - best)


@fused_kernel
def _drift(places: PlaceFilter, s: int, time: float) -> None:
    """Random walk of x for `time` [s]: adding q to one variance of x takes q u u^T / (1 + q u_i) from the
    information, u being its column i."""
    L = places.information[s]
    change = 1.0
    for i in range(6):
        q = (FORCE_DRIFT, DIRECTION_DRIFT, DIRECTION_DRIFT, TORSION_DRIFT, PLACE_DRIFT, PLACE_DRIFT)[i] * time
        column = (
            L[0, i],
            L[min(1, i), max(1, i)],
            L[min(2, i), max(2, i)],
            L[min(3, i), max(3, i)],
            L[min(4, i), max(4, i)],
            L[i, 5],
        )
        factor = 1.0 + q * L[i, i]
        add_outer_product(L, -q / factor, column)
        change *= factor
    places.log_determinant[s] -= math.log(change)


@fused_kernel
def _update_cells(
    places: PlaceFilter,
    samples: SurfaceSamples,
    link_of: np.ndarray,
    depth: np.ndarray,
    prior: Prior,
    iterations: int,
    buffers: SearchBuffers,
) -> float:
    """Update all cells with the mean torques of a block, and drop the improbable ones.

    Returns:
        The least energy of the block of those within `COMPARED` of the best.
    """
    weight, best = places.log_weight, -math.inf
    for s in range(weight.shape[0]):
        if weight[s] > -math.inf:
            link = link_of[samples.primitive[s]]
            weight[s] = _update_cell(
                places, samples, s, link, depth[link], prior.force, iterations, best - DROPPED, buffers
            )
            best = max(best, weight[s])
    misfit = math.inf
    for s in range(weight.shape[0]):
        if weight[s] < best - DROPPED:
            weight[s] = -math.inf
        elif weight[s] > best - COMPARED:
            misfit = min(misfit, _block_energy(places, samples, s, link_of, depth, prior.force, buffers))
    return misfit


@fused_kernel
def _block_energy(
    places: PlaceFilter,
    samples: SurfaceSamples,
    s: int,
    link_of: np.ndarray,
    depth: np.ndarray,
    force: float,
    buffers: SearchBuffers,
) -> float:
    """Half the squared residuals of a block at the present state of a cell, in units of their variance."""
    link = link_of[samples.primitive[s]]
    return _linearize(
        places, link, depth[link], (vector(samples.point[s]), vector(samples.normal[s])),
        _six(places.unknowns[s]), force, buffers,
    )  # fmt: skip


@fused_kernel
def _six(array: np.ndarray) -> Six:
    return array[0], array[1], array[2], array[3], array[4], array[5]


@fused_kernel
def _update_cell(
    places: PlaceFilter,
    samples: SurfaceSamples,
    s: int,
    link: int,
    count: int,
    force: float,
    iterations: int,
    limit: float,
    buffers: SearchBuffers,
) -> float:
    """Update cell s, on `link` beyond `count` joints, by at most `iterations` Gauss-Newton steps; returns its
    new log weight, minus infinity if that is below `limit`."""
    L, H, g = places.information[s], buffers.normal_equations, buffers.gradient
    place = (vector(samples.point[s]), vector(samples.normal[s]))
    x0 = _six(places.unknowns[s])
    x = x0
    for k in range(iterations):
        dx = (x[0] - x0[0], x[1] - x0[1], x[2] - x0[2], x[3] - x0[3], x[4] - x0[4], x[5] - x0[5])
        energy = 0.0
        for i in range(6):
            g[i] = 0.0
            for j in range(6):
                H[i, j] = L[min(i, j), max(i, j)]
                g[i] += H[i, j] * dx[j]
            energy += 0.5 * g[i] * dx[i]
        energy += _linearize(places, link, count, place, x, force, buffers)
        log_determinant, decrease, v11, v12, v22 = ldl_solve(H, g)
        bound = places.log_weight[s] - energy + 0.5 * (places.log_determinant[s] - log_determinant)
        if log_determinant == math.inf or not bound + REJECTED * decrease >= limit:
            return -math.inf
        step = min(1.0, MAX_FORCE_STEP / max(abs(g[0]), 1e-300))
        x = (
            x[0] - step * g[0], x[1] - step * g[1], x[2] - step * g[2],
            x[3] - step * g[3], x[4] - step * g[4], x[5] - step * g[5],
        )  # fmt: skip
        if decrease < CONVERGED or k == iterations - 1:
            for i in range(6):
                places.unknowns[s, i] = x[i]
                for j in range(i, 6):
                    L[i, j] = H[i, j]
            places.log_determinant[s] = log_determinant
            places.variance[s, 0], places.variance[s, 1], places.variance[s, 2] = v11, v12, v22
            # The predicted decrease of a step that was cut short does not come true.
            return float(bound + decrease) if step == 1.0 else float(bound)
    return -math.inf


@fused_kernel
def _linearize(
    places: PlaceFilter,
    link: int,
    count: int,
    place: tuple[Vector, Vector],
    x: Six,
    force: float,
    buffers: SearchBuffers,
) -> float:
    """Add Gauss-Newton matrix and gradient of the block's energy at x to `buffers`; returns the energy.

    Args:
        places: With the block's mean torques and screws.
        link: The link that is touched, beyond `count` joints.
        count: That number.
        place: Centre of the cell [m] and its normal, link frame.
        x: The unknowns.
        force: Median of the prior of the normal force [N].
        buffers: Changed in place.
    """
    c, n = place
    t1, t2 = tangents(n)
    phi, alpha, beta, chi, v1, v2 = x
    F = force * math.exp(min(phi, 6.0))
    c = add(c, add(scale(v1, t1), scale(v2, t2)))
    energy = 0.0
    for j in range(places.torque.shape[0]):
        torque, precision = places.torque[j], 1.0 / places.torque_variance[j]
        if j >= count:
            energy += 0.5 * torque * torque * precision
            continue
        screw = places.screw[link, j]
        m = (screw[3], screw[4], screw[5])
        # Moment about the joint of a unit force at c along each axis, and of a unit moment.
        b = add(vector(screw), cross(m, c))
        bn, b1, b2 = dot(b, n), dot(b, t1), dot(b, t2)
        mn, m1, m2 = dot(m, n), dot(m, t1), dot(m, t2)
        h = F * (alpha * b1 + beta * b2 - bn + chi * mn)
        row = (h, F * b1, F * b2, F * mn, F * (m2 + beta * mn), -F * (m1 + alpha * mn))
        d = h - torque
        energy += 0.5 * d * d * precision
        add_outer_product(buffers.normal_equations, precision, row)
        add_scaled_vector(buffers.gradient, precision * d, row)
    return energy
