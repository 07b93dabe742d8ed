"""Samples whose times differ by less than any clock tells."""

import math

import numpy as np
import pytest

from contactsense.robots.jit.flat_buffers import zeros
from contactsense.sensors.stream_state import (
    REPEATED,
    RESTARTED,
    SHORTEST_STEP,
    StreamState,
    register_sample,
    restart,
)


@pytest.mark.parametrize("step", [0.0, 5e-324, 1e-160, 0.9 * SHORTEST_STEP])
def test_they_are_of_the_same_time(step: float) -> None:
    """A rate over such a step, or its square, may be infinite, and what follows from it not a number."""
    stream = zeros(StreamState, joints=1, link_sensors=0)
    restart(stream)
    assert not register_sample(stream, 0.0, 3, 10.0) & REPEATED
    assert register_sample(stream, step, 3, 10.0) == REPEATED
    assert stream.clock[0].t == 0.0
    assert not register_sample(stream, 2.0 * SHORTEST_STEP, 3, 10.0) & (REPEATED | RESTARTED)
    assert stream.clock[0].step == 2.0 * SHORTEST_STEP
    assert register_sample(stream, SHORTEST_STEP, 3, 10.0) & RESTARTED
    assert math.isfinite(stream.clock[0].usual_step)
    assert np.isfinite(stream.steps).all()
