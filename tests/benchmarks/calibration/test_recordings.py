"""Real recordings of a UR10e: what calibration leaves of free motion, and that a stream says no more and no
less than what happened."""

import numpy as np
import pytest

from contactsense.benchmarks.calibration.recordings import FREE, left_out, measure
from tests.shared import shared


@pytest.mark.slow
def test_free_motion_has_no_alarms_and_every_touch_is_found() -> None:
    result = measure(shared("ur10e_recordings"))
    free = result["free"]
    ours, theirs = free["collision_free"], free["collision_free (authors)"]
    for level in ("rms", "q999"):
        assert (np.array(ours[level]) < np.array(theirs[level])).all()
    assert [free[name]["alarms"] for name in FREE] == [0] * len(FREE)
    assert 10.0 < free["collision_free"]["energy"] < 22.0
    for name, count in (("collision_forearm", 11), ("push_pose_1", 4)):
        found = result["touched"][name]
        assert len(found["touches"]) == len(found["onsets"]) == count
        for touch in found["touches"]:
            assert any(touch["start"] - 0.05 < t < touch["stop"] + 0.05 for t in found["onsets"])
    # Several of these files end in a hard stop.
    for group in ("identification", "jointwise"):
        assert not any(result[group].values())
    # In one file something acts on all joints for 0.15 s.
    assert sum(map(len, result["loaded"].values())) <= 1
    assert result["free_seconds"] > 600.0


@pytest.mark.slow
def test_touches_are_left_out_of_a_calibration_and_free_motion_is_not() -> None:
    found = left_out(shared("ur10e_recordings"), ("collision_free", "collision_forearm"))
    assert found["collision_free"] == []
    # A stream that was calibrated on free motion reports eleven; this fit has seen only the touched file.
    assert 9 <= len(found["collision_forearm"]) <= 11
