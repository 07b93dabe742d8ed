"""Calibration from contact-free motion: everything that the motion tells of arm and sensors.

Gauss-Newton on the observer's own residuals. Each round linearizes all equations, asks which parameters the
motion excites, and solves for those; widths of the smooth signs, which enter in a way of their own, are
chosen from a grid. What friction may not be (negative) and what the data do not ask for is left out.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from contactsense.arm import about_base
from contactsense.calibration.fit import Fit, fit
from contactsense.calibration.identifiable import excited
from contactsense.calibration.linearize import linearize, settled
from contactsense.calibration.meaning import compare_meanings, doubts
from contactsense.calibration.parameters import (
    GROUPS,
    NOT_NEGATIVE,
    ON_DEMAND,
    Entry,
    Group,
    entries,
    moved,
    value,
)
from contactsense.calibration.plant import Plant
from contactsense.calibration.residuals import friction, residuals
from contactsense.calibration.result import Calibration, Value, level, scene_of
from contactsense.calibration.spread import Spread, spread_of
from contactsense.calibration.stretch import Stretch
from contactsense.observer import noise_gain
from contactsense.scene import Scene

_ROUNDS, _MOST_ROUNDS = 3, 12
_STILL = 0.1
"""Rounds go on until no parameter moves by more than this share of its standard deviation. Torque constants
multiply what is measured, so that they may need several."""
_ROWS = 10.0
"""Rows kept per second and hertz of bandwidth: more of them say the same."""
_DEMAND = 2.5
"""Load-dependent and lubricant friction are used where they are so many standard deviations from none."""
_VELOCITIES = (0.002, 0.005, 0.01, 0.02, 0.05)
_LUBRICANT_VELOCITIES = (0.1, 0.2, 0.4)
_CURRENTS = ("actual_current", "actual_current_minus_target")


_NOT_EXCITED = "not excited by this motion: kept"


class CalibrationError(ValueError):
    """The recordings cannot serve; the message says why and what would."""


@dataclass(frozen=True)
class Settings:
    """What is estimated, and how."""

    groups: tuple[Group, ...]
    """Parameters to look at."""
    inertia_error: float = 0.1
    """How far the links' masses may be off the robot's data, relative, standard deviation."""
    widths: bool = True
    """Whether the widths of friction's smooth signs are looked for, too."""


def default_groups(scene: Scene, stretches: list[Stretch]) -> tuple[Group, ...]:
    """What can be estimated with these sensors, but the links' inertia, which has to be asked for."""
    groups: list[Group] = ["payload"]
    torque = scene.joint_torque
    if torque is not None and any(stretch.torque is not None for stretch in stretches):
        groups += ["bias"]
        if torque.contains != "external":
            groups += ["coulomb", "viscous", "rotor", "load", "lubricant"]
            groups += ["gain"] if torque.signal in _CURRENTS else []
    if scene.base_wrench is not None and any(stretch.reading is not None for stretch in stretches):
        groups += ["wrench_bias", "tilt", "turn", "shift", "delay"]
    return tuple(group for group in GROUPS if group in groups)


