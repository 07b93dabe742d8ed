"""A single estimate that lacks a reading does not change the status of the service."""

import json

from contactsense.plausibility.stream_start import FROM_START
from contactsense.service.live.latest_estimate import LatestEstimate


def estimate(reason: str = "") -> bytes:
    body = {"t": 1.0, "status": "degraded" if reason else "none", "reason": reason}
    return json.dumps(body, separators=(",", ":")).encode()


def test_what_lacks_a_reading_now_and_then_is_not_told() -> None:
    latest = LatestEstimate()
    assert latest.degraded(0.0) == ""
    for i in range(1000):
        latest.take(0.002 * i, estimate("base_wrench is missing" if i % 10 else ""))
        assert latest.degraded(0.002 * i) == ""


def test_a_doubt_about_the_scene_does_not_change_that() -> None:
    latest = LatestEstimate()
    latest.take(1.0, estimate(f"base_wrench is missing; {FROM_START}"))
    assert latest.degraded(1.0) == ""


def test_what_lacks_a_reading_for_longer_is_told() -> None:
    latest = LatestEstimate()
    latest.take(1.0, estimate("base_wrench is missing; joint_torque is missing"))
    latest.take(1.49, estimate("base_wrench is missing"))
    assert latest.degraded(1.49) == ""
    assert latest.degraded(1.51) == "base_wrench is missing"
    latest.take(2.0, estimate())
    assert latest.degraded(2.0) == ""


def test_a_value_that_cannot_be_is_told_at_once() -> None:
    latest = LatestEstimate()
    latest.take(1.0, estimate("q: expected positions in rad, got -90"))
    assert latest.degraded(1.0) == "q: expected positions in rad, got -90"
