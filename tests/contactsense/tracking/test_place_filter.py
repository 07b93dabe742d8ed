"""The filter of the place of a contact: its evidence is that of all samples at once; when it gives up."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest

from contactsense import JointTorqueSensor, Scene, robots
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.kinematics.model import Motion, build_model, empty_motion
from contactsense.robots.jit.flat_buffers import zeros
from contactsense.robots.vectors import tangents
from contactsense.runtime.constants import Constants, build_constants
from contactsense.runtime.state import empty_state
from contactsense.tracking import place_filter
from contactsense.tracking.place_filter import PlaceFilter, add_sample, end_block, start_filter

DT, BANDWIDTH = 0.004, 10.0
PER_BLOCK, BLOCKS = 5, 4
DRIFT = np.array(
    [
        place_filter.FORCE_DRIFT,
        place_filter.DIRECTION_DRIFT,
        place_filter.DIRECTION_DRIFT,
        place_filter.TORSION_DRIFT,
        place_filter.PLACE_DRIFT,
        place_filter.PLACE_DRIFT,
    ]
)


@dataclass
class _Case:
    """A push on link 3 of a moving UR5e, seen by torques alone."""

    constants: Constants
    touched: int
    """The cell that is touched."""
    motion: list[Motion]
    torque: np.ndarray
    """External torque of each joint at each sample, shape (N, 6) [Nm]."""


def _wrench(constants: Constants, motion: Motion, s: int, x: np.ndarray) -> np.ndarray:
    """Wrench of the push on cell s with unknowns x, base axes, about the base origin."""
    samples, surfaces = constants.samples, constants.surfaces
    body = constants.sensors.depth[surfaces.link[samples.primitive[s]]]
    R, o, n = motion.rotation[body], motion.origin[body], samples.normal[s]
    t1, t2 = (np.array(t) for t in tangents(tuple(n)))
    normal_force = constants.prior.force * np.exp(x[0])
    force = R @ (normal_force * (-n + x[1] * t1 + x[2] * t2))
    point = o + R @ (samples.point[s] + x[4] * t1 + x[5] * t2)
    return np.concatenate((force, np.cross(point, force) + normal_force * x[3] * (R @ n)))


def _torques(constants: Constants, motion: Motion, s: int, x: np.ndarray) -> np.ndarray:
    """Torque of each joint due to that push: that of the joints below the link."""
    link = constants.surfaces.link[constants.samples.primitive[s]]
    torque: np.ndarray = motion.screw @ _wrench(constants, motion, s, x)
    torque[constants.sensors.depth[link] :] = 0.0
    return torque


@pytest.fixture(scope="module")
def case() -> _Case:
    robot = robots.load("ur5e")
    constants = build_constants(
        Scene(robot=robot, base_wrench=None, joint_torque=JointTorqueSensor(noise=0.3))
    )
    model = build_model(robot)
    rng = np.random.default_rng(5)
    links = constants.surfaces.link[constants.samples.primitive]
    touched = int(np.flatnonzero(links == 3)[20])
    start, speed = np.array([0.3, -1.2, 1.4, -1.0, -1.2, 0.2]), np.array([0.8, -0.6, 0.9, 0.5, -0.7, 1.0])
    count = 1 + BLOCKS * PER_BLOCK
    motions = []
    for i in range(count):
        motion = empty_motion(6)
        forward_kinematics(model, start + speed * DT * i, motion)
        motions.append(motion)
    x = np.array([0.3, 0.1, -0.15, 0.001, 0.004, -0.003])
    torque = np.array([_torques(constants, motion, touched, x) for motion in motions])
    return _Case(constants, touched, motions, torque + 0.3 * rng.standard_normal(torque.shape))


def _filtered(case: _Case, torque: np.ndarray) -> np.ndarray:
    """The observer's residuals: low-passed torques."""
    decay = np.exp(-2.0 * np.pi * BANDWIDTH * DT)
    residual = torque.copy()
    for i in range(1, len(torque)):
        residual[i] = decay * residual[i - 1] + (1.0 - decay) * torque[i]
    return residual


def _run(case: _Case, torque: np.ndarray, noise: float) -> tuple[PlaceFilter, list[bool]]:
    constants = case.constants
    places = zeros(PlaceFilter, samples=len(constants.samples.spread), joints=6, links=7)
    buffers = empty_state(constants).search_buffers
    variance, error, depth = np.full(6, noise**2), np.zeros(6), constants.sensors.depth
    residual = _filtered(case, torque)
    fixed = (constants.samples, constants.surfaces.link, depth)
    start_filter(places, *fixed, case.motion[0], residual[0], variance, constants.prior, buffers)
    explained = []
    for motion, r in zip(case.motion[1:], residual[1:], strict=True):
        if add_sample(places, depth, motion, r, DT, BANDWIDTH):
            explained.append(end_block(places, *fixed, variance, error, constants.prior, buffers))
    return places, explained