def calibrate(
    scene: Scene,
    stretches: list[Stretch],
    settings: Settings | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> Calibration:
    """Estimate what contact-free motion tells, and a scene with it.

    Args:
        scene: What is known so far.
        stretches: Contact-free motion; the sensors of the scene are used where a stretch has them.
        settings: What is estimated; without it, `default_groups`.
        progress: Called with what is done next.

    Raises:
        CalibrationError: nothing can be estimated from these stretches.
    """
    _check(scene, stretches)
    settings = settings or Settings(default_groups(scene, stretches))
    start = plant = Plant.of(scene)
    chosen = entries(plant, settings.groups, settings.inertia_error)
    work = _Work(stretches, scene.bandwidth, chosen, start)
    free = np.ones(len(chosen), dtype=bool)
    kept: dict[int, str] = {}
    step, condition = None, 1.0
    for number in range(_MOST_ROUNDS):
        progress(f"round {number + 1}")
        if number == 1 and settings.widths and "coulomb" in settings.groups:
            progress("widths of the smooth signs")
            plant = _best_widths(plant, stretches, scene.bandwidth)
        plant, step, condition = work.solve(plant, free, kept, on_demand=number > 0)
        std = np.sqrt(np.diag(step.covariance))
        if number >= _ROUNDS - 1 and np.all(np.abs(step.step[free]) <= _STILL * std[free]):
            break
    assert step is not None
    progress("noise and model error")
    before = [residuals(start, s, scene.bandwidth)[settled(s, scene.bandwidth) :] for s in stretches]
    after = [residuals(plant, s, scene.bandwidth)[settled(s, scene.bandwidth) :] for s in stretches]
    present = _present(scene, stretches)
    spread, wrench = _noise(plant, stretches, after, scene.bandwidth)
    values = tuple(
        Value(
            entry,
            value(start, entry),
            value(plant, entry),
            float(np.sqrt(step.covariance[i, i])),
            kept.get(i, ""),
        )
        for i, entry in enumerate(chosen)
    )
    warnings = [f"{chosen[i].name}: {why}" for i, why in kept.items() if chosen[i].group != "links"]
    if scene.joint_torque is not None and spread is not None:
        progress("what the torque signal means")
        every = work.every
        warnings = doubts(scene, compare_meanings(scene, stretches, scene.bandwidth, every)) + warnings
        warnings += [
            f"{joint.name} never stood still or turned round: its uncertainty there is guessed from friction"
            for joint, rest in zip(scene.robot.joints, spread.rest_error, strict=True)
            if np.isnan(rest)
        ]
    changed = {entry.group for i, entry in enumerate(chosen) if free[i]}
    return Calibration(
        scene=scene_of(plant, {str(group) for group in changed}, spread, wrench),
        values=tuple(v for v in values if v.entry.group != "links"),
        inertia=tuple(v for v in values if v.entry.group == "links"),
        warnings=tuple(warnings),
        before=level(before, present),
        after=level(after, present),
        condition=condition,
        covariance=step.covariance,
    )


class _Work:
    """One calibration's rounds."""

    def __init__(
        self, stretches: list[Stretch], bandwidth: float, chosen: tuple[Entry, ...], start: Plant
    ) -> None:
        self._stretches = stretches
        self._bandwidth = bandwidth
        self._chosen = chosen
        self._start = np.array([value(start, entry) for entry in chosen])
        self._prior = np.array([entry.plausible for entry in chosen])
        self._channels = len(start.gain) + 6
        self.every = rows_apart(stretches, bandwidth)

    def solve(
        self, plant: Plant, free: np.ndarray, kept: dict[int, str], on_demand: bool
    ) -> tuple[Plant, Fit, float]:
        """One round: the plant moved to where the linearized equations have their minimum.

        Changes `free` and `kept`: parameters that cannot be estimated go back to the scene's value.
        """
        rows = [
            row
            for stretch in self._stretches
            for row in linearize(plant, stretch, self._chosen, self._bandwidth, self.every)
        ]
        while True:
            offset = np.array([value(plant, entry) for entry in self._chosen]) - self._start
            unknown = np.array([kept.get(i) == _NOT_EXCITED for i in range(len(free))])
            found = fit(rows, self._prior, offset, free, self._channels, unknown)
            seen, condition = excited(found.information, self._chosen, free)
            dropped = {int(i): _NOT_EXCITED for i in np.flatnonzero(free & ~seen)}
            if not dropped:
                dropped = self._unwanted(plant, found, free, on_demand)
            if not dropped:
                return moved(plant, self._chosen, found.step), found, condition
            kept.update(dropped)
            back = np.zeros(len(free))
            for i in dropped:
                free[i] = False
                back[i] = -offset[i]
            if back.any():
                plant = moved(plant, self._chosen, back)
                for row in rows:
                    row.residual[:] = row.residual + row.slope @ back[row.columns]

    def _unwanted(self, plant: Plant, found: Fit, free: np.ndarray, on_demand: bool) -> dict[int, str]:
        """Parameters that came out as they cannot be, or without need: one group at a time."""
        unwanted: dict[int, str] = {}
        for i in np.flatnonzero(free):
            entry = self._chosen[i]
            there = value(plant, entry) + found.step[i]
            std = float(np.sqrt(found.covariance[i, i]))
            if entry.group in NOT_NEGATIVE and there < 0.0:
                unwanted[int(i)] = f"came out negative ({there:.3g} +- {std:.2g} {entry.unit}): kept"
            elif on_demand and entry.group in ON_DEMAND and abs(there) < _DEMAND * std:
                unwanted[int(i)] = "not asked for by the data: kept"
        return unwanted


def rows_apart(stretches: list[Stretch], bandwidth: float) -> int:
    """Every how many samples a row is kept."""
    rate = max(1.0 / float(np.median(np.diff(stretch.t))) for stretch in stretches)
    return max(1, round(rate / (_ROWS * bandwidth)))


def _check(scene: Scene, stretches: list[Stretch]) -> None:
    if not stretches:
        raise CalibrationError("expected at least one recording of contact-free motion, got none")
    joints = len(scene.robot.joints)
    for stretch in stretches:
        if stretch.q.shape[1] != joints:
            raise CalibrationError(
                f"{stretch.name}: expected {joints} joints, as {scene.robot.name} has, "
                f"got {stretch.q.shape[1]}"
            )
        if stretch.seconds < 2.0:
            raise CalibrationError(f"{stretch.name}: expected at least 2 s, got {stretch.seconds:.2g} s")
        if stretch.torque is None and stretch.reading is None:
            raise CalibrationError(
                f"{stretch.name}: expected joint torques or base wrenches as the scene has them, got neither"
            )


def _present(scene: Scene, stretches: list[Stretch]) -> np.ndarray:
    torque = any(stretch.torque is not None for stretch in stretches)
    wrench = any(stretch.reading is not None for stretch in stretches)
    return np.array([torque] * len(scene.robot.joints) + [wrench] * 6)


def _best_widths(plant: Plant, stretches: list[Stretch], bandwidth: float) -> Plant:
    """The plant with those widths of the smooth signs under which friction explains most."""
    chosen = entries(plant, ("bias", "coulomb", "viscous", "rotor", "load", "lubricant"), 0.1)
    prior = np.array([entry.plausible for entry in chosen])
    every = rows_apart(stretches, bandwidth)
    bare = [
        Stretch(stretch.t, stretch.q, stretch.qd, stretch.torque, None, stretch.name)
        for stretch in stretches
        if stretch.torque is not None
    ]
    best: tuple[float, Plant] | None = None
    for velocity, lubricant in product(_VELOCITIES, _LUBRICANT_VELOCITIES):
        tried = plant.with_values(velocity=velocity, lubricant_velocity=lubricant)
        rows = [row for stretch in bare for row in linearize(tried, stretch, chosen, bandwidth, every)]
        free = np.ones(len(chosen), dtype=bool)
        cost = fit(rows, prior, np.zeros(len(chosen)), free, len(plant.gain)).cost
        if best is None or cost < best[0]:
            best = (cost, tried)
    assert best is not None
    return best[1]


def _noise(
    plant: Plant, stretches: list[Stretch], left: list[np.ndarray], bandwidth: float
) -> tuple[Spread | None, tuple[float, float]]:
    """Noise and model error of the joints, and noise of the base sensor that covers its model error."""
    joints = len(plant.gain)
    dt = float(np.median(np.concatenate([np.diff(stretch.t) for stretch in stretches])))
    gain = noise_gain(bandwidth, dt)
    spread, wrench = None, (np.nan, np.nan)
    pairs = list(zip(stretches, left, strict=True))
    own = [(s, r[:, :joints]) for s, r in pairs if s.torque is not None]
    if own:
        rubbing = [friction(plant, s)[-len(r) :] for s, r in own]
        spread = spread_of([r for _, r in own], [s.qd[-len(r) :] for s, r in own], rubbing, dt, gain)
    base = [r[:, joints:] for s, r in pairs if s.reading is not None]
    if base:
        sensor = plant.scene.base_wrench
        assert sensor is not None
        # The residual is about the base origin; the sensor's noise about its own.
        away = about_base(np.eye(3), np.array(sensor.translation) + plant.shift)
        about_sensor = np.vstack(base) @ np.linalg.inv(away).T
        rms = np.sqrt(np.mean(about_sensor**2, axis=0) / gain)
        wrench = (float(np.max(rms[:3])), float(np.max(rms[3:])))
    return spread, wrench
