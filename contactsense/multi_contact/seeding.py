"""Seeds of the search for several contacts: sets of surface samples that could explain a measurement.

A contact near a sample with an unknown pushing force makes the rows a Gaussian vector. Its covariance is
S = C Q C^T (C: derivative of the rows by a force there, Q: prior covariance of the force) plus a term for
the distance between samples. The covariances of several contacts add up, so that the likelihood of any
set of samples is that of one small Gaussian.
"""

import math

from contactsense.kinematics.linalg.cholesky import cholesky
from contactsense.robots.jit.kernel import fused_kernel

RATIO_FACTOR = 2.0
"""Factor on the friction ratio of the prior in seeding, to allow for its heavy tail."""
TORQUE_LEVER = 0.5
"""Lever arm that converts a torque to a force if there is no base sensor [m]."""
SAME_SIDE_COSINE = 0.9
"""Two samples are on the same side of a primitive if the cosine between their normals exceeds this."""
MIN_FORCE = 1.0
"""Lower bound of the force scale [N]."""


@fused_kernel
def estimate_force_scale(external, present):  # type: ignore[no-untyped-def]
    """Approximate magnitude of the contact forces [N].

    Arguments as for `contactsense.multi_contact.measurement_rows.fill_measurement_rows`.
    """
    force_scale = MIN_FORCE
    if present[0]:
        y = external[0]
        force_scale = max(force_scale, math.sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2]))
    for s in range(external[2].shape[0]):
        if present[2] >> s & 1:
            y = external[2][s]
            force_scale = max(force_scale, math.sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2]))
    if present[1]:
        for j in range(external[1].shape[0]):
            force_scale = max(force_scale, abs(external[1][j]) / TORQUE_LEVER)
    return force_scale


@fused_kernel
def _add_contact_covariance(  # type: ignore[no-untyped-def]
    rows, m, link, point_normal, deviations, moment_deviation, force_jacobian, normal_jacobian, out
):
    """Add to `out` (lower triangle) the covariance of the rows due to a contact.

    Args:
        rows, m, link: The measurement, the number of its rows, the touched link.
        point_normal: Point and outward normal, base frame, six floats.
        deviations: Standard deviations of the force along the normal and along the tangents [N].
        moment_deviation: Standard deviation of each component of an additional moment [Nm].
        force_jacobian: Scratch: derivative of each row by the force, shape (M, 3).
        normal_jacobian: Filled: derivative of each row by a force along the normal, shape (M,).
        out: Shape (M, M).
    """
    A, seen = rows.matrix[link], rows.seen[link]
    cx, cy, cz, nx, ny, nz = point_normal
    tangential_variance = deviations[1] * deviations[1]
    normal_excess = deviations[0] * deviations[0] - tangential_variance
    moment_variance = moment_deviation * moment_deviation
    for r in range(m):
        normal_jacobian[r] = 0.0
        if seen[r] == 0.0:
            continue
        a, b = A[r], force_jacobian[r]
        # a . (f, c x f) = (a_f + a_m x c) . f
        b[0] = a[0] + a[4] * cz - a[5] * cy
        b[1] = a[1] + a[5] * cx - a[3] * cz
        b[2] = a[2] + a[3] * cy - a[4] * cx
        e = b[0] * nx + b[1] * ny + b[2] * nz
        normal_jacobian[r] = e
        for s in range(r + 1):
            if seen[s] == 0.0:
                continue
            d, v = force_jacobian[s], A[s]
            out[r, s] += (
                tangential_variance * (b[0] * d[0] + b[1] * d[1] + b[2] * d[2])
                + normal_excess * e * normal_jacobian[s]
                + moment_variance * (a[3] * v[3] + a[4] * v[4] + a[5] * v[5])
            )


@fused_kernel
def _log_likelihood(m, seeding):  # type: ignore[no-untyped-def]
    """Log likelihood (up to a constant) of the innovation under the covariance in `seeding.factor`.

    Factors the covariance and does the forward substitution into `weighted_innovation`.
    """
    L, y, z = seeding.factor, seeding.innovation, seeding.weighted_innovation
    log_det = cholesky(L, m)
    log_likelihood = -0.5 * log_det
    for r in range(m):
        x = y[r]
        for s in range(r):
            x -= L[r, s] * z[s]
        z[r] = x / L[r, r]
        log_likelihood -= 0.5 * z[r] * z[r]
    return log_likelihood


