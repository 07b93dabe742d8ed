"""Particle filter for several contacts with one particle set each and exploring particles, similar to MCP-EP
(Han & Kim 2023).

It uses joint torques and base wrench. Contacts start one after another, at most one per link. Each round
moves the newest set; the earlier ones are fixed at their best places. The set's particles walk on the
surface, exploring particles are placed at random on all links without another set, and all are weighted by
the residual of one QP over the forces of all contacts together. The set is resampled from both, so that an
exploring particle that explains the measurement better moves the set to another link. If the residual remains
larger than noise explains, a set is added.
"""

from typing import NamedTuple

import numpy as np

from contactsense import Scene
from contactsense.benchmarks.peers.method import Answers
from contactsense.benchmarks.peers.single import (
    Problem,
    add_contact,
    new_problem,
    resample,
    solve_contacts,
)
from contactsense.benchmarks.peers.skin_table import scattered
from contactsense.benchmarks.peers.stage import Stage, build_stage, measure, to_base
from contactsense.benchmarks.peers.walk import walk
from contactsense.kinematics.forward_kinematics import forward_kinematics
from contactsense.robots.jit.kernel import allocating_kernel, kernel

PARTICLES = 50
"""Number of particles in a set."""
EXPLORERS = 150
"""Number of exploring particles of each set in each round."""
ROUNDS = 30
"""Number of rounds for one measurement."""
SHORT, LONG = 0.001, 0.05
"""Range of the standard deviation of a step, log-uniform [m]."""
LEAST_TORQUE, LEAST_MOMENT = 0.1, 0.03
"""Minimum noise assumed for joint torques and base moment [Nm]: the given surface has an error of about a
millimetre, in addition to the noise of the sensors."""
FLAT = 0.001
"""Sharpness of the first round's weights relative to the last one's, so that the particles do not all move to
the first link that roughly explains the measurement."""
EXCESS = 30.0
"""Squared residual in units of the noise above which a contact is missing: with 13 rows, its mean is at most
13."""
_DENSITY = 4000.0
"""Density of random places for exploration [1/m^2]."""


class Found(NamedTuple):
    """Up to K contacts after each of T measurements of N runs; base axes."""

    link: np.ndarray
    """Index of the link, -1 without such a contact, shape (N, T, K), int64."""
    point_base: np.ndarray
    """Shape (N, T, K, 3) [m]."""


class ExplorationFilter:
    """The filter with at most `contacts` sets."""

    def __init__(self, scene: Scene, contacts: int = 1, rounds: int = ROUNDS, seed: int = 0) -> None:
        """For a scene's arm; a sensor that the scene does not have is omitted."""
        self.name = "exploring particle filter"
        self._stage = build_stage(scene, LEAST_TORQUE, LEAST_MOMENT)
        self._contacts, self._rounds, self._seed = contacts, rounds, seed
        table = scattered(self._stage.surfaces, _DENSITY, seed)
        first = np.searchsorted(table.link, np.unique(table.link))
        self._places = Places(table.point, table.normal, table.link, np.append(first, len(table.link)))

    def __call__(
        self, q: np.ndarray, base_wrench: np.ndarray | None, joint_torque: np.ndarray | None
    ) -> Answers:
        found = self.follow(
            q,
            None if base_wrench is None else base_wrench[:, None],
            None if joint_torque is None else joint_torque[:, None],
        )
        return Answers(found.link[:, 0, 0], found.point_base[:, 0, 0])

    def follow(self, q: np.ndarray, base_wrench: np.ndarray | None, joint_torque: np.ndarray | None) -> Found:
        """Run the filter through T measurements of each of N postures, each started without contacts.

        Args:
            q: Shape (N, n) [rad].
            base_wrench, joint_torque: As for `contactsense.benchmarks.peers.method.Method`, shapes (N, T, 6)
            and (N, T, n).
        """
        if base_wrench is None and joint_torque is None:
            raise ValueError("base_wrench, joint_torque: expected at least one of the two, got none")
        runs, joints = np.shape(q)
        steps = (joint_torque if base_wrench is None else base_wrench).shape[1]  # type: ignore[union-attr]
        sets = self._contacts
        base = np.zeros((runs, steps, 6)) if base_wrench is None else base_wrench
        torque = np.zeros((runs, steps, joints)) if joint_torque is None else joint_torque
        found = Found(np.full((runs, steps, sets), -1), np.zeros((runs, steps, sets, 3)))
        q, base, torque = (np.ascontiguousarray(array, dtype=np.float64) for array in (q, base, torque))
        rng = np.random.default_rng(self._seed)
        _run(rng, self._stage, self._places, q, base, torque, self._rounds, found)
        return found


class Places(NamedTuple):
    """Random places on the surface, sorted by link, in the frames of the links."""

    point: np.ndarray
    """Shape (M, 3) [m]."""
    normal: np.ndarray
    """Outward unit normals, shape (M, 3)."""
    link: np.ndarray
    """Index of the link, ascending, shape (M,), int64."""
    first: np.ndarray
    """First place of each link that has any, and their number at the end, int64."""


class Sets(NamedTuple):
    """The particles of all sets, and the best of each."""

    on: np.ndarray
    """Links, shape (sets, particles), int64."""
    at: np.ndarray
    """Places, link frame, shape (sets, particles, 3)."""
    out: np.ndarray
    """Normals, shape (sets, particles, 3)."""
    best_on: np.ndarray
    """Link of each set's best particle, -1 if there is no such set, shape (sets,), int64."""
    best_at: np.ndarray
    """Shape (sets, 3)."""
    best_out: np.ndarray
    """Shape (sets, 3)."""


