"""Fit a few convex primitives to the skin of a link.

Grow, then shift: starting without bodies, add the best body out of many guesses, refit all, then remove each
one in turn and insert it where it improves the fit most, until the tolerance is met in both directions. Every
guess is evaluated after a short least-squares fit of the whole union, which takes milliseconds.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np
import trimesh

from contactsense.robots.decomposition.distance_samples import Shape, make_target
from contactsense.robots.decomposition.initial_guess import FEWEST, additions, splits
from contactsense.robots.decomposition.least_squares_fit import Bodies, Target, cost, fit
from contactsense.robots.decomposition.local_deviation import local_deviation
from contactsense.robots.decomposition.neighbour_poses import neighbour_poses
from contactsense.robots.decomposition.outer_skin import OutOfReachError, Skin, Surroundings, outer_skin
from contactsense.robots.decomposition.surface_error import Errors, errors, packed
from contactsense.robots.robot import LocalDeviation, Robot
from contactsense.robots.surface.union import distances

LEAST = 0.001
"""Minimum radius of a rounded edge, and of a ball [m]."""


@dataclass(frozen=True, slots=True)
class Options:
    """Settings of a decomposition."""

    tolerance: float = 0.002
    """Required 95th percentile of the distance in both directions, skin to primitives and primitives to skin
    [m]."""
    most: int = 8
    """Maximum number of primitives on a link."""
    seed: int = 0
    """Seed of all random numbers: samples, rays, initial guesses."""
    boxes: bool = True
    """Whether rounded boxes may be used in addition to bodies of revolution."""
    guesses: int = 40
    """Number of guesses for each further primitive."""
    samples: int = 30000
    """Number of samples on each mesh."""


@dataclass(frozen=True, slots=True)
class Fit:
    """Primitives of one link, and how well they fit its skin."""

    bodies: Bodies
    errors: Errors
    deviation: tuple[LocalDeviation, ...]
    """How far the skin is from them, place by place."""
    moved_deviation: tuple[LocalDeviation, ...]
    """The same where their surface is moved to the skin's mean in each cell."""
    cost: float
    """Cost minimised by the fit, dimensionless: increases with the area of skin whose error exceeds the
    tolerance."""

    @property
    def p95(self) -> float:
        """The larger of the two 95th percentiles, skin to primitives and primitives to skin [m]."""
        there = float(np.percentile(np.abs(self.errors.skin), 95.0))
        back = float(np.percentile(self.errors.primitive, 95.0)) if len(self.errors.primitive) else 0.0
        return max(there, back)


def fit_link(
    robot: Robot, meshes: Mapping[str, trimesh.Trimesh], link: int, options: Options | None = None
) -> tuple[Fit, ...]:
    """Unions of 1, 2, ... primitives that fit the skin of a link increasingly well.

    Args:
        robot: Provides the poses of the neighbours, and the axes to try.
        meshes: Visual surface of each link by name, in its frame [m].
        link: Number of the link.
        options: Tolerance and limits.

    Returns:
        One fit for each number of primitives, up to the first within tolerance or to the limit.

    Raises:
        OutOfReachError: no part of the mesh, or too small a part, can be reached by a finger.
        ValueError: the mesh has no area.
    """
    options = options or Options()
    mesh = meshes[robot.link_names[link]]
    poses = neighbour_poses(robot, meshes, link, seed=options.seed)
    skin = outer_skin(mesh, poses, options.samples, options.seed)
    return fit_body(skin, Surroundings(mesh, poses), joint_axes(robot, link), options)


def fit_body(skin: Skin, around: Surroundings, axes: np.ndarray, options: Options) -> tuple[Fit, ...]:
    """Unions of 1, 2, ... primitives that fit the skin of one body increasingly well.

    Args:
        skin: Its skin.
        around: Its mesh and its neighbours.
        axes: Candidate directions for axes of primitives, shape (M, 3).
        options: Tolerance and limits.

    Returns:
        As `fit_link`.

    Raises:
        OutOfReachError: no part of the skin can be reached by a finger, or it has too few samples.
    """
    if not skin.exposure.any():
        raise OutOfReachError("no part of the mesh can be reached by a finger: its neighbours cover it")
    if len(skin.points) < FEWEST:
        raise _too_few(skin, options)
    search = _Search(skin, around, axes, options)
    found: list[Fit] = []
    while len(found) < options.most:
        found.append(search.next(found[-1].bodies if found else None))
        if found[-1].p95 <= options.tolerance or _stalled([fit.cost for fit in found]):
            break
    return tuple(found)


def _too_few(skin: Skin, options: Options) -> OutOfReachError:
    return OutOfReachError(
        f"too small a part of the mesh can be reached by a finger: {len(skin.points)} of {options.samples} "
        "samples"
    )


def measured_fit(bodies: Bodies, skin: Skin, around: Surroundings, options: Options) -> Fit:
    """Given primitives, compared with the skin of a body. Arguments as for `fit_body`."""
    return _Search(skin, around, np.eye(3), options).given(bodies)


