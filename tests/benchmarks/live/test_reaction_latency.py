"""The measurement of reactions: it runs, and each write belongs to a sample."""

import json

import pytest
from click.testing import CliRunner

from contactsense.benchmarks.live.latency import latency
from contactsense.service.mock.interfaces.received_log import CODE, TIME, ReceivedLog
from contactsense.service.mock.interfaces.sent_log import SIZE, SentLog


def test_the_first_write_of_a_sample_counts(tmp_path) -> None:
    log, seen = ReceivedLog(tmp_path / "log", t0=5.0), SentLog(tmp_path / "log", t0=5.0)
    log.note({CODE: (0,), TIME: (5.01,)}, 1)  # a heartbeat without a contact
    log.note({TIME: (5.01,)}, 2)
    assert seen.left_ns(5.01) == 0
    log.note({CODE: (41,), TIME: (5.01,)}, 3)
    log.note({CODE: (41,), TIME: (5.01,)}, 4)
    assert seen.left_ns(5.01) == 3
    assert seen.left_ns(5.012) == 0


def test_a_later_sample_takes_the_place_of_one_with_the_same_remainder(tmp_path) -> None:
    log, seen = ReceivedLog(tmp_path / "log"), SentLog(tmp_path / "log")
    later = 1.0 + SIZE / 500.0
    log.note({CODE: (1,), TIME: (1.0,)}, 11)
    assert (seen.left_ns(1.0), seen.left_ns(later)) == (11, 0)
    log.note({CODE: (1,), TIME: (later,)}, 99)
    assert (seen.left_ns(1.0), seen.left_ns(later)) == (0, 99)


def test_a_time_that_is_no_number_is_left_out(tmp_path) -> None:
    ReceivedLog(tmp_path / "log").note({CODE: (1,), TIME: (float("nan"),)}, 1)


@pytest.mark.long
@pytest.mark.realtime
def test_it_measures() -> None:
    measured = CliRunner().invoke(latency, ["--reaction", "--seconds", "5", "--json"])
    assert measured.exit_code == 0, measured.output
    result = json.loads(measured.stdout)
    assert result["onsets"] > 0
    assert result["writes"] == sum(count for _, count in result["histogram"])
    assert 0.0 < result["p50"] <= result["p99"] <= result["worst"]
