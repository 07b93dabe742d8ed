"""The measurement of round trips: short, for its form, and that no sample stays without an answer."""

import json

import pytest
from click.testing import CliRunner

from contactsense.benchmarks.live.latency import latency


@pytest.mark.slow
@pytest.mark.realtime
@pytest.mark.parametrize("options", [["--track", "push"], ["--track", "own", "--messagepack"]])
def test_every_sample_is_answered(options: list[str]) -> None:
    done = CliRunner().invoke(latency, [*options, "--seconds", "1", "--json"], standalone_mode=False)
    assert done.exception is None, done.output
    result = json.loads(done.stdout)
    assert result["estimates"] == result["samples"] == 500
    assert sum(count for _, count in result["histogram"]) == 500
    assert 0.0 < result["p50"] <= result["p99"] <= result["worst"]
