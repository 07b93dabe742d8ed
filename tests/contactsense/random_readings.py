"""Random scenes with random readings, among them what no arm measures; and what holds of every estimate.

`python -m tests.contactsense.random_readings --seed 1 --scenes 20` tries that many.
"""

import math
from collections.abc import Iterator

import click
import numpy as np

from contactsense import Estimate, JointTorqueSensor, Localizer, Sample, Scene, WrenchSensor
from contactsense.benchmarks.multi_contact.trials import Trial, Trials
from contactsense.robots.tool import Tool

ARMS = "ur3", "ur3e", "ur5", "ur5e", "ur7e", "ur10", "ur10e", "ur12e", "ur16e", "ur20", "ur30"
SAMPLES = 800
"""Of each stream."""
REQUESTS = 20
"""For each scene."""
_WRONG_VALUES = np.nan, np.inf, -np.inf, 1e300, -1e160, 1e20, 1e4
_ODD_STEPS = 0.0, -0.5, 1e-10, 0.05, 0.3, 5.0, 1e6, -1e6
_SENSORS = ("base", "torque"), ("base",), ("torque",), ("base", "torque", "wrist"), ("torque", "wrist")


class RandomReadings:
    """A scene, and readings for it."""

    def __init__(self, seed: int) -> None:
        """The same seed gives the same scene and readings."""
        self._chance = np.random.default_rng(seed)
        self._sensors = _SENSORS[self._chance.integers(len(_SENSORS))]
        self.scene = self._draw_scene()
        self._trials = Trials(self.scene, seed)

    def _draw_scene(self) -> Scene:
        chance, noise = self._chance, 10.0 ** self._chance.uniform(-4.0, 1.0)

        def sensor() -> WrenchSensor:
            return WrenchSensor(
                force_noise=noise,
                moment_noise=noise * 10.0 ** chance.uniform(-1.5, -0.3),
                rpy=tuple(chance.uniform(-1.0, 1.0, 3)),
                range=None if chance.random() < 0.5 else (2000.0, 1000.0),
            )

        wrist = "wrist" in self._sensors
        return Scene(
            robot=str(chance.choice(ARMS)),
            gravity=1e-6,  # readings of a free arm at rest are zero in every posture
            tool=Tool(mass=chance.uniform(0.1, 3.0), com=(0.0, 0.0, 0.05)) if wrist else None,
            base_wrench=sensor() if "base" in self._sensors else None,
            joint_torque=JointTorqueSensor(noise=noise * 10.0 ** chance.uniform(0.0, 1.0))
            if "torque" in self._sensors
            else None,
            wrist_wrench=sensor() if wrist else None,
            contacts=int(chance.choice([1, 2, 3, 3])),
            detail=str(chance.choice(["fine", "coarse"])),
            friction=float(chance.choice([1e-3, 0.1, 0.5, 3.0])),
            link_prior=str(chance.choice(["area", "equal"])),
        )

    def requests(self, localizer: Localizer) -> Iterator[Estimate]:
        """Answers to measurements of one to three pushes, and to wrenches that no push gives."""
        chance, scene = self._chance, self.scene
        for _ in range(REQUESTS):
            trial = self._draw_trial()
            base, torque = trial.measure(trial.pushes)
            size = chance.choice([0.0, 0.0, 1e-3, 1.0, 30.0])
            base, torque = base + size * chance.standard_normal(6), torque + size * chance.standard_normal(6)
            # Larger values are refused.
            torque, wrist = torque.clip(-20.0, 20.0), (size * chance.standard_normal(6)).clip(-50.0, 50.0)
            yield localizer.locate(
                chance.choice([0.0, math.pi / 2.0, math.pi], 6) if chance.random() < 0.2 else trial.q,
                base_wrench=base if scene.base_wrench is not None else None,
                joint_torque=torque if scene.joint_torque is not None else None,
                wrist_wrench=wrist if scene.wrist_wrench is not None else None,
                detect=bool(chance.random() < 0.5),
                contacts=scene.contacts,
            )

    def stream(self) -> Iterator[Sample]:
        """Pushes that come, change and go, on an arm that rests or moves; some values and times are wrong."""
        chance, scene = self._chance, self.scene
        trial = self._draw_trial()
        t, q, qd, pushes = 0.0, trial.q, np.zeros(6), trial.pushes[:0]
        for _ in range(SAMPLES):
            if chance.random() < 0.01:
                qd = chance.choice([0.0, 0.0, 0.1, 1.0]) * chance.standard_normal(6)
            if chance.random() < 0.02:
                # They come one by one; then all change at once, or go.
                count = (
                    len(pushes) + 1 if len(pushes) < len(trial.pushes) else chance.choice([0, len(pushes)])
                )
                pushes = tuple(self._trials.changed(push, None) for push in trial.pushes[:count])
            t += float(chance.choice(_ODD_STEPS)) if chance.random() < 0.003 else 0.002
            q = q + 0.002 * qd
            base, torque = trial.measure(pushes) if pushes else (np.zeros(6), np.zeros(6))
            yield Sample(
                t,
                self._with_faults(q),
                self._with_faults(qd),
                self._with_faults(torque) if self._is_there(scene.joint_torque) else None,
                self._with_faults(base) if self._is_there(scene.base_wrench) else None,
                self._with_faults(np.zeros(6)) if self._is_there(scene.wrist_wrench) else None,
            )

    def _draw_trial(self) -> Trial:
        size = 10.0 ** self._chance.uniform(0.0, 2.0)
        return self._trials.draw(int(self._chance.choice([1, 2, 3, 3])), size, "different")

    def _is_there(self, sensor: object) -> bool:
        return sensor is not None and bool(self._chance.random() < 0.97)

    def _with_faults(self, values: np.ndarray) -> np.ndarray:
        if self._chance.random() < 0.005:
            values = values.copy()
            values[self._chance.integers(len(values))] = self._chance.choice(_WRONG_VALUES)
        return values


def check(estimate: Estimate, contacts: int) -> None:
    """What holds of every estimate of a scene with that many contacts."""
    probability = estimate.link_probability
    assert np.all((probability >= 0.0) & (probability <= 1.0 + 1e-9)), probability
    if contacts == 1:
        assert probability.sum() <= 1.0 + 1e-6, probability
    for contact in estimate.contacts:
        assert 0.0 <= contact.probability <= 1.0 + 1e-9, contact
        assert np.isfinite(
            [*contact.point, *contact.point_base, *contact.force_base, contact.torsion]
        ).all(), contact
        assert abs(float(np.linalg.norm(contact.normal_base)) - 1.0) < 1e-6, contact
        variances = np.linalg.eigvalsh(contact.covariance)
        assert np.isfinite(variances).all(), contact
        assert variances[0] >= -1e-9 * variances[-1], contact


def try_out(seed: int) -> int:
    """Try one scene; returns the largest number of contacts at a time."""
    readings = RandomReadings(seed)
    localizer, contacts, most = Localizer(readings.scene), readings.scene.contacts, 0
    for estimate in readings.requests(localizer):
        check(estimate, contacts)
    for sample in readings.stream():
        estimate = localizer.step(sample)
        check(estimate, contacts)
        most = max(most, len(estimate.contacts))
    return most


@click.command()
@click.option("--seed", type=int, default=0, help="Of the first scene; the others follow.")
@click.option("--scenes", type=int, default=100)
def main(seed: int, scenes: int) -> None:
    """Try random scenes."""
    most = [try_out(number) for number in range(seed, seed + scenes)]
    click.echo(f"{scenes} scenes, {most.count(3)} of them with three contacts at a time")


if __name__ == "__main__":
    main()
