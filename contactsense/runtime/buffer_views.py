"""`Constants` and `State` as views of the two flat buffers, inside a kernel.

The order of the fields is that of `contactsense.runtime.buffers`; a test compares the two.
"""

from contactsense.detection.thresholds import LONGEST_STEP_MS
from contactsense.isolation.link_hypotheses import Hypotheses, SensorModel, SensorRows
from contactsense.kinematics.model import Model, Motion
from contactsense.localization.candidate_buffers import MAX_CANDIDATES, Candidates
from contactsense.localization.none_of_these import LeftOutLinks
from contactsense.localization.simd_layout import LANES, LENGTH
from contactsense.localization.surface_cells import SurfaceCells
from contactsense.localization.surface_samples import SurfaceSamples, SurfaceSubsamples
from contactsense.residuals.bias_filter import BiasFilter
from contactsense.residuals.friction_at_rest import SLICE_COUNT, FrictionAtRest
from contactsense.residuals.joint_friction import JointTorqueModel
from contactsense.residuals.momentum_observer import MomentumObserver
from contactsense.residuals.noise_scale import NoiseScale
from contactsense.residuals.sensor_consistency import SensorConsistency
from contactsense.residuals.timing_error import TimingError
from contactsense.robots.jit.array_views import block
from contactsense.robots.jit.kernel import inlined_kernel
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.runtime.constants import Constants
from contactsense.runtime.link_sensors import LinkSensors
from contactsense.runtime.state import State
from contactsense.sensors.stream_state import LINK, StreamState
from contactsense.solvers.posterior import Prior, SearchBuffers
from contactsense.tracking.contact_tracker import WINDOWS, ContactTrack


@inlined_kernel
def _take1(buffer, at, a):  # type: ignore[no-untyped-def]
    return block(buffer, at, (a,)), at + a


@inlined_kernel
def _take2(buffer, at, a, b):  # type: ignore[no-untyped-def]
    return block(buffer, at, (a, b)), at + a * b


@inlined_kernel
def _take3(buffer, at, a, b, c):  # type: ignore[no-untyped-def]
    return block(buffer, at, (a, b, c)), at + a * b * c


@inlined_kernel
def _model(f, a, n, links):  # type: ignore[no-untyped-def]
    rotation, a = _take3(f, a, n, 3, 3)
    translation, a = _take2(f, a, n, 3)
    axis, a = _take2(f, a, n, 3)
    mass, a = _take1(f, a, n + 1)
    com, a = _take2(f, a, n + 1, 3)
    inertia, a = _take3(f, a, n + 1, 3, 3)
    rotor_inertia, a = _take1(f, a, n)
    return Model(rotation, translation, axis, mass, com, inertia, rotor_inertia), a


@inlined_kernel
def _surfaces(f, i, a, b, links, p):  # type: ignore[no-untyped-def]
    kind, b = _take1(i, b, p)
    link, b = _take1(i, b, p)
    rotation, a = _take3(f, a, p, 3, 3)
    origin, a = _take2(f, a, p, 3)
    size, a = _take2(f, a, p, 8)
    radius, a = _take1(f, a, p)
    start, b = _take1(i, b, links + 1)
    return Surfaces(kind, link, rotation, origin, size, radius, start), a, b


@inlined_kernel
def _samples(f, i, a, b, p, s):  # type: ignore[no-untyped-def]
    point, a = _take2(f, a, s, 3)
    normal, a = _take2(f, a, s, 3)
    spread, a = _take1(f, a, s)
    log_share, a = _take1(f, a, s)
    primitive, b = _take1(i, b, s)
    start, b = _take1(i, b, p + 1)
    return SurfaceSamples(point, normal, spread, log_share, primitive, start), a, b


@inlined_kernel
def _subsamples(f, i, a, b, s, t):  # type: ignore[no-untyped-def]
    point, a = _take2(f, a, t, 3)
    normal, a = _take2(f, a, t, 3)
    spread, a = _take1(f, a, t)
    log_share, a = _take1(f, a, t)
    primitive, b = _take1(i, b, t)
    start, b = _take1(i, b, s + 1)
    return SurfaceSubsamples(point, normal, spread, log_share, primitive, start), a, b


