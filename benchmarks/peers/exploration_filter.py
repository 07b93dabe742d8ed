"""Particle filter for several contacts with one particle set each and exploring particles, similar to MCP-EP
(Han & Kim 2023).

It uses joint torques and base wrench. Contacts start one after another, at most one per link. Each round
processes the sets in turn: the other sets are fixed at their best places, the set's particles walk on the
surface, exploring particles are placed at random on all links without another set, and all are weighted by
the residual of one QP over the forces of all contacts together. The set is resampled from both, so that an
exploring particle that explains the measurement better moves the set to another link. If the residual remains
larger than noise explains, a set is added.
"""

from typing import NamedTuple

import numpy as np

from contactsense import Scene
from contactsense.benchmarks.peers.friction import EDGES, solve
from contactsense.benchmarks.peers.method import Answers
from contactsense.benchmarks.peers.single import add_contact, force_of, resample
from contactsense.benchmarks.peers.skin_table import scattered
from contactsense.benchmarks.peers.stage import build_stage, measure, to_base
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
    force_base: np.ndarray
    """Shape (N, T, K, 3) [N]."""


class ExplorationFilter:
    """The filter with at most `contacts` sets."""

    def __init__(self, scene: Scene, contacts: int = 1, rounds: int = ROUNDS, seed: int = 0) -> None:
        """For a scene's arm; a sensor that the scene does not have is omitted."""
        self.name = "exploring particle filter"
        self._stage = build_stage(scene, LEAST_TORQUE, LEAST_MOMENT)
        self._friction = scene.friction
        self._contacts, self._rounds, self._seed = contacts, rounds, seed
        table = scattered(self._stage.surfaces, _DENSITY, seed)
        first = np.searchsorted(table.link, np.unique(table.link))
        self._table = table.point, table.normal, table.link, np.append(first, len(table.link))

    def __call__(
        self, q: np.ndarray, base_wrench: np.ndarray | None, joint_torque: np.ndarray | None
    ) -> Answers:
        found = self.follow(
            q,
            None if base_wrench is None else base_wrench[:, None],
            None if joint_torque is None else joint_torque[:, None],
        )
        return Answers(found.link[:, 0, 0], found.point_base[:, 0, 0], found.force_base[:, 0, 0])

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
        found = Found(
            np.full((runs, steps, sets), -1),
            np.zeros((runs, steps, sets, 3)),
            np.zeros((runs, steps, sets, 3)),
        )
        _run(
            self._stage, self._friction, *self._table,
            *(np.ascontiguousarray(array, dtype=np.float64) for array in (q, base, torque)),
            np.random.default_rng(self._seed),
            PARTICLES, EXPLORERS, self._rounds, SHORT, LONG, EXCESS, *found,
        )  # fmt: skip
        return found


class Problem(NamedTuple):
    """Scratch of the QPs of one run, for one contact per set."""

    b: np.ndarray
    A: np.ndarray
    G: np.ndarray
    h: np.ndarray
    x: np.ndarray
    L: np.ndarray
    s: np.ndarray
    order: np.ndarray
    directions: np.ndarray
    """Edge forces of each contact in the order of the columns, shape (sets, 4, 3)."""
    rows: np.ndarray


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


@allocating_kernel
def _run(  # type: ignore[no-untyped-def]
    stage, friction, points, normals, links, first, q, base_wrench, joint_torque,
    rng, particles, explorers, rounds, short, long, excess, found_link, found_point, found_force,
):  # fmt: skip
    most = found_link.shape[2]
    width, m, pool = EDGES * most, q.shape[1] + 6, particles + explorers
    problem = Problem(
        np.empty(m), np.empty((width, m)), np.empty((width, width)), np.empty(width), np.empty(width),
        np.empty((width, width)), np.empty(width), np.empty(width, dtype=np.int64),
        np.empty((most, EDGES, 3)), np.empty((m, 3)),
    )  # fmt: skip
    sets = Sets(
        np.empty((most, particles), dtype=np.int64), np.empty((most, particles, 3)),
        np.empty((most, particles, 3)), np.empty(most, dtype=np.int64), np.empty((most, 3)),
        np.empty((most, 3)),
    )  # fmt: skip
    on, at, out = np.empty(pool, dtype=np.int64), np.empty((pool, 3)), np.empty((pool, 3))
    cost, chosen = np.empty(pool), np.empty(pool, dtype=np.int64)
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
                    left = _forces(stage, friction, problem, square, sets, count)
                    if count == 0 or left > excess:
                        _throw(rng, sets, count, points, normals, links, first)
                        count += 1
                _turn(
                    rng, stage, friction, points, normals, links, first, problem, square, sets, count,
                    short, long, FLAT ** (1.0 - turn / rounds), on, at, out, cost, chosen,
                )  # fmt: skip
            _forces(stage, friction, problem, square, sets, count)
            for c in range(count):
                found_link[i, t, c] = sets.best_on[c]
                x, y, z = sets.best_at[c]
                found_point[i, t, c] = to_base(stage.motion, sets.best_on[c], x, y, z)
                force_of(problem.directions[c], problem.x, EDGES * c, found_force[i, t, c])


