"""`Arm` and `Memory` as views of a workspace's two buffers, inside a kernel.

The order is that of `contactsense.workspace`, in which the fields are declared; a test holds the two
together.
"""

from contactsense.arm import Arm
from contactsense.candidates import MOST, Candidates
from contactsense.cells import Cells
from contactsense.drive import Drive
from contactsense.energy import Prior, Work
from contactsense.follower import Follower
from contactsense.health import Health
from contactsense.isolation import Hypotheses, Sensors
from contactsense.lanes import LANES, LENGTH
from contactsense.levels import SLOWEST
from contactsense.memory import Memory
from contactsense.observer import Observer
from contactsense.places import Parts, Places
from contactsense.stiction import SLICES, Stiction
from contactsense.stream import Stream
from contactsense.tracker import WINDOWS, Track
from kinematics.model import Model, Motion
from robots.arrays import block
from robots.compiled import inlined_kernel
from robots.surface import Surfaces


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
def _places(f, i, a, b, p, s):  # type: ignore[no-untyped-def]
    point, a = _take2(f, a, s, 3)
    normal, a = _take2(f, a, s, 3)
    spread, a = _take1(f, a, s)
    log_share, a = _take1(f, a, s)
    primitive, b = _take1(i, b, s)
    start, b = _take1(i, b, p + 1)
    return Places(point, normal, spread, log_share, primitive, start), a, b


@inlined_kernel
def _parts(f, i, a, b, s, t):  # type: ignore[no-untyped-def]
    point, a = _take2(f, a, t, 3)
    normal, a = _take2(f, a, t, 3)
    spread, a = _take1(f, a, t)
    log_share, a = _take1(f, a, t)
    primitive, b = _take1(i, b, t)
    start, b = _take1(i, b, s + 1)
    return Parts(point, normal, spread, log_share, primitive, start), a, b


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
    rest, a = _take1(f, a, links)
    looked, a = _take1(f, a, LENGTH)
    weighed, a = _take1(f, a, LENGTH)
    looked_number, b = _take1(i, b, LANES)
    weighed_number, b = _take1(i, b, LANES)
    primitive, b = _take1(i, b, r)
    place, b = _take1(i, b, r)
    cells = Cells(
        score, point, normal, force, variance, spread, wrench, information, rest, looked, weighed,
        looked_number, weighed_number, primitive, place,
    )  # fmt: skip
    return cells, a, b


@inlined_kernel
def _sensors(f, i, a, b, n, links):  # type: ignore[no-untyped-def]
    depth, b = _take1(i, b, links)
    beyond_wrist, b = _take1(i, b, links)
    base_covariance, a = _take2(f, a, 6, 6)
    base_information, a = _take2(f, a, 6, 6)
    torque_variance, a = _take1(f, a, n)
    wrist_variance, a = _take1(f, a, 2)
    return (
        Sensors(depth, beyond_wrist, base_covariance, base_information, torque_variance, wrist_variance),
        a,
        b,
    )


@inlined_kernel
def _drive(f, a, n):  # type: ignore[no-untyped-def]
    gravity, inertia = f[a], f[a + 1]
    bias, a = _take1(f, a + 2, n)
    coulomb, a = _take1(f, a, n)
    load, a = _take1(f, a, n)
    viscous, a = _take1(f, a, n)
    lubricant, a = _take1(f, a, n)
    friction_error, a = _take1(f, a, n)
    rest_variance, a = _take1(f, a, n)
    model_variance, a = _take1(f, a, n)
    drive = Drive(
        gravity, inertia, bias, coulomb, load, viscous, lubricant, friction_error,
        rest_variance, model_variance,
        f[a], f[a + 1], f[a + 2],
    )  # fmt: skip
    return drive, a + 3