@inlined_kernel
def _cells(f, i, a, b, r, links):  # type: ignore[no-untyped-def]
    score, a = _take1(f, a, r)
    point, a = _take2(f, a, r, 3)
    normal, a = _take2(f, a, r, 3)
    force, a = _take2(f, a, r, 3)
    variance, a = _take1(f, a, r)
    spread, a = _take1(f, a, r)
    wrench, a = _take1(f, a, 6)
    information, a = _take2(f, a, 6, 6)
    unassigned_evidence, a = _take1(f, a, links)
    link_energy, a = _take1(f, a, links)
    looked, a = _take1(f, a, LENGTH)
    weighed, a = _take1(f, a, LENGTH)
    looked_number, b = _take1(i, b, LANES)
    weighed_number, b = _take1(i, b, LANES)
    primitive, b = _take1(i, b, r)
    place, b = _take1(i, b, r)
    cells = SurfaceCells(
        score, point, normal, force, variance, spread, wrench, information, unassigned_evidence, link_energy,
        looked, weighed, looked_number, weighed_number, primitive, place,
    )  # fmt: skip
    return cells, a, b


@inlined_kernel
def _sensors(f, i, a, b, n, links, u):  # type: ignore[no-untyped-def]
    depth, b = _take1(i, b, links)
    first_link, b = _take1(i, b, u)
    base_covariance, a = _take2(f, a, 6, 6)
    base_information, a = _take2(f, a, 6, 6)
    torque_variance, a = _take1(f, a, n)
    link_variance, a = _take2(f, a, u, 2)
    return (
        SensorModel(depth, first_link, base_covariance, base_information, torque_variance, link_variance),
        a,
        b,
    )


@inlined_kernel
def _link_sensors(f, i, a, b, u):  # type: ignore[no-untyped-def]
    body, b = _take1(i, b, u)
    origin, a = _take2(f, a, u, 3)
    first_body, b = _take1(i, b, u)
    mass, a = _take1(f, a, u)
    com, a = _take2(f, a, u, 3)
    inertia, a = _take3(f, a, u, 3, 3)
    return LinkSensors(body, origin, first_body, mass, com, inertia), a, b


@inlined_kernel
def _torque_model(f, a, n):  # type: ignore[no-untyped-def]
    gravity, inertia = f[a], f[a + 1]
    bias, a = _take1(f, a + 2, n)
    coulomb, a = _take1(f, a, n)
    load, a = _take1(f, a, n)
    viscous, a = _take1(f, a, n)
    lubricant, a = _take1(f, a, n)
    friction_error, a = _take1(f, a, n)
    rest_variance, a = _take1(f, a, n)
    model_variance, a = _take1(f, a, n)
    torque_model = JointTorqueModel(
        gravity, inertia, bias, coulomb, load, viscous, lubricant, friction_error,
        rest_variance, model_variance,
        f[a], f[a + 1], f[a + 2],
    )  # fmt: skip
    return torque_model, a + 3


@inlined_kernel
def _constants(f, i, n, links, p, s, t, u):  # type: ignore[no-untyped-def]
    model, a = _model(f, 0, n, links)
    surfaces, a, b = _surfaces(f, i, a, 0, links, p)
    samples, a, b = _samples(f, i, a, b, p, s)
    subsamples, a, b = _subsamples(f, i, a, b, s, t)
    sensors, a, b = _sensors(f, i, a, b, n, links, u)
    scalars = a
    log_link_density, a = _take1(f, a + 6, links)
    prior = Prior(
        f[scalars], f[scalars + 1], f[scalars + 2], f[scalars + 3], f[scalars + 4], f[scalars + 5],
        log_link_density,
    )  # fmt: skip
    touchable, b = _take1(i, b, links)
    log_weight, a = _take1(f, a, links)
    centre, a = _take2(f, a, links, 3)
    covariance, a = _take3(f, a, links, 3, 3)
    left_out = LeftOutLinks(log_weight, centre, covariance)
    gravity, a = _take1(f, a, 3)
    link_sensors, a, b = _link_sensors(f, i, a, b, u)
    torque_model, a = _torque_model(f, a, n)
    bias_rate = f[a]
    thresholds, a = _take3(f, a + 1, 4 * (u + 1), LONGEST_STEP_MS, 2)
    constants = Constants(
        model, surfaces, samples, subsamples, sensors, prior, touchable, left_out, gravity, link_sensors,
        torque_model, bias_rate, thresholds,
    )  # fmt: skip
    return constants, a, b


