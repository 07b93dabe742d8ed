"""The measurement of the sources: short, for its form and for the one number that must be 0."""

import importlib.util
import json

import pytest
from click.testing import CliRunner

from contactsense.benchmarks.live.stream import StreamResult, free_address, measure, stream, table
from contactsense.service.cli.bench import BENCHES, bench


@pytest.mark.slow
def test_our_reader_loses_nothing_and_the_others_are_counted():
    """One mock, three readers, each in a process of its own: what the command says of them, and its table."""
    done = CliRunner().invoke(stream, ["--seconds", "1", "--json"], standalone_mode=False)
    assert done.exception is None, done.output
    ours, *others = results = [StreamResult(**result) for result in json.loads(done.stdout)]
    there = importlib.util.find_spec("rtde_receive") is not None
    assert [result.client for result in results] == ["rtde", *(["ur_rtde"] if there else []), "joined"]
    assert ("ur_rtde is not installed" in done.stderr) == (not there)
    assert done.return_value == ours.lost == 0
    assert 400 < ours.samples < 650
    assert 0.0 < ours.late_p50 <= ours.late_p99
    for other in others:
        assert 0 <= other.lost < other.samples
    lines = list(table(results))
    assert lines[0].split()[:2] == ["source", "samples"]
    assert len(lines) == 1 + len(results)


def test_help_names_every_measurement():
    done = CliRunner().invoke(bench, ["--help"])
    assert done.exit_code == 0
    for name in BENCHES:
        assert name in done.output


def test_free_address_is_free():
    assert free_address(0) == "127.0.0.1"


@pytest.mark.long
@pytest.mark.realtime
def test_nothing_is_lost_in_half_a_minute():
    (ours,) = measure(("rtde",), 30.0, lambda _: None)
    assert ours.lost == 0
    assert ours.samples > 14_000
