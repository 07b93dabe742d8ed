"""What is worth a line in the log: a change, not reasons that come and go."""

from contactsense.service.live.status_log import PAUSE, StatusLog


def test_each_change_of_status_is_told() -> None:
    log = StatusLog()
    told = [log.is_news(status, "why", 0.1 * i) for i, status in enumerate(("ok", "ok", "failing", "ok"))]
    assert told == [True, False, True, True]


def test_reasons_that_alternate_are_told_once() -> None:
    log = StatusLog()
    lasting, fleeting = "a line of the scene is wrong", "expected 21.4 N, got 3 N"
    messages = (lasting, f"{fleeting}; {lasting}")
    told = [log.is_news("degraded", messages[i % 2], 0.5 * i) for i in range(1000)]
    assert told == [True, True, *[False] * 998]


def test_a_new_reason_and_one_that_returns_after_a_pause_are_told() -> None:
    log = StatusLog()
    end = int(2.5 * PAUSE)
    told = [log.is_news("degraded", "a" if t < end else "b", float(t)) for t in range(2 * end)]
    assert [t for t, news in enumerate(told) if news] == [0, end]  # both last longer than the pause
    assert log.is_news("degraded", "a; b", 2.0 * end)


def test_numbers_are_no_news() -> None:
    log = StatusLog()
    assert log.is_news("waiting", "no sample for 1.0 s", 1.0)
    assert not log.is_news("waiting", "no sample for 12.5 s", 12.5)