@inlined_kernel
def _motion(f, a, n):  # type: ignore[no-untyped-def]
    rotation, a = _take3(f, a, n + 1, 3, 3)
    origin, a = _take2(f, a, n + 1, 3)
    screw, a = _take2(f, a, n, 6)
    screw_rate, a = _take2(f, a, n, 6)
    momentum, a = _take2(f, a, n + 1, 6)
    gravity, a = _take2(f, a, n + 1, 6)
    twist, a = _take2(f, a, n + 1, 6)
    return Motion(rotation, origin, screw, screw_rate, momentum, gravity, twist), a


@inlined_kernel
def _hypotheses(f, a, links):  # type: ignore[no-untyped-def]
    wrench, a = _take2(f, a, links, 6)
    covariance, a = _take3(f, a, links, 6, 6)
    information, a = _take3(f, a, links, 6, 6)
    energy, a = _take1(f, a, links)
    log_evidence, a = _take1(f, a, links)
    return Hypotheses(wrench, covariance, information, energy, log_evidence), a


@inlined_kernel
def _candidates(f, i, a, b, p):  # type: ignore[no-untyped-def]
    rows = max(p, MAX_CANDIDATES)
    order, b = _take1(i, b, rows)
    primitive, b = _take1(i, b, rows)
    score, a = _take1(f, a, rows)
    probability, a = _take1(f, a, rows)
    point, a = _take2(f, a, rows, 3)
    normal, a = _take2(f, a, rows, 3)
    force, a = _take2(f, a, rows, 3)
    torsion, a = _take1(f, a, rows)
    covariance, a = _take3(f, a, rows, 3, 3)
    wrench, a = _take2(f, a, p, 6)
    information, a = _take3(f, a, p, 6, 6)
    rotation, a = _take3(f, a, p, 3, 3)
    origin, a = _take2(f, a, p, 3)
    candidates = Candidates(
        order,
        primitive,
        score,
        probability,
        point,
        normal,
        force,
        torsion,
        covariance,
        wrench,
        information,
        rotation,
        origin,
    )
    return candidates, a, b


@inlined_kernel
def _search_buffers(f, a):  # type: ignore[no-untyped-def]
    normal_equations, a = _take2(f, a, 6, 6)
    gradient, a = _take1(f, a, 6)
    frame, a = _take2(f, a, 3, 3)
    return SearchBuffers(normal_equations, gradient, frame), a


@inlined_kernel
def _observer(f, a, size):  # type: ignore[no-untyped-def]
    momentum, a = _take1(f, a, size)
    integrand, a = _take2(f, a, 3, size)
    residual, a = _take1(f, a, size)
    scalars, a = _take1(f, a, 7)
    return MomentumObserver(momentum, integrand, residual, scalars), a


@inlined_kernel
def _observers(f, a, groups, size):  # type: ignore[no-untyped-def]
    momentum, a = _take2(f, a, groups, size)
    integrand, a = _take3(f, a, groups, 3, size)
    residual, a = _take2(f, a, groups, size)
    scalars, a = _take2(f, a, groups, 7)
    return MomentumObserver(momentum, integrand, residual, scalars), a