def _batch_log_evidence(case: _Case, s: int, noise: float, blocks: int) -> float:
    """Log evidence of cell s for the first sample and that many blocks at once, by Laplace's method: unknowns
    of all blocks together, Jacobian by differences."""
    constants, prior = case.constants, case.constants.prior
    groups = [[0]] + [list(range(1 + PER_BLOCK * b, 1 + PER_BLOCK * (b + 1))) for b in range(blocks)]
    spread = constants.samples.spread[s]
    first = np.array([1.0, prior.friction_ratio, prior.friction_ratio, prior.torsion_lever, spread, spread])
    step = np.sqrt(DRIFT * PER_BLOCK * DT)

    def whitened(flat: np.ndarray) -> np.ndarray:
        x = flat.reshape(len(groups), 6)
        parts = [x[0] / first, ((x[1:] - x[:-1]) / step).ravel()]
        for rows, unknowns in zip(groups, x, strict=True):
            predicted = np.mean([_torques(constants, case.motion[i], s, unknowns) for i in rows], axis=0)
            measured = case.torque[rows].mean(axis=0)
            parts.append((measured - predicted) / (noise / np.sqrt(len(rows))))
        return np.concatenate(parts)

    flat = np.zeros(6 * len(groups))
    scale = np.tile(first, len(groups))
    for _ in range(6):
        r = whitened(flat)
        J = np.empty((len(r), len(flat)))
        for k in range(len(flat)):
            h = np.zeros_like(flat)
            h[k] = 1e-5 * scale[k]
            J[:, k] = (whitened(flat + h) - whitened(flat - h)) / (2.0 * h[k])
        change = np.linalg.lstsq(J, -r, rcond=None)[0]
        flat += change * min(1.0, 1.0 / np.abs(change[::6]).max())
    r = whitened(flat)
    log_prior_scale = np.log(first).sum() + (len(groups) - 1) * np.log(step).sum()
    log_det = np.linalg.slogdet(J.T @ J)[1]
    return float(constants.samples.log_share[s] - 0.5 * r @ r - 0.5 * log_det - log_prior_scale)


def _with_forgetting(case: _Case, s: int, noise: float) -> float:
    """The same, with what earlier blocks tell shrunk before each block."""
    kept = np.exp(-PER_BLOCK * DT / place_filter.FORGETTING_TIME)
    batch = [_batch_log_evidence(case, s, noise, blocks) for blocks in range(1 + BLOCKS)]
    total = batch[0]
    for before, after in pairwise(batch):
        total = kept * total + after - before
    return total


def test_evidence_is_that_of_all_samples_at_once(case: _Case) -> None:
    """An extended Kalman filter linearizes once per block; so the two differ by some tenths."""
    places, explained = _run(case, case.torque, 0.3)
    assert all(explained)
    probable = np.argsort(-places.log_weight)[:6]
    assert places.log_weight[probable[-1]] > places.log_weight[probable[0]] - 6.0
    batch = np.array([_with_forgetting(case, int(s), 0.3) for s in probable])
    difference = places.log_weight[probable] - batch
    weight = np.exp(places.log_weight[probable] - places.log_weight.max())
    difference -= np.average(difference, weights=weight)
    assert np.abs(difference).max() < 1.0
    assert np.average(np.abs(difference), weights=weight) < 0.2


def test_touched_link_becomes_more_probable(case: _Case) -> None:
    links = case.constants.surfaces.link[case.constants.samples.primitive]

    def probability(places: PlaceFilter) -> float:
        weight = np.exp(places.log_weight - places.log_weight.max())
        return float(weight[links == 3].sum() / weight.sum())

    first, _ = _run(
        _Case(case.constants, case.touched, case.motion[:1], case.torque[:1]), case.torque[:1], 0.3
    )
    last, _ = _run(case, case.torque, 0.3)
    assert probability(last) > probability(first)
    assert np.isfinite(last.log_weight[case.touched])


def test_another_contact_is_not_explained(case: _Case) -> None:
    """The push jumps to the second wrist's side and back: no place on the arm explains both."""
    torque = case.torque.copy()
    torque[1 + 3 * PER_BLOCK :] *= -1.0
    _, explained = _run(case, torque, 0.3)
    assert all(explained[:3])
    assert not explained[3]


def test_model_error_does_not_average_out(case: _Case) -> None:
    """With an error of 1 Nm of every torque's model, four blocks tell hardly more than the first sample."""
    constants = case.constants
    buffers, depth = empty_state(constants).search_buffers, constants.sensors.depth
    fixed = (constants.samples, constants.surfaces.link, depth)
    variance, error = np.full(6, 0.09), np.full(6, 1.0)
    places = zeros(PlaceFilter, samples=len(constants.samples.spread), joints=6, links=7)
    residual = _filtered(case, case.torque)
    start_filter(places, *fixed, case.motion[0], residual[0], variance + error, constants.prior, buffers)
    before = places.log_determinant[case.touched]
    for motion, r in zip(case.motion[1:], residual[1:], strict=True):
        if add_sample(places, depth, motion, r, DT, BANDWIDTH):
            end_block(places, *fixed, variance, error, constants.prior, buffers)
    exact, _ = _run(case, case.torque, 0.3)
    assert places.log_determinant[case.touched] < before + 1.0
    assert exact.log_determinant[case.touched] > before + 5.0
