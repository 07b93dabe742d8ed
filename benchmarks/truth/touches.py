"""One contact of a moving arm: where it is, how it moves over the surface, how hard it pushes."""

from typing import NamedTuple

import numpy as np

from . import arrays
from .exposure import Exposure
from .pushes import FRICTION, normal_force, tangential, torsion_ratio
from .schedule import IMPACT, SLIDE, Planned
from .slide import Walk, Walker
from .surface import Place, Surface, tangents
from .trajectory import CHECKED

_SPEEDS = (0.01, 0.05)
"""Of a slide [m/s]."""
_SLIDING = (0.2, FRICTION)
"""Ratio of friction to normal force in a slide."""
_SHORTEST = 0.005
"""Minimum way of a slide that has time for it [m]."""
_RAMPS = (0.02, 0.2)
"""Duration of the rise and of the fall of the force [s]; an impact has the shortest ones."""
_LONGEST_RAMP = 0.45
"""In parts of the contact's duration."""
_MODULATION = 0.2
"""Amplitude of a hand's unsteadiness in parts of the force; none in impacts."""
_TREMOR = (0.5, 2.0)
"""Range of its frequency [Hz]."""
_TRIES = 200
"""Places that are tried on a link before another one is drawn."""


class Touch(NamedTuple):
    """One contact over its M samples; vectors in the frame of the link, shape (M, 3)."""

    planned: Planned
    link: int
    points: np.ndarray
    """[m]"""
    normals: np.ndarray
    """Outward unit normals."""
    forces: np.ndarray
    """On the robot [N]."""
    torsions: np.ndarray
    """About the normal, on the robot, shape (M,) [Nm]."""
    peak: float
    """Normal force before modulation [N]."""
    ramps: tuple[float, float]
    """Durations of rise and fall [s]."""
    speed: float
    """Of a slide, otherwise zero [m/s]."""
    path: float
    """Way of a slide [m]."""
    friction: float
    """Tangential force in parts of the normal force."""
    torsion_ratio: float
    """Torsion in parts of the normal force [m]."""
    by_link: bool
    """Whether the link was drawn first, each alike, rather than the place uniform by area."""


class Toucher:
    """Draws contacts that can be reached as long as they last."""

    def __init__(self, surface: Surface, exposure: Exposure) -> None:
        self._surface, self._exposure, self._walker = surface, exposure, Walker(surface)

    def draw(
        self, planned: Planned, q: np.ndarray, twisted: bool, without: int | None, rng: np.random.Generator
    ) -> Touch:
        """A random contact.

        Args:
            planned: When, and of which type.
            q: Postures of the arm during the contact, shape (M, n) [rad].
            twisted: Whether it has torsion.
            without: A link that it must not be on.
            rng: Random numbers.
        """
        by_link = bool(rng.random() < 0.5)
        speed = float(rng.uniform(*_SPEEDS)) if planned.type == SLIDE else 0.0
        place, walk = self._reachable(q, speed, by_link, without, rng)
        if planned.type == SLIDE:
            friction = float(rng.uniform(*_SLIDING))
            across = friction * walk.directions
        else:
            across = np.tile(tangential(rng, place.normal), (len(q), 1))
            friction = float(np.linalg.norm(across[0]))
        peak, ratio = normal_force(rng), torsion_ratio(rng) if twisted else 0.0
        push, ramps = _profile(planned, peak, rng)
        return Touch(
            planned=planned,
            link=place.link,
            points=arrays.on_grid(walk.points, arrays.LENGTH),
            normals=walk.normals,
            forces=push[:, None] * (across - walk.normals),
            torsions=ratio * push,
            peak=peak,
            ramps=ramps,
            speed=speed,
            path=walk.length,
            friction=friction,
            torsion_ratio=ratio,
            by_link=by_link,
        )

    def _reachable(
        self, q: np.ndarray, speed: float, by_link: bool, without: int | None, rng: np.random.Generator
    ) -> tuple[Place, Walk]:
        """A place that stays exposed, and the walk over the surface from there."""
        lengths = speed / arrays.RATE * np.arange(len(q))
        touchable = [link for link, faces in enumerate(self._surface.faces) if len(faces)]
        while True:
            link = touchable[int(rng.integers(0, len(touchable)))] if by_link else None
            for _ in range(_TRIES):
                place = self._surface.draw(rng, link)
                if place.link == without or not self._exposed(q[0], place.link, place.point, place.normal):
                    continue
                walk = self._walker.walk(place, _tangent(place.normal, rng), lengths)
                # A short and slow slide cannot come that far.
                if walk.length >= min(_SHORTEST, lengths[-1]) and all(
                    self._exposed(q[i], place.link, walk.points[i], walk.normals[i])
                    for i in (*range(CHECKED, len(q), CHECKED), len(q) - 1)
                ):
                    return place, walk

    def _exposed(self, q: np.ndarray, link: int, point: np.ndarray, normal: np.ndarray) -> bool:
        self._exposure.place(q)
        return self._exposure.exposed(link, point, normal)


def _tangent(normal: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A random unit vector at right angles to the normal."""
    x, y = tangents(normal)
    angle = rng.uniform(0.0, 2.0 * np.pi)
    return np.asarray(np.cos(angle) * x + np.sin(angle) * y)


def _profile(
    planned: Planned, peak: float, rng: np.random.Generator
) -> tuple[np.ndarray, tuple[float, float]]:
    """Normal force over the contact, shape (M,) [N], and the durations of its raised-cosine ramps [s]."""
    samples = planned.stop - planned.start
    t, duration = np.arange(samples) / arrays.RATE, samples / arrays.RATE
    if planned.type == IMPACT:
        on = off = _RAMPS[0]
        modulation = np.ones(samples)
    else:
        on, off = np.minimum(rng.uniform(*_RAMPS, 2), _LONGEST_RAMP * duration).tolist()
        frequency, phase = rng.uniform(*_TREMOR), rng.uniform(0.0, 2.0 * np.pi)
        modulation = 1.0 + _MODULATION * np.sin(2.0 * np.pi * frequency * t + phase)
    # Half a sample later: no sample is without force, and rise and fall are alike.
    inner = t + 0.5 / arrays.RATE
    share = np.clip(np.minimum(inner / on, (duration - inner) / off), 0.0, 1.0)
    return peak * modulation * 0.5 * (1.0 - np.cos(np.pi * share)), (on, off)
