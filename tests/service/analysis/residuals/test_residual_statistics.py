"""Residuals over a recording do not depend on how it is cut into blocks."""

import numpy as np
import pytest

from contactsense import BlockEstimates
from contactsense.runtime.result_rows import WIDTH
from contactsense.sensors.stream_state import DEGRADED, TOUCHED
from contactsense.service.analysis.residuals.residual_statistics import ResidualStatistics, ResidualSummary

JOINTS, SAMPLES = 6, 60
FLAGS = np.zeros(SAMPLES, dtype=np.int64)
FLAGS[20:30] = TOUCHED
FLAGS[40:44] = DEGRADED
FLAGS[50:] = TOUCHED
FREE = np.r_[0:19, 30:40, 44:49]
"""Without contact, degraded samples, and the first sample of each contact, 19 and 49."""


def _blocks(cuts: list[int]) -> list[BlockEstimates]:
    """A recording, cut before these samples."""
    rng = np.random.default_rng(1)
    wrench, torque = rng.normal(size=(SAMPLES, 6)), rng.normal(size=(SAMPLES, JOINTS))
    parts = np.split(np.arange(SAMPLES), cuts)
    return [
        BlockEstimates(
            t=0.002 * part,
            flags=FLAGS[part],
            phase=np.zeros(len(part), dtype=np.int64),
            number=np.zeros(len(part), dtype=np.int64),
            usable=np.ones((len(part), 2), dtype=bool),
            energy=np.ones(len(part)),
            consistency=np.ones((len(part), 3)),
            base_wrench=wrench[part],
            base_wrench_std=np.full((len(part), 6), 2.0),
            joint_torque=torque[part],
            joint_torque_std=np.full((len(part), JOINTS), 0.5),
            joint_bias=np.zeros((len(part), JOINTS)),
            joint_friction=np.zeros((len(part), JOINTS)),
            sample=np.empty(0, dtype=np.int64),
            contact=np.empty(0, dtype=np.int64),
            rows=np.empty((0, WIDTH)),
            link_probability=np.empty((0, 7)),
            estimates={},
        )
        for part in parts
    ]


def _summary(cuts: list[int]) -> ResidualSummary:
    statistics = ResidualStatistics(JOINTS, 0.0, 0.002 * SAMPLES)
    for block in _blocks(cuts):
        statistics.add(block)
        statistics.summary()  # it may be asked for at any time, and does not change what follows
    return statistics.summary()


@pytest.mark.parametrize("cuts", [[], [20], [19, 20, 21], [50], [8, 30, 40, 44], list(range(1, SAMPLES))])
def test_the_first_sample_of_a_contact_is_not_free_wherever_a_block_ends(cuts: list[int]) -> None:
    (whole,) = _blocks([])
    found = _summary(cuts)
    assert (found.free, found.touched, found.degraded) == (len(FREE), 20, 4)
    base = np.sqrt(np.mean((whole.base_wrench[FREE] / 2.0) ** 2, axis=0))
    joint = np.sqrt(np.mean((whole.joint_torque[FREE] / 0.5) ** 2, axis=0))
    np.testing.assert_allclose(found.base_ratio, base, rtol=1e-12)
    np.testing.assert_allclose(found.joint_ratio, joint, rtol=1e-12)


def test_the_last_sample_of_a_recording_is_free_without_a_contact() -> None:
    statistics = ResidualStatistics(JOINTS, 0.0, 0.002 * SAMPLES)
    for block in _blocks([10])[:1]:
        statistics.add(block)
    assert statistics.summary().free == 10