@inlined_kernel
def _arm(f, i, n, links, p, s, t):  # type: ignore[no-untyped-def]
    model, a = _model(f, 0, n, links)
    surfaces, a, b = _surfaces(f, i, a, 0, links, p)
    places, a, b = _places(f, i, a, b, p, s)
    parts, a, b = _parts(f, i, a, b, s, t)
    sensors, a, b = _sensors(f, i, a, b, n, links)
    prior = Prior(f[a], f[a + 1], f[a + 2], f[a + 3], f[a + 4], f[a + 5])
    touchable, b = _take1(i, b, links)
    gravity, a = _take1(f, a + 6, 3)
    tool_mass = f[a]
    tool_com, a = _take1(f, a + 1, 3)
    tool_inertia, a = _take2(f, a, 3, 3)
    wrist_rotation, a = _take2(f, a, 3, 3)
    wrist_origin, a = _take1(f, a, 3)
    drive, a = _drive(f, a, n)
    bias_rate = f[a]
    levels, a = _take3(f, a + 1, 8, SLOWEST, 2)
    arm = Arm(
        model, surfaces, places, parts, sensors, prior, touchable, gravity, tool_mass, tool_com, tool_inertia,
        wrist_rotation, wrist_origin, drive, bias_rate, levels,
    )  # fmt: skip
    return arm, a, b


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
    rows = max(p, MOST)
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
    found = Candidates(
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
    return found, a, b


@inlined_kernel
def _work(f, a):  # type: ignore[no-untyped-def]
    normal_equations, a = _take2(f, a, 6, 6)
    gradient, a = _take1(f, a, 6)
    frame, a = _take2(f, a, 3, 3)
    return Work(normal_equations, gradient, frame), a


@inlined_kernel
def _observer(f, a, size):  # type: ignore[no-untyped-def]
    momentum, a = _take1(f, a, size)
    past, a = _take2(f, a, 3, size)
    residual, a = _take1(f, a, size)
    clock, a = _take1(f, a, 7)
    return Observer(momentum, past, residual, clock), a


@inlined_kernel
def _track(f, a, n):  # type: ignore[no-untyped-def]
    mean, a = _take2(f, a, WINDOWS, 6 * (n + 1) + 2 * n + 12)
    gain, a = _take1(f, a, WINDOWS)
    shared, a = _take1(f, a, WINDOWS)
    samples, a = _take1(f, a, WINDOWS)
    age, a = _take1(f, a, WINDOWS)
    place, a = _take1(f, a, 7)
    apart, a = _take2(f, a, WINDOWS, 3)
    spread, a = _take1(f, a, 3)
    life, a = _take1(f, a, 7)
    return Track(mean, gain, shared, samples, age, place, apart, spread, life), a


@inlined_kernel
def _stream(f, a, n):  # type: ignore[no-untyped-def]
    q, a = _take1(f, a, n)
    qd, a = _take1(f, a, n)
    torque, a = _take1(f, a, n)
    base_wrench, a = _take1(f, a, 6)
    wrist_wrench, a = _take1(f, a, 6)
    feeds, a = _take2(f, a, 5, 3)
    steps, a = _take1(f, a, 5)
    usable, a = _take1(f, a, 5)
    clock, a = _take1(f, a, 4)
    return Stream(q, qd, torque, base_wrench, wrist_wrench, feeds, steps, usable, clock), a


@inlined_kernel
def _health(f, a):  # type: ignore[no-untyped-def]
    level, a = _take1(f, a, 3)
    large, a = _take1(f, a, 2)
    left_out, a = _take1(f, a, 2)
    doubt, a = _take1(f, a, 2)
    clock, a = _take1(f, a, 3)
    return Health(level, large, left_out, doubt, clock), a


@inlined_kernel
def _follower(f, a, n):  # type: ignore[no-untyped-def]
    size = 6 + 2 * n
    covariance, a = _take2(f, a, size, size)
    bias, a = _take1(f, a, 6)
    weights, a = _observer(f, a, (n + 6) * n)
    base, a = _take2(f, a, 6, 6)
    torque, a = _take1(f, a, n)
    weighed, a = _take2(f, a, n + 6, n)
    row, a = _take1(f, a, size)
    image, a = _take1(f, a, size)
    change, a = _take1(f, a, size)
    wrench, a = _take2(f, a, 2, 6)
    clock, a = _take1(f, a, 3)
    return Follower(covariance, bias, weights, base, torque, weighed, row, image, change, wrench, clock), a


@inlined_kernel
def _stiction(f, a, n):  # type: ignore[no-untyped-def]
    level, a = _take2(f, a, SLICES + 1, n)
    slices, a = _take2(f, a, SLICES + 1, 3)
    anchor, a = _take1(f, a, n)
    clock, a = _take1(f, a, 8)
    return Stiction(level, slices, anchor, clock), a


@inlined_kernel
def unfold(f, i, sizes):  # type: ignore[no-untyped-def]
    """`Arm` and `Memory` as views of a workspace's buffers.

    Args:
        f, i: Its `floats` and `integers`.
        sizes: Its `sizes`: numbers of joints, links, primitives, places and parts.
    """
    n, links, p, s, t = sizes
    arm, a, b = _arm(f, i, n, links, p, s, t)
    model, a = _model(f, a, n, links)
    drive, a = _drive(f, a, n)
    follower, a = _follower(f, a, n)
    stiction, a = _stiction(f, a, n)
    motion, a = _motion(f, a, n)
    hypotheses, a = _hypotheses(f, a, links)
    found, a, b = _candidates(f, i, a, b, p)
    work, a = _work(f, a)
    cells, a, b = _cells(f, i, a, b, s + t, links)
    link_probability, a = _take1(f, a, links)
    joints, a = _observer(f, a, n)
    base, a = _observer(f, a, 6 * (n + 1))
    match, a = _observer(f, a, n)
    wrist, a = _observer(f, a, 6)
    wrist_match, a = _observer(f, a, 6)
    track, a = _track(f, a, n)
    stream, a = _stream(f, a, n)
    health, a = _health(f, a)
    carried, a = _take2(f, a, 2, 6)
    wrist_place, a = _take1(f, a, 3)
    reading, a = _take1(f, a, 6)
    base_covariance, a = _take2(f, a, 6, 6)
    base_information, a = _take2(f, a, 6, 6)
    base_wrench, a = _take1(f, a, 6)
    body_wrench, a = _take2(f, a, n + 1, 6)
    torque, a = _take1(f, a, n)
    seen_torque, a = _take1(f, a, n)
    wrist_wrench, a = _take1(f, a, 6)
    seen_wrist, a = _take1(f, a, 6)
    change, a = _take1(f, a, 6)
    unexplained, a = _take1(f, a, n)
    torque_variance, a = _take1(f, a, n)
    fit, a = _take1(f, a, 5)
    rest, a = _take1(f, a, n)
    choice, b = _take1(i, b, links)
    memory = Memory(
        model, drive, follower, stiction, motion, hypotheses, found, work, cells, link_probability, joints,
        base, match, wrist, wrist_match, track, stream, health, carried, wrist_place, reading,
        base_covariance, base_information, base_wrench, body_wrench, torque, seen_torque, wrist_wrench,
        seen_wrist, change, unexplained, torque_variance, fit, rest, choice,
    )  # fmt: skip
    return arm, memory