@fused_kernel
def _weight_innovation(m, seeding):  # type: ignore[no-untyped-def]
    """Back substitution after `_log_likelihood`: inverse covariance times innovation."""
    L, z = seeding.factor, seeding.weighted_innovation
    for r in range(m - 1, -1, -1):
        x = z[r]
        for s in range(r + 1, m):
            x -= L[s, r] * z[s]
        z[r] = x / L[r, r]


@fused_kernel
def _is_pushing(m, seeding, sample):  # type: ignore[no-untyped-def]
    """Whether the most likely force at a sample pushes, after `_weight_innovation`."""
    x = 0.0
    for r in range(m):
        x += seeding.normal_jacobian[sample, r] * seeding.weighted_innovation[r]
    return x < 0.0


@fused_kernel
def _are_neighbours(primitives, point_normal, a, b):  # type: ignore[no-untyped-def]
    """Whether two samples are on the same side of the same primitive: one optimization reaches both."""
    u, v = point_normal[a], point_normal[b]
    return primitives[a] == primitives[b] and u[3] * v[3] + u[4] * v[4] + u[5] * v[5] > SAME_SIDE_COSINE


@fused_kernel
def insert_seed(primitives, point_normal, count, score, a, b, c, scores, seeds):  # type: ignore[no-untyped-def]
    """Insert a set of `count` samples into a list sorted by falling score, if its score is high enough.

    Of sets that differ in one sample only, on the same side of the same primitive, the list keeps the
    best.
    """
    last = scores.shape[0] - 1
    if not score > scores[last]:
        return
    replaced = last
    for i in range(last + 1):
        if scores[i] == -math.inf:
            break
        x, y, z = seeds[i, 0], seeds[i, 1], seeds[i, 2]
        similar = _are_neighbours(primitives, point_normal, x, a)
        differ = 1 if x != a else 0
        if count > 1:
            similar = similar and _are_neighbours(primitives, point_normal, y, b)
            differ += 1 if y != b else 0
        if count > 2:
            similar = similar and _are_neighbours(primitives, point_normal, z, c)
            differ += 1 if z != c else 0
        if similar and differ <= 1:
            if scores[i] >= score:
                return
            replaced = i
            break
    position = replaced
    while position > 0 and scores[position - 1] < score:
        scores[position] = scores[position - 1]
        seeds[position, 0], seeds[position, 1], seeds[position, 2] = (
            seeds[position - 1, 0],
            seeds[position - 1, 1],
            seeds[position - 1, 2],
        )
        position -= 1
    scores[position] = score
    seeds[position, 0], seeds[position, 1], seeds[position, 2] = a, b, c


@fused_kernel
def transform_samples(samples, depth, motion, seed_samples, seeding):  # type: ignore[no-untyped-def]
    """Transform all samples to the base frame: fills `seeding.point_normal`."""
    for i in range(seed_samples.link.shape[0]):
        body = depth[seed_samples.link[i]]
        R, o, c, n = motion.rotation[body], motion.origin[body], samples.point[i], samples.normal[i]
        out = seeding.point_normal[i]
        for k in range(3):
            out[k] = o[k] + R[k, 0] * c[0] + R[k, 1] * c[1] + R[k, 2] * c[2]
            out[3 + k] = R[k, 0] * n[0] + R[k, 1] * n[1] + R[k, 2] * n[2]


@fused_kernel
def initialize_seeding(links, friction_ratio, known_contacts, count, force_scale, rows, m, seeding):  # type: ignore[no-untyped-def]
    """Covariance of the rows due to noise and known contacts, and the innovation over their known forces.

    Args:
        links: Link of each primitive, shape (P,).
        friction_ratio: That of the prior.
        known_contacts, count: Known contacts, their normals in `seeding.known_normal`, and their number.
        force_scale: Approximate magnitude of the forces [N].
        rows, m: The measurement and the number of its rows.
        seeding: Filled.
    """
    seeding.prior_covariance[:m, :m] = 0.0
    for r in range(m):
        seeding.prior_covariance[r, r] = 1.0
        seeding.innovation[r] = rows.value[r]
    for i in range(count):
        link = links[known_contacts.primitive[i]]
        c, n, f, C = (
            known_contacts.point[i],
            seeding.known_normal[i],
            known_contacts.force[i],
            known_contacts.covariance[i],
        )
        tangential, normal, force_norm = RATIO_FACTOR * friction_ratio * force_scale, force_scale, force_scale
        if known_contacts.drift[i] < math.inf:
            tangential = normal = known_contacts.drift[i]
            force_norm = math.sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])
            w = (
                f[0],
                f[1],
                f[2],
                c[1] * f[2] - c[2] * f[1],
                c[2] * f[0] - c[0] * f[2],
                c[0] * f[1] - c[1] * f[0],
            )
            for r in range(m):
                for k in range(6):
                    seeding.innovation[r] -= rows.matrix[link, r, k] * w[k]
        moment_deviation = force_norm * math.sqrt(0.5 * (C[0, 0] + C[1, 1] + C[2, 2]))
        point_normal = (c[0], c[1], c[2], n[0], n[1], n[2])
        _add_contact_covariance(
            rows,
            m,
            link,
            point_normal,
            (normal, tangential),
            moment_deviation,
            seeding.force_jacobian,
            seeding.weighted_innovation,
            seeding.prior_covariance,
        )


