"""Readings that are not finite, or whose squares overflow, in streams, recordings and requests."""

import numpy as np
import pytest

from contactsense import Estimate, Localizer, Sample, SampleBlock, Scene, WrenchSensor
from contactsense.robots.tool import Tool
from contactsense.sensors.stream_state import INVALID
from tests.plain_arm import plain_ur5e

Q = np.array([0.0, -1.3, 1.6, -1.9, -1.57, 0.0])
RANGE = (1000.0, 100.0)
NOT_FINITE = [np.nan, np.inf, -np.inf]
ROWS = 5
WRONG = 2
"""Row of the value."""


@pytest.fixture(scope="module", params=[None, RANGE], ids=["unknown range", "known range"])
def localizer(request: pytest.FixtureRequest) -> Localizer:
    sensor = WrenchSensor(rpy=(0.3, 0.5, 0.7), translation=(0.1, 0.2, 0.3), range=request.param)
    tool = Tool(mass=1.5, com=(0.0, 0.0, 0.05))
    return Localizer(Scene(robot=plain_ur5e(), tool=tool, base_wrench=sensor, wrist_wrench=sensor))


def recording(value: float, field: str) -> SampleBlock:
    """An arm at rest, with that value in one row of `base_wrench` or `wrist_wrench`."""
    weight = 9.81 * (plain_ur5e().mass + 1.5)
    readings = {
        "base_wrench": np.tile([0.0, 0.0, -weight, 0.0, 0.0, 0.0], (ROWS, 1)),
        "wrist_wrench": np.tile([0.0, 0.0, -14.7, 0.0, 0.0, 0.0], (ROWS, 1)),
    }
    readings[field][WRONG, 1] = value
    return SampleBlock(
        0.002 * np.arange(ROWS), np.tile(Q, (ROWS, 1)), np.zeros((ROWS, 6)), np.zeros((ROWS, 6)), **readings
    )


def stream(localizer: Localizer, block: SampleBlock) -> list[Estimate]:
    """The same samples one by one."""
    assert block.joint_torque is not None
    assert block.base_wrench is not None
    assert block.wrist_wrench is not None
    return list(
        localizer.run(
            Sample(
                float(block.t[i]), block.q[i], block.qd[i], block.joint_torque[i], block.base_wrench[i],
                block.wrist_wrench[i],
            )
            for i in range(ROWS)
        )
    )  # fmt: skip


@pytest.mark.parametrize(("field", "sensor"), [("base_wrench", 0), ("wrist_wrench", 2)])
@pytest.mark.parametrize("value", NOT_FINITE)
def test_a_stream_and_a_recording_lose_that_reading_only(
    localizer: Localizer, value: float, field: str, sensor: int
) -> None:
    """The weight is compared at the start of a stream: such a reading says nothing about mounting or mass."""
    block = recording(value, field)
    reasons = [estimate.reason for estimate in stream(localizer, block)]
    assert [f"{field} is not finite or implausibly large" in reason for reason in reasons] == [
        row == WRONG for row in range(ROWS)
    ]
    assert not localizer.refusals
    (result,) = localizer.run_blocks([block])
    assert not localizer.refusals
    assert np.flatnonzero(result.flags & INVALID << sensor).tolist() == [WRONG]


@pytest.mark.parametrize("value", [*NOT_FINITE, 1e160, 1e300])
@pytest.mark.parametrize("external", [True, False])
def test_a_request_is_refused_with_the_field(localizer: Localizer, value: float, external: bool) -> None:
    block = recording(value, "base_wrench")
    with pytest.raises(ValueError, match="base_wrench"):
        localizer.locate_batch(block.q, base_wrench=block.base_wrench, external=external)
