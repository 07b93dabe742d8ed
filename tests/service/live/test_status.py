"""The status is worked out from ages: nothing that stopped counts as well."""

from dataclasses import replace

import pytest

from contactsense.service.live.status import Facts, assess

WELL = Facts("running", report_age=0.1, sample_age=0.01, estimate_age=0.01, connected=True)


def test_all_is_well():
    told = ("ok", ("samples arrive and are estimated",))
    assert assess(WELL) == told
    assert assess(replace(WELL, report_age=0.99, sample_age=0.99, estimate_age=0.99)) == told


@pytest.mark.parametrize(
    ("change", "status", "reason"),
    [
        ({"process": "none"}, "idle", "no robot is configured"),
        ({"process": "starting"}, "starting", "loading its kernels"),
        ({"process": "starting", "loading": "3 of 5 are compiled"}, "starting", "3 of 5 are compiled"),
        ({"process": "starting", "end": "ended (exit code 3)"}, "failing", "exit code 3"),
        ({"process": "ended", "end": "ended (exit code 3)"}, "failing", "being restarted"),
        ({"report_age": 1.01}, "failing", "has not reported for 1.0 s"),
        ({"report_age": 1.2}, "failing", "has not reported for 1.2 s"),
        ({"connected": False}, "waiting", "no data from the robot"),
        ({"connected": False, "trouble": ("robot at a: mute",)}, "waiting", "a: mute"),
        ({"sample_age": None}, "waiting", "no usable sample from the robot yet"),
        ({"sample_age": 1.5, "trouble": ("NaN",)}, "waiting", "no usable sample from the robot for 1.5 s"),
        ({"estimate_age": 1.5}, "failing", "but no estimate for 1.5 s"),
        ({"estimate_age": None}, "failing", "but no estimate yet"),
        ({"trouble": ("the sensor reads exactly zero",)}, "degraded", "reads exactly zero"),
        ({"others": ("status watch had to be started again",)}, "degraded", "status watch"),
        ({"estimate": "blind"}, "degraded", "the latest estimate is degraded: blind"),
        ({"doubt": "a line of the scene is wrong"}, "degraded", "a line of the scene is wrong"),
        ({"doubt": "wrong", "others": ("status watch",)}, "degraded", "status watch; wrong"),
    ],
)
def test_what_is_not_well(change, status, reason):
    found, reasons = assess(replace(WELL, **change))
    assert found == status
    assert reason in "; ".join(reasons)


def test_a_value_that_cannot_be_is_told_beside_other_trouble():
    trouble = replace(WELL, trouble=("5% of the packets were lost",))
    assert len(assess(replace(trouble, estimate="base_wrench is missing"))[1]) == 1
    reason = "q: expected positions in rad, got -90"
    assert assess(replace(trouble, estimate=reason, doubt="wrong"))[1][1:] == (
        f"the latest estimate is degraded: {reason}",
    )