@allocating_kernel
def _anywhere(rng, first):  # type: ignore[no-untyped-def]
    """Index of a random place: a touchable link, all equally probable, then a place on it."""
    link = rng.integers(0, first.shape[0] - 1)
    return rng.integers(first[link], first[link + 1])


@allocating_kernel
def _throw(rng, sets, c, points, normals, links, first):  # type: ignore[no-untyped-def]
    """Start set `c` at random places."""
    for k in range(sets.on.shape[1]):
        start = _anywhere(rng, first)
        sets.on[c, k], sets.at[c, k], sets.out[c, k] = links[start], points[start], normals[start]
    sets.best_on[c], sets.best_at[c], sets.best_out[c] = sets.on[c, 0], sets.at[c, 0], sets.out[c, 0]


@kernel
def _taken(sets, c, count, link):  # type: ignore[no-untyped-def]
    """Whether a set other than `c` is on a link."""
    taken = False
    for other in range(count):
        taken = taken or (other != c and sets.best_on[other] == link)
    return taken


@allocating_kernel
def _turn(  # type: ignore[no-untyped-def]
    rng, stage, friction, points, normals, links, first, problem, square, sets, count,
    short, long, sharpness, on, at, out, cost, chosen,
):  # fmt: skip
    """One round of the newest set."""
    c = count - 1
    noise, motion = stage.noise, stage.motion
    particles, pool = sets.on.shape[1], on.shape[0]
    number = 0
    for other in range(count):
        if other != c:
            add_contact(
                noise, motion, friction, sets.best_on[other], sets.best_at[other], sets.best_out[other],
                problem.b, number, problem.A, problem.G, problem.h, problem.directions[number], problem.rows,
            )  # fmt: skip
            number += 1
    span = np.log(long / short)
    for k in range(pool):
        if k == 0:
            # The best particle so far is kept, so that the result never becomes worse.
            on[k], at[k], out[k] = sets.best_on[c], sets.best_at[c], sets.best_out[c]
        elif k < particles:
            step = short * np.exp(span * rng.random())
            on[k] = walk(rng, stage, step, sets.on[c, k], sets.at[c, k], sets.out[c, k], at[k], out[k])
        else:
            start = _anywhere(rng, first)
            on[k], at[k], out[k] = links[start], points[start], normals[start]
        if k > 0 and _taken(sets, c, count, on[k]):
            cost[k] = np.inf
            continue
        add_contact(
            noise, motion, friction, on[k], at[k], out[k], problem.b, number,
            problem.A, problem.G, problem.h, problem.directions[number], problem.rows,
        )  # fmt: skip
        cost[k] = solve(
            problem.G, problem.h, square, EDGES * count, problem.x, problem.L, problem.s, problem.order
        )
    best = np.argmin(cost)
    sets.best_on[c], sets.best_at[c], sets.best_out[c] = on[best], at[best], out[best]
    for k in range(pool):
        cost[k] *= sharpness
    resample(rng, cost, chosen)
    for k in range(particles):
        # Every second particle drawn from the pool, since the draw is sorted.
        pick = chosen[k * pool // particles]
        sets.on[c, k], sets.at[c, k], sets.out[c, k] = on[pick], at[pick], out[pick]


@kernel
def _forces(stage, friction, problem, square, sets, count):  # type: ignore[no-untyped-def]
    """Solve for the forces of all sets at their best places; returns the squared residual."""
    for c in range(count):
        add_contact(
            stage.noise, stage.motion, friction, sets.best_on[c], sets.best_at[c], sets.best_out[c],
            problem.b, c, problem.A, problem.G, problem.h, problem.directions[c], problem.rows,
        )  # fmt: skip
    return solve(problem.G, problem.h, square, EDGES * count, problem.x, problem.L, problem.s, problem.order)