@fused_kernel
def _add_sample_covariance(  # type: ignore[no-untyped-def]
    seed_samples, friction_ratio, i, coarse_factor, force_scale, rows, m, seeding, out
):
    """`_add_contact_covariance` for a contact at sample i."""
    c = seeding.point_normal[i]
    point_normal = (c[0], c[1], c[2], c[3], c[4], c[5])
    moment_deviation = seed_samples.spread[i] * coarse_factor * force_scale
    deviations = (force_scale, RATIO_FACTOR * friction_ratio * force_scale)
    _add_contact_covariance(
        rows,
        m,
        seed_samples.link[i],
        point_normal,
        deviations,
        moment_deviation,
        seeding.force_jacobian,
        seeding.normal_jacobian[i],
        out,
    )


@fused_kernel
def find_seeds(seed_samples, friction_ratio, count, force_scale, rows, m, seeding):  # type: ignore[no-untyped-def]
    """Fill `seeding.seed` with the sets of `count` (1 to 3) samples that explain the innovation best.

    Args:
        seed_samples: The samples.
        friction_ratio: That of the prior.
        count: Number of further contacts.
        force_scale: Approximate magnitude of the forces [N].
        rows, m: The measurement and the number of its rows.
        seeding: After `transform_samples` and `initialize_seeding`.

    Returns:
        Number of seeds.
    """
    seeding.seed_score[:] = -math.inf
    if count == 1:
        _seed_single(seed_samples, friction_ratio, force_scale, rows, m, seeding)
    else:
        _seed_pairs(seed_samples, friction_ratio, count, force_scale, rows, m, seeding)
    if count == 3:
        _seed_triples(seed_samples, m, seeding)
    found = 0
    while found < seeding.seed_score.shape[0] and seeding.seed_score[found] > -math.inf:
        found += 1
    return found


@fused_kernel
def _seed_single(seed_samples, friction_ratio, force_scale, rows, m, seeding):  # type: ignore[no-untyped-def]
    """Every sample, for one further contact."""
    for i in range(seed_samples.primitive.shape[0]):
        _copy(m, seeding.prior_covariance, seeding.factor)
        _add_sample_covariance(
            seed_samples, friction_ratio, i, 1.0, force_scale, rows, m, seeding, seeding.factor
        )
        log_likelihood = _log_likelihood(m, seeding)
        if log_likelihood > seeding.seed_score[-1]:
            _weight_innovation(m, seeding)
            if _is_pushing(m, seeding, i):
                insert_seed(
                    seed_samples.primitive,
                    seeding.point_normal,
                    1,
                    log_likelihood,
                    i,
                    0,
                    0,
                    seeding.seed_score,
                    seeding.seed,
                )


@fused_kernel
def _seed_pairs(seed_samples, friction_ratio, count, force_scale, rows, m, seeding):  # type: ignore[no-untyped-def]
    """Every pair of the coarse samples: seeds of two contacts, or the beam for three."""
    seeding.beam_score[:] = -math.inf
    for e in range(seed_samples.coarse.shape[0]):
        i, S = seed_samples.coarse[e], seeding.contact_covariance[e]
        for r in range(m):
            for s in range(r + 1):
                S[r, s] = 0.0
        _add_sample_covariance(
            seed_samples, friction_ratio, i, seed_samples.coarse_factor, force_scale, rows, m, seeding, S
        )
        _sum(m, seeding.prior_covariance, S, seeding.pair_covariance)
        for d in range(e):
            k = seed_samples.coarse[d]
            _sum(m, seeding.pair_covariance, seeding.contact_covariance[d], seeding.factor)
            log_likelihood = _log_likelihood(m, seeding)
            if count > 2:
                insert_seed(
                    seed_samples.primitive,
                    seeding.point_normal,
                    2,
                    log_likelihood,
                    i,
                    k,
                    0,
                    seeding.beam_score,
                    seeding.beam,
                )
            elif log_likelihood > seeding.seed_score[-1]:
                _weight_innovation(m, seeding)
                if _is_pushing(m, seeding, i) and _is_pushing(m, seeding, k):
                    insert_seed(
                        seed_samples.primitive,
                        seeding.point_normal,
                        2,
                        log_likelihood,
                        i,
                        k,
                        0,
                        seeding.seed_score,
                        seeding.seed,
                    )