@inlined_kernel
def _rows(f, i, a, b, m):  # type: ignore[no-untyped-def]
    screw, a = _take2(f, a, m, 6)
    value, a = _take1(f, a, m)
    proximal_value, a = _take1(f, a, m)
    variance, a = _take1(f, a, m)
    first_link, b = _take1(i, b, m)
    return SensorRows(screw, value, proximal_value, variance, first_link), a, b


@inlined_kernel
def _track(f, a, n, u):  # type: ignore[no-untyped-def]
    mean, a = _take2(f, a, WINDOWS, 6 * (n + 1) + 2 * n + 12 * u)
    variance_ratio, a = _take1(f, a, WINDOWS)
    residual_covariance, a = _take1(f, a, WINDOWS)
    samples, a = _take1(f, a, WINDOWS)
    age, a = _take1(f, a, WINDOWS)
    last_contact, a = _take1(f, a, 7)
    window_point, a = _take2(f, a, WINDOWS, 3)
    moment_covariance, a = _take1(f, a, 3)
    scalars, a = _take1(f, a, 7)
    return ContactTrack(
        mean,
        variance_ratio,
        residual_covariance,
        samples,
        age,
        last_contact,
        window_point,
        moment_covariance,
        scalars,
    ), a


@inlined_kernel
def _stream(f, a, n, u):  # type: ignore[no-untyped-def]
    q, a = _take1(f, a, n)
    qd, a = _take1(f, a, n)
    torque, a = _take1(f, a, n)
    base_wrench, a = _take1(f, a, 6)
    link_wrench, a = _take2(f, a, u, 6)
    timing, a = _take2(f, a, LINK + 2 * u, 3)
    steps, a = _take1(f, a, LINK + 2 * u)
    usable, a = _take1(f, a, LINK + 2 * u)
    scalars, a = _take1(f, a, 4)
    return StreamState(q, qd, torque, base_wrench, link_wrench, timing, steps, usable, scalars), a


@inlined_kernel
def _consistency(f, a):  # type: ignore[no-untyped-def]
    mean_statistic, a = _take1(f, a, 3)
    too_large, a = _take1(f, a, 2)
    excluded, a = _take1(f, a, 2)
    doubt_time, a = _take1(f, a, 2)
    scalars, a = _take1(f, a, 3)
    return SensorConsistency(mean_statistic, too_large, excluded, doubt_time, scalars), a


@inlined_kernel
def _noise_scale(f, a, n):  # type: ignore[no-untyped-def]
    base_readings, a = _take2(f, a, 3, 6)
    torque_readings, a = _take2(f, a, 3, n)
    mean_square, a = _take1(f, a, 2)
    counts, a = _take2(f, a, 2, 4)
    scale, a = _take1(f, a, 2)
    base_variance, a = _take1(f, a, 6)
    return NoiseScale(base_readings, torque_readings, mean_square, counts, scale, base_variance), a


@inlined_kernel
def _timing_error(f, a, n):  # type: ignore[no-untyped-def]
    momentum, a = _take1(f, a, n)
    rate, a = _take1(f, a, n)
    stream_variance, a = _take1(f, a, n)
    variance, a = _take1(f, a, n)
    scalars, a = _take1(f, a, 1)
    return TimingError(momentum, rate, stream_variance, variance, scalars), a


@inlined_kernel
def _bias_filter(f, a, n):  # type: ignore[no-untyped-def]
    size = 6 + 2 * n
    covariance, a = _take2(f, a, size, size)
    bias, a = _take1(f, a, 6)
    mass_regressor, a = _observer(f, a, (n + 6) * n)
    base_covariance, a = _take2(f, a, 6, 6)
    torque_variance, a = _take1(f, a, n)
    residual_mass_covariance, a = _take2(f, a, n + 6, n)
    measurement_row, a = _take1(f, a, size)
    cross_covariance, a = _take1(f, a, size)
    correction, a = _take1(f, a, size)
    wrench_correction, a = _take2(f, a, 2, 6)
    scalars, a = _take1(f, a, 3)
    return BiasFilter(
        covariance,
        bias,
        mass_regressor,
        base_covariance,
        torque_variance,
        residual_mass_covariance,
        measurement_row,
        cross_covariance,
        correction,
        wrench_correction,
        scalars,
    ), a


