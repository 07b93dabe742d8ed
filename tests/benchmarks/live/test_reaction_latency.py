"""The measurement of reactions: it runs, and each write belongs to a sample."""

import json

import pytest
from click.testing import CliRunner

from contactsense.benchmarks.live.latency import latency
from contactsense.service.mock.received_log import CODE, TIME, ReceivedLog
from contactsense.service.mock.sent_log import SentLog


def test_the_first_write_of_a_sample_counts(tmp_path) -> None:
    log, seen = ReceivedLog(tmp_path / "log", t0=5.0), SentLog(tmp_path / "log", t0=5.0)
    log.note({CODE: (0,), TIME: (5.01,)}, 1)  # a heartbeat without a contact
    log.note({TIME: (5.01,)}, 2)
    assert seen.left_ns(5.01) == 0
    log.note({CODE: (41,), TIME: (5.01,)}, 3)
    log.note({CODE: (41,), TIME: (5.01,)}, 4)
    assert seen.left_ns(5.01) == 3
    assert seen.left_ns(5.012) == 0


@pytest.mark.long
@pytest.mark.realtime
def test_it_measures() -> None:
    measured = CliRunner().invoke(latency, ["--reaction", "--seconds", "5", "--json"])
    assert measured.exit_code == 0, measured.output
    result = json.loads(measured.stdout)
    assert result["onsets"] > 0
    assert result["writes"] == sum(count for _, count in result["histogram"])
    assert 0.0 < result["p50"] <= result["p99"] <= result["worst"]
