"""Real recordings of a UR10e: what calibration leaves of free motion, and that a stream says no more and no
less than what happened."""

import numpy as np
import pytest

from contactsense.benchmarks.calibration.recordings import FREE, LOADED, left_out, measure
from tests.shared import shared


@pytest.mark.slow
def test_free_motion_has_no_alarms_and_every_touch_is_found() -> None:
    result = measure(shared("ur10e_recordings"))
    free = result["free"]
    ours, theirs = free["collision_free"], free["collision_free (authors)"]
    for level in ("rms", "q999"):
        assert (np.array(ours[level]) < np.array(theirs[level])).all()
    assert [free[name]["alarms"] for name in FREE] == [0] * len(FREE)
    # Above 20 with friction as calibrated: what the factor explains is no energy of a contact.
    assert 5.0 < free["collision_free"]["energy"] < 12.0
    # On another day friction is higher by a few per cent; nowhere does the factor do harm.
    for found in result["moving"].values():
        assert (np.array(found["estimated"]) < 1.02 * np.array(found["calibrated"])).all()
        # Stated as large as they are, apart from the tails of hard accelerations.
        excess = np.array(found["stated"]) / np.array(found["estimated"])
        assert 0.95 < excess.min() < excess.max() < 1.7
    cold = result["moving"]["collision_free"]
    ratio = np.array(cold["estimated"]) / np.array(cold["calibrated"])
    assert (ratio[[0, 2, 5]] < 0.7).all()
    assert np.mean(ratio) < 0.75
    assert (np.array(cold["factor"])[[0, 2, 5]] > 1.05).all()
    for name, count in (("collision_forearm", 11), ("push_pose_1", 4)):
        found = result["touched"][name]
        assert len(found["touches"]) == count
        onsets = np.array(found["onsets"])
        per_touch = [
            np.sum((touch["start"] - 0.05 < onsets) & (onsets < touch["stop"] + 0.05))
            for touch in found["touches"]
        ]
        assert per_touch == [1] * count
        assert len(onsets) == count
    # Several of these files end in a hard stop.
    for group in ("identification", "jointwise"):
        assert not any(result[group].values())
    # In one file the payload strikes something below it at the lowest point of the motion.
    assert [len(result["loaded"][name]) for name in LOADED] == [0, 1]
    (hit,) = result["strikes"][LOADED[1]]
    assert hit["height"] == pytest.approx(hit["lowest"], abs=0.01)
    assert hit["force"][2] > 0.9 * np.linalg.norm(hit["force"])
    assert hit["distance"] < 0.15
    assert result["free_seconds"] > 600.0


@pytest.mark.slow
def test_free_motion_is_not_left_out_of_a_calibration() -> None:
    """It is short and repeats itself, so that a fit to its quietest part does not determine the rest."""
    assert left_out(shared("ur10e_recordings"), ("collision_free",))["collision_free"] == []


@pytest.mark.slow
def test_touches_are_left_out_of_a_calibration() -> None:
    found = left_out(shared("ur10e_recordings"), ("collision_forearm",))
    # A stream that was calibrated on free motion reports eleven; this fit has seen only the touched file.
    assert 9 <= len(found["collision_forearm"]) <= 11


@pytest.mark.slow
def test_pushes_on_an_arm_at_rest_are_left_out_of_a_calibration_and_rest_is_not() -> None:
    found = left_out(shared("ur10e_recordings"), ("push_pose_1", "validation-p2", "validation-p9"))
    # What a person sees in the currents.
    pushes = ((2.0, 2.7), (4.6, 5.8), (8.4, 9.4), (11.9, 13.1))
    assert len(found["push_pose_1"]) == len(pushes)
    for (start, stop), contact in zip(pushes, found["push_pose_1"], strict=True):
        assert contact.start < start + 0.2
        assert contact.stop > stop - 0.2
    assert found["validation-p2"] == found["validation-p9"] == []