@fused_kernel
def _seed_triples(seed_samples, m, seeding):  # type: ignore[no-untyped-def]
    """The pairs of the beam, each extended by every coarse sample."""
    for t in range(seeding.beam_score.shape[0]):
        if seeding.beam_score[t] == -math.inf:
            break
        i, k = seeding.beam[t, 0], seeding.beam[t, 1]
        _copy(m, seeding.prior_covariance, seeding.pair_covariance)
        for e in range(seed_samples.coarse.shape[0]):
            if seed_samples.coarse[e] == i or seed_samples.coarse[e] == k:
                _sum(m, seeding.pair_covariance, seeding.contact_covariance[e], seeding.pair_covariance)
        for e in range(seed_samples.coarse.shape[0]):
            j = seed_samples.coarse[e]
            if j == i or j == k:  # noqa: SIM109 (a tuple would be searched slower)
                continue
            _sum(m, seeding.pair_covariance, seeding.contact_covariance[e], seeding.factor)
            log_likelihood = _log_likelihood(m, seeding)
            if log_likelihood > seeding.seed_score[-1]:
                _weight_innovation(m, seeding)
                if _is_pushing(m, seeding, i) and _is_pushing(m, seeding, k) and _is_pushing(m, seeding, j):
                    # In a fixed order, so that permutations are one seed.
                    a, c = max(i, max(k, j)), min(i, min(k, j))
                    b = i + k + j - a - c
                    insert_seed(
                        seed_samples.primitive,
                        seeding.point_normal,
                        3,
                        log_likelihood,
                        a,
                        b,
                        c,
                        seeding.seed_score,
                        seeding.seed,
                    )


@fused_kernel
def _copy(m, a, out):  # type: ignore[no-untyped-def]
    for r in range(m):
        for s in range(r + 1):
            out[r, s] = a[r, s]


@fused_kernel
def _sum(m, a, b, out):  # type: ignore[no-untyped-def]
    for r in range(m):
        for s in range(r + 1):
            out[r, s] = a[r, s] + b[r, s]


@fused_kernel
def initial_forces(seed_samples, friction_ratio, s, count, force_scale, rows, m, seeding, out):  # type: ignore[no-untyped-def]
    """Most likely forces at the samples of a seed, base axes, shape (>= count, 3) [N]."""
    coarse_factor = 1.0 if count == 1 else seed_samples.coarse_factor
    _copy(m, seeding.prior_covariance, seeding.factor)
    for e in range(count):
        _add_sample_covariance(
            seed_samples,
            friction_ratio,
            seeding.seed[s, e],
            coarse_factor,
            force_scale,
            rows,
            m,
            seeding,
            seeding.factor,
        )
    _log_likelihood(m, seeding)
    _weight_innovation(m, seeding)
    tangential_variance = (RATIO_FACTOR * friction_ratio * force_scale) ** 2
    for e in range(count):
        i = seeding.seed[s, e]
        link = seed_samples.link[i]
        c = seeding.point_normal[i]
        c0, c1, c2, n0, n1, n2 = c[0], c[1], c[2], c[3], c[4], c[5]
        b0, b1, b2 = 0.0, 0.0, 0.0
        for r in range(m):
            a, x = rows.matrix[link, r], seeding.weighted_innovation[r]
            b0 += x * (a[0] + a[4] * c2 - a[5] * c1)
            b1 += x * (a[1] + a[5] * c0 - a[3] * c2)
            b2 += x * (a[2] + a[3] * c1 - a[4] * c0)
        normal_part = (force_scale * force_scale - tangential_variance) * (b0 * n0 + b1 * n1 + b2 * n2)
        out[e, 0], out[e, 1], out[e, 2] = (
            tangential_variance * b0 + normal_part * n0,
            tangential_variance * b1 + normal_part * n1,
            tangential_variance * b2 + normal_part * n2,
        )