class Pool(NamedTuple):
    """Scratch: particles of a set that have moved, and exploring particles, in one round."""

    on: np.ndarray
    """Links, shape (pool,), int64."""
    at: np.ndarray
    """Places, link frame, shape (pool, 3) [m]."""
    out: np.ndarray
    """Normals, shape (pool, 3)."""
    cost: np.ndarray
    """Squared residual of each in units of the noise, shape (pool,)."""
    chosen: np.ndarray
    """Those that are drawn, shape (pool,), int64."""


@allocating_kernel
def _run(
    rng: np.random.Generator,
    stage: Stage,
    places: Places,
    q: np.ndarray,
    base_wrench: np.ndarray,
    joint_torque: np.ndarray,
    rounds: int,
    found: Found,
) -> None:
    most = found.link.shape[2]
    m, size = q.shape[1] + 6, PARTICLES + EXPLORERS
    problem = new_problem(most, m)
    sets = Sets(
        np.empty((most, PARTICLES), dtype=np.int64), np.empty((most, PARTICLES, 3)),
        np.empty((most, PARTICLES, 3)), np.empty(most, dtype=np.int64), np.empty((most, 3)),
        np.empty((most, 3)),
    )  # fmt: skip
    pool = Pool(
        np.empty(size, dtype=np.int64), np.empty((size, 3)), np.empty((size, 3)), np.empty(size),
        np.empty(size, dtype=np.int64),
    )  # fmt: skip
    for i in range(q.shape[0]):
        forward_kinematics(stage.model, q[i], stage.motion)
        sets.best_on[:] = -1
        count = 0
        for t in range(base_wrench.shape[1]):
            measure(stage.noise, joint_torque[i, t], base_wrench[i, t], problem.b)
            square = 0.0
            for r in range(m):
                square += problem.b[r] * problem.b[r]
            for turn in range(rounds):
                # A set is added if the existing ones leave too much unexplained: at once if a new measurement
                # differs, and after they had half of the rounds to settle.
                if count < most and (turn == 0 or turn == rounds // 2):
                    left = _forces(stage, problem, square, sets, count)
                    if count == 0 or left > EXCESS:
                        _throw(rng, sets, count, places)
                        count += 1
                sharpness = FLAT ** (1.0 - turn / rounds)
                _turn(rng, stage, places, problem, square, sets, count, sharpness, pool)
            for c in range(count):
                found.link[i, t, c] = sets.best_on[c]
                x, y, z = sets.best_at[c]
                found.point_base[i, t, c] = to_base(stage.motion, sets.best_on[c], x, y, z)


@allocating_kernel
def _anywhere(rng: np.random.Generator, first: np.ndarray) -> int:
    """Index of a random place: a touchable link, all equally probable, then a place on it."""
    link = rng.integers(0, first.shape[0] - 1)
    place: int = rng.integers(first[link], first[link + 1])
    return place


@allocating_kernel
def _throw(rng: np.random.Generator, sets: Sets, c: int, places: Places) -> None:
    """Start set `c` at random places."""
    for k in range(sets.on.shape[1]):
        start = _anywhere(rng, places.first)
        sets.on[c, k] = places.link[start]
        sets.at[c, k], sets.out[c, k] = places.point[start], places.normal[start]
    sets.best_on[c], sets.best_at[c], sets.best_out[c] = sets.on[c, 0], sets.at[c, 0], sets.out[c, 0]


@kernel
def _taken(sets: Sets, c: int, count: int, link: int) -> bool:
    """Whether a set other than `c` is on a link."""
    taken = False
    for other in range(count):
        taken = taken or (other != c and sets.best_on[other] == link)
    return taken


@allocating_kernel
def _turn(
    rng: np.random.Generator,
    stage: Stage,
    places: Places,
    problem: Problem,
    square: float,
    sets: Sets,
    count: int,
    sharpness: float,
    pool: Pool,
) -> None:
    """One round of the newest set."""
    c = count - 1
    on, at, out, cost, chosen = pool
    size = on.shape[0]
    number = 0
    for other in range(count):
        if other != c:
            best_at, best_out = sets.best_at[other], sets.best_out[other]
            add_contact(stage, sets.best_on[other], best_at, best_out, number, problem)
            number += 1
    span = np.log(LONG / SHORT)
    for k in range(size):
        if k == 0:
            # The best particle so far is kept, so that the result never becomes worse.
            on[k], at[k], out[k] = sets.best_on[c], sets.best_at[c], sets.best_out[c]
        elif k < PARTICLES:
            step = SHORT * np.exp(span * rng.random())
            on[k] = walk(rng, stage, step, sets.on[c, k], sets.at[c, k], sets.out[c, k], at[k], out[k])
        else:
            start = _anywhere(rng, places.first)
            on[k], at[k], out[k] = places.link[start], places.point[start], places.normal[start]
        if k > 0 and _taken(sets, c, count, on[k]):
            cost[k] = np.inf
            continue
        add_contact(stage, on[k], at[k], out[k], number, problem)
        cost[k] = solve_contacts(problem, square, count)
    best = np.argmin(cost)
    sets.best_on[c], sets.best_at[c], sets.best_out[c] = on[best], at[best], out[best]
    for k in range(size):
        cost[k] *= sharpness
    resample(rng, cost, chosen)
    for k in range(PARTICLES):
        # Evenly spaced among those drawn from the pool, since the draw is sorted.
        pick = chosen[k * size // PARTICLES]
        sets.on[c, k], sets.at[c, k], sets.out[c, k] = on[pick], at[pick], out[pick]


@kernel
def _forces(stage: Stage, problem: Problem, square: float, sets: Sets, count: int) -> float:
    """Solve for the forces of all sets at their best places; returns the squared residual."""
    for c in range(count):
        add_contact(stage, sets.best_on[c], sets.best_at[c], sets.best_out[c], c, problem)
    return solve_contacts(problem, square, count)
