"""Screening of a stream's samples: implausible values are removed, with the reason."""

from collections.abc import Callable
from dataclasses import replace
from math import dist, hypot, isfinite

import numpy as np

from contactsense.plausibility.plausible_limits import Implausible, PlausibleLimits, in_words
from contactsense.sample_blocks import SampleBlock
from contactsense.scene import Scene
from contactsense.sensors.link_values import by_field, with_values
from contactsense.types import Sample

WEIGHT_TOLERANCE = 0.3
"""At the start of a stream, the force on the base sensor may differ from the weight of arm and tool by this
share of it: payloads that nobody declared and light touches are less, a wrong sign, a tared sensor, another
arm or a mounting that is wrong by more than 20 degrees is more."""
_NOISE = 5.0
"""And by this many standard deviations of its noise."""
_AT_REST = 0.01
"""No joint of an arm at rest is faster [rad/s]."""
_SAMPLES = 10
"""After this number of consecutive samples at rest with the right weight, it is not checked again."""


class StreamScreening:
    """Removes implausible values from the samples of one stream."""

    def __init__(self, scene: Scene, limits: PlausibleLimits) -> None:
        """`limits`: those of `scene`."""
        self._limits, self._weight = limits, limits.weight.force.tolist()
        noise = limits.sensor.force_noise
        self._tolerance = WEIGHT_TOLERANCE * float(np.linalg.norm(self._weight)) + _NOISE * noise
        self._has_base, self._has_torque = scene.base_wrench is not None, scene.joint_torque is not None
        # With payloads that come and go, the weight is unknown.
        self._checks_weight = self._has_base and not scene.picks_up
        self._has_range = scene.base_wrench is not None and scene.base_wrench.range is not None
        self._has_link_range = limits.has_link_range
        self._lowest, self._highest, self._largest_torque = limits.of_all_joints
        self.refused: dict[str, str] = {}
        """Field -> why it was removed from the newest sample."""
        self.first: dict[str, str] = {}
        """Field -> why it was removed from a sample of this stream for the first time."""
        self.by_kernel = False
        """Whether the kernel's own test of a sample is enough, see
        `contactsense.scene_model.reading_limits`; at the start of a stream, while the weight is compared, it
        is not."""
        self.reset()

    def reset(self) -> None:
        """A new stream begins."""
        self.refused, self.first = {}, {}
        self._right, self._contradiction = 0, ""
        self._choose()

    def _choose(self) -> None:
        """Whether `contactsense.runtime.kernels.detect` may look at the next sample first."""
        self.by_kernel = not (self._has_link_range or (self._checks_weight and self._right < _SAMPLES))

    def screened(self, sample: Sample) -> Sample:
        """The sample, the first number of each implausible value replaced by NaN; `refused` says why.

        Raises:
            ValueError, AttributeError, TypeError: a field is no array of the right size.
        """
        if self._is_surely_plausible(sample):
            if self.refused:
                self.refused = {}
            return sample
        self.refused = {}
        found = self._limits.position(sample.q)
        if found is not None:
            self.refused["q"] = self._note("q", found.reason)
            return replace(sample, q=_without(sample.q))
        if self._has_torque and sample.joint_torque is not None:
            found = self._limits.torque(sample.joint_torque)
            if found is not None:
                self.refused["joint_torque"] = self._note("joint_torque", found.reason)
                sample = replace(sample, joint_torque=_without(sample.joint_torque))
        if self._has_base and sample.base_wrench is not None:
            why = self._base(sample.base_wrench, sample.qd)
            if why:
                self.refused["base_wrench"] = self._note("base_wrench", why)
                sample = replace(sample, base_wrench=_without(sample.base_wrench))
        without = {}
        for field, wrench in self._ranged(sample).items():
            found = self._limits.link_saturation(field, sample.q, wrench)
            if found is not None:
                self.refused[field] = self._note(field, found.reason)
                without[field] = _without(wrench)
        return with_values(sample, without)

    def _ranged(self, record: Sample | SampleBlock) -> dict[str, np.ndarray]:
        """Values of the link sensors by field, if the range of any of them is known."""
        return by_field(record.wrist_wrench, record.link_wrenches) if self._has_link_range else {}

    def _is_surely_plausible(self, sample: Sample) -> bool:
        """A quick test that ordinary samples pass, except at the start of a stream."""
        if self._checks_weight and self._right < _SAMPLES:
            return False
        q = sample.q.tolist()
        if not (self._lowest < min(q) and max(q) < self._highest):
            return False
        if self._has_torque and sample.joint_torque is not None:
            torque = sample.joint_torque.tolist()
            if not (-self._largest_torque < min(torque) and max(torque) < self._largest_torque):
                return False
        limits, base = self._limits, sample.base_wrench
        if self._has_range and base is not None and limits.saturation(base) is not None:
            return False
        return not self._has_link_range or all(
            limits.link_saturation(field, sample.q, wrench) is None
            for field, wrench in self._ranged(sample).items()
        )

    def screened_block(self, block: SampleBlock) -> SampleBlock:
        """The same for a part of a recording; `first` says why."""
        self.refused = {}
        limits = self._limits
        q, torque, base = block.q, block.joint_torque, block.base_wrench
        wrong = limits.positions_beyond(q)
        if wrong.any():
            self._note_first("q", wrong, q, limits.position)
            q = _without_rows(q, wrong)
        if torque is not None and self._has_torque and (beyond := limits.torques_beyond(torque)).any():
            self._note_first("joint_torque", beyond, torque, limits.torque)
            torque = _without_rows(torque, beyond)
        if base is not None and self._has_base:
            beyond = limits.saturated(base)
            contradicts = self._weight_contradicts(base, block.qd, wrong | beyond)
            if beyond.any():
                self._note_first("base_wrench", beyond, base, limits.saturation)
            if (beyond | contradicts).any():
                base = _without_rows(base, beyond | contradicts)
        without = {}
        for field, wrench in self._ranged(block).items():
            beyond = limits.link_saturated(field, q, wrench)
            if beyond.any():
                at = int(beyond.argmax())
                found = limits.link_saturation(field, q[at], wrench[at])
                assert found is not None
                self._note(field, found.reason)
                without[field] = _without_rows(wrench, beyond)
        screened = replace(block, q=q, joint_torque=torque, base_wrench=base)
        return with_values(screened, without)

    def _note_first(
        self,
        field: str,
        wrong: np.ndarray,
        values: np.ndarray,
        explain: Callable[[np.ndarray], Implausible | None],
    ) -> None:
        found = explain(values[int(wrong.argmax())])
        assert found is not None
        self._note(field, found.reason)

    def _note(self, field: str, reason: str) -> str:
        """Keep the first reason of each field; returns it with its field."""
        text = f"{field}: {reason}; the {'sample' if field == 'q' else 'reading'} is not used"
        self.first.setdefault(field, text)
        return text

    def _base(self, wrench: np.ndarray, qd: np.ndarray) -> str:
        """Why the base sensor's value cannot be used; empty if it can."""
        found = self._limits.saturation(wrench)
        if found is not None:
            return found.reason
        if self._checks_weight and self._right < _SAMPLES:
            force = wrench[:3].tolist()
            off = dist(force, self._weight)
            # The words stay the same while it lasts: a change of them would be news.
            if self._note_weight(off, max(map(abs, qd.tolist()))) and not self._contradiction:
                self._contradiction = self._explain(wrench[:3])
            return self._contradiction
        return ""

    def _note_weight(self, off: float, speed: float) -> bool:
        """Take the deviation of one sample [N] into account; returns whether it is a contradiction.

        In motion, and without a finite value, nothing changes.
        """
        if not (speed < _AT_REST and isfinite(off)):
            return False
        if off > self._tolerance:
            self._right = 0
            self._choose()
            return True
        self._right, self._contradiction = self._right + 1, ""
        self._choose()
        return False

    def _weight_contradicts(self, base: np.ndarray, qd: np.ndarray, skipped: np.ndarray) -> np.ndarray:
        """Which of N samples contradict the arm's weight, shape (N,), bool."""
        found = np.zeros(len(base), dtype=bool)
        if not self._checks_weight:
            return found
        # The square of an implausible number may overflow.
        off = np.hypot.reduce(base[:, :3] - self._weight, axis=1).tolist()
        speed = np.abs(qd).max(axis=1).tolist()
        for i, skip in enumerate(skipped.tolist()):
            if self._right >= _SAMPLES:
                break
            if skip or not isfinite(off[i]):
                continue
            if self._note_weight(off[i], speed[i]) and not self._contradiction:
                self._contradiction = self._explain(base[i, :3])
                self._note("base_wrench", self._contradiction)
            found[i] = self._contradiction != ""
        return found

    def _explain(self, force: np.ndarray) -> str:
        """What is wrong with a force, shape (3,) [N], that contradicts the arm's weight."""
        weight = np.array(self._weight)
        size, expected = hypot(*force.tolist()), hypot(*self._weight)
        cosine = (force / size) @ (weight / expected) if size else 1.0
        tilt = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        if size < WEIGHT_TOLERANCE * expected:
            advice = "is the sensor tared? See base_wrench.bias"
        elif tilt > 180.0 - 15.0:
            advice = "it points the opposite way; see base_wrench.sign and mounting"
        elif abs(size - expected) < 0.5 * WEIGHT_TOLERANCE * expected:
            advice = f"it is tilted by {tilt:.0f} deg; see mounting and base_wrench.rpy"
        else:
            ratio = size / expected
            times = f"{ratio:.2f}" if ratio < 1e3 else f"{ratio:.2g}"
            advice = (
                f"it carries {times} times the mass of the scene; see robot and tool.mass, or "
                "is the arm touched?"
            )
        return (
            f"expected the weight of arm and tool, force {in_words(weight)} N at rest, got {in_words(force)} "
            f"N; {advice}; `contactsense check SCENE` finds the line"
        )


def _without(value: np.ndarray) -> np.ndarray:
    """The value with NaN in place of its first number: there is a value, and it is invalid."""
    value = np.array(value, dtype=np.float64)
    value[0] = np.nan
    return value


def _without_rows(values: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """The same for some of N values, shape (N, k)."""
    values = values.copy()
    values[rows, 0] = np.nan
    return values
