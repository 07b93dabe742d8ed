"""What is worth a line in the log: a change, not reasons that come and go."""

from contactsense.service.live.status_log import PAUSE, StatusLog


def test_each_change_of_status_is_told() -> None:
    log = StatusLog()
    told = [log.news(status, ["why"], 0.1 * i) for i, status in enumerate(("ok", "ok", "failing", "ok"))]
    assert told == ["why", "", "why", "why"]


def test_reasons_that_alternate_are_told_once() -> None:
    log = StatusLog()
    lasting, fleeting = "a line of the scene is wrong", "expected 21.4 N, got 3 N"
    reasons = ([lasting], [lasting, fleeting])
    told = [log.news("degraded", reasons[i % 2], 0.5 * i) for i in range(1000)]
    assert told == [lasting, f"{fleeting}; {lasting}", *[""] * 998]


def test_a_new_reason_and_one_that_returns_after_a_pause_are_told() -> None:
    log = StatusLog()
    end = int(2.5 * PAUSE)
    told = [log.news("degraded", ["a" if t < end else "b"], float(t)) for t in range(2 * end)]
    assert [t for t, news in enumerate(told) if news] == [0, end]  # both last longer than the pause
    assert log.news("degraded", ["a", "b"], 2.0 * end) == "a; b"


def test_numbers_are_no_news() -> None:
    log = StatusLog()
    assert log.news("waiting", ["no sample for 1.0 s"], 1.0)
    assert not log.news("waiting", ["no sample for 12.5 s"], 12.5)
    assert not log.news("waiting", ["no sample for 1.3e+02 s"], 13.5)
    assert log.news("degraded", ["expected within 3 N, got -3.1 N"], 14.0)
    assert not log.news("degraded", ["expected within 3 N, got 4.5 N"], 14.5)


def test_the_next_file_of_a_recording_is_no_news() -> None:
    """On a full disk there is one each second."""
    log = StatusLog()
    reason = "rec/service-20261130T08530{}-0000.arrows: cannot write: No space left on device"
    assert [bool(log.news("degraded", [reason.format(i)], float(i))) for i in range(3)] == [
        True,
        False,
        False,
    ]


def test_a_number_in_a_name_tells_one_from_the_other() -> None:
    log = StatusLog()
    for name in ("action lamp-{}", "action lamp{}", "joint_torque[{}]", "action /opt/{}/lamp"):
        for i in range(2):
            reason = f"{name.format(i)} failed after 3.1 s"
            assert log.news("degraded", [reason], 1.0) == reason


def test_a_line_stays_readable_where_hundreds_of_actions_fail() -> None:
    log = StatusLog()
    reasons = [f"action a{i} failed" for i in range(300)]
    told = log.news("degraded", reasons, 1.0)
    assert told.startswith("action a0 failed; action a1 failed; ")
    assert told.endswith("; and 296 more reasons, which GET /v1/health has")
    assert len(told) < 150
    news = "the journal cannot be written"
    assert log.news("degraded", [*reasons, news], 2.0).startswith(f"{news}; action a0 failed; ")


def test_reasons_that_never_return_are_forgotten() -> None:
    """A program may end its messages with an identifier, each time another one."""
    log = StatusLog()
    for t in range(1000):
        assert log.news("degraded", [f"action a failed: request {'abcdefghij'[t % 10] * (t + 1)}"], float(t))
    assert len(log._seen) <= PAUSE + 1