def _stalled(costs: Sequence[float]) -> bool:
    """Whether the last two primitives together reduced the cost by less than a fifth."""
    return len(costs) > 3 and costs[-1] > 0.8 * costs[-3]


def joint_axes(robot: Robot, link: int) -> np.ndarray:
    """Candidate directions for axes of bodies: the link's own, and the axis of the next joint, shape (M,
    3)."""
    axes = [np.eye(3)]
    if link < len(robot.joints):
        joint = robot.joints[link]
        axes.append((joint.rotation @ joint.axis)[None])
    return np.concatenate(axes)


def choose(fits: Sequence[Sequence[Fit]], tolerance: float, total: int | None = None) -> list[int]:
    """Choose the number of primitives of each link: as many as the tolerance needs, fewer if the sum would
    exceed `total`.

    Args:
        fits: For each link its fits, by number of primitives.
        tolerance: Required 95th percentile [m].
        total: Maximum sum, if any.

    Returns:
        Index into each link's fits.
    """
    # The smallest number that meets the tolerance; otherwise the smallest one close to the best.
    chosen = []
    for link in fits:
        within = [i for i, found in enumerate(link) if found.p95 <= tolerance]
        enough = 1.25 * min(found.cost for found in link)
        near = [i for i, found in enumerate(link) if found.cost <= enough]
        chosen.append((within or near)[0])

    def rise(link: int) -> float:
        i = chosen[link]
        if i == 0:
            return np.inf
        return fits[link][i].errors.area * (fits[link][i - 1].cost - fits[link][i].cost)

    while total is not None and sum(i + 1 for i in chosen) > total:
        least = min(range(len(fits)), key=rise)
        if chosen[least] == 0:
            break
        chosen[least] -= 1
    return chosen


class _Search:
    """The search for primitives on one link; deterministic for a seed."""

    def __init__(self, skin: Skin, around: Surroundings, axes: np.ndarray, options: Options) -> None:
        self._skin, self._around, self._axes, self._options = skin, around, axes, options
        self._rng = np.random.default_rng(options.seed)
        self._shape = Shape(skin)
        self._target = make_target(skin, around, min(1500, options.samples // 4), self._rng)
        self._coarse = self._target.every(5)
        self._fine = make_target(skin, around, 6000, self._rng)
        self._scale, self._reach = options.tolerance / 2.0, 20.0 * options.tolerance

    def next(self, bodies: Bodies | None) -> Fit:
        """Add one body, refit all and measure the error."""
        grown = self._grown(bodies)
        if bodies is not None:
            grown = self._shifted(grown)
        return self._measured(grown, self._refit(grown, self._fine, 60))

    def given(self, bodies: Bodies) -> Fit:
        """Measure the error of given bodies."""
        return self._measured(bodies, float(cost(bodies, self._fine, self._scale, self._reach)))

    def _measured(self, bodies: Bodies, reached: float) -> Fit:
        seed = self._options.seed
        found = errors(bodies, self._skin, self._shape, self._around, seed)
        deviation, moved = (local_deviation(bodies, self._skin, seed, to_mean) for to_mean in (False, True))
        return Fit(bodies, found, deviation, moved, reached)

    def _refit(self, bodies: Bodies, target: Target, steps: int) -> float:
        return float(fit(bodies, target, self._scale, self._reach, LEAST, steps))

    def _grown(self, bodies: Bodies | None) -> Bodies:
        """Add one body: the best of many guesses, which are first fitted quickly, then the best few
        thoroughly."""
        skin, options = self._skin, self._options
        guesses = additions(
            skin.points, skin.normals, self._misfit(bodies), self._axes, LEAST, options.boxes, self._rng
        )
        trials = [
            guess if bodies is None else bodies.joined(guess) for guess in islice(guesses, options.guesses)
        ]
        if bodies is not None:
            trials += islice(splits(bodies, self._rng), 3 * len(bodies.kind))
        if not trials:
            raise _too_few(skin, options)
        quick = [self._refit(trial, self._coarse, 12) for trial in trials]
        best = [trials[i] for i in np.argsort(quick, kind="stable")[:3]]
        thorough = [self._refit(trial, self._target, 30) for trial in best]
        winner: Bodies = best[int(np.argmin(thorough))]
        return winner

    def _shifted(self, bodies: Bodies) -> Bodies:
        """The same number of bodies, after each was removed in turn and inserted where it improves the fit
        most."""
        least = self._cost(bodies)
        for k in range(len(bodies.kind)):
            rest = bodies.only(np.arange(len(bodies.kind)) != k)
            self._refit(rest, self._target, 15)
            trial = self._grown(rest)
            reached = self._cost(trial)
            if reached < least * 0.999:
                bodies, least = trial, reached
        return bodies

    def _cost(self, bodies: Bodies) -> float:
        return float(cost(bodies, self._target, self._scale, self._reach))

    def _misfit(self, bodies: Bodies | None) -> np.ndarray:
        weight = np.maximum(self._skin.exposure, 0.02)
        if bodies is None:
            return np.asarray(weight)
        distance = np.abs(distances(packed(bodies), self._skin.points)[0])
        return np.asarray(weight * np.minimum(distance, self._reach) ** 2 + 1e-12)