@inlined_kernel
def _friction_at_rest(f, a, n):  # type: ignore[no-untyped-def]
    mean_residual, a = _take2(f, a, SLICE_COUNT + 1, n)
    slices, a = _take2(f, a, SLICE_COUNT + 1, 3)
    anchor, a = _take1(f, a, n)
    scalars, a = _take1(f, a, 8)
    return FrictionAtRest(mean_residual, slices, anchor, scalars), a


@inlined_kernel
def buffer_views(f, i, sizes):  # type: ignore[no-untyped-def]
    """`Constants` and `State` as views of the flat buffers.

    Args:
        f, i: `KernelBuffers.floats` and `KernelBuffers.integers`.
        sizes: `KernelBuffers.sizes`: numbers of joints, links, primitives, surface samples, subsamples and
            link sensors.
    """
    n, links, p, s, t, u = sizes
    constants, a, b = _constants(f, i, n, links, p, s, t, u)
    model, a = _model(f, a, n, links)
    torque_model, a = _torque_model(f, a, n)
    bias_filter, a = _bias_filter(f, a, n)
    friction_at_rest, a = _friction_at_rest(f, a, n)
    motion, a = _motion(f, a, n)
    hypotheses, a = _hypotheses(f, a, links)
    candidates, a, b = _candidates(f, i, a, b, p)
    search_buffers, a = _search_buffers(f, a)
    surface_cells, a, b = _cells(f, i, a, b, s + t, links)
    link_probability, a = _take1(f, a, links)
    joint_observer, a = _observer(f, a, n)
    base_observer, a = _observer(f, a, 6 * (n + 1))
    torque_difference, a = _observer(f, a, n)
    link_observer, a = _observers(f, a, u, 6)
    link_difference, a = _observers(f, a, u, 6)
    track, a = _track(f, a, n, u)
    stream, a = _stream(f, a, n, u)
    consistency, a = _consistency(f, a)
    noise_scale, a = _noise_scale(f, a, n)
    timing_error, a = _timing_error(f, a, n)
    link_load, a = _take3(f, a, u, 2, 6)
    link_origin, a = _take2(f, a, u, 3)
    unbiased_wrench, a = _take1(f, a, 6)
    base_covariance, a = _take2(f, a, 6, 6)
    base_information, a = _take2(f, a, 6, 6)
    base_wrench, a = _take1(f, a, 6)
    body_wrench, a = _take2(f, a, n + 1, 6)
    torque, a = _take1(f, a, n)
    proximal_torque, a = _take1(f, a, n)
    link_wrench, a = _take2(f, a, u, 6)
    proximal_link_wrench, a = _take2(f, a, u, 6)
    wrench_change, a = _take1(f, a, 6)
    unmodelled_std, a = _take1(f, a, n)
    torque_variance, a = _take1(f, a, n)
    link_variance, a = _take2(f, a, u, 6)
    link_mass_variance, a = _take2(f, a, u, 6)
    rows, a, b = _rows(f, i, a, b, n + 6 * u)
    statistics, a = _take1(f, a, 5)
    zero_velocity, a = _take1(f, a, n)
    candidate_links, b = _take1(i, b, links)
    state = State(
        model, torque_model, bias_filter, friction_at_rest, motion, hypotheses, candidates, search_buffers,
        surface_cells, link_probability, joint_observer, base_observer, torque_difference, link_observer,
        link_difference, track, stream, consistency, noise_scale, timing_error, link_load, link_origin,
        unbiased_wrench, base_covariance, base_information, base_wrench, body_wrench, torque, proximal_torque,
        link_wrench, proximal_link_wrench, wrench_change, unmodelled_std, torque_variance, link_variance,
        link_mass_variance, rows, statistics, zero_velocity, candidate_links,
    )  # fmt: skip
    return constants, state
