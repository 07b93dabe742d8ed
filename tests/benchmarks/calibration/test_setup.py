"""Every mistake in a scene is named, on few draws; `contactsense bench setup` makes the table of many."""

import json

import pytest
from click.testing import CliRunner

from contactsense.benchmarks.calibration.setup import setup
from contactsense.benchmarks.calibration.setup_draws import MISTAKES


@pytest.mark.long
def test_every_mistake_is_named_and_no_right_setup_accused() -> None:
    arguments = ["--arm", "ur10e", "--draws", "1", "--right", "3", "--json"]
    said = json.loads(CliRunner().invoke(setup, arguments).stdout)
    assert said["misnamed"] == []
    assert said["right_accused"] == []
    alone = {kind: counts["ur10e"]["alone"] for kind, counts in said["mistakes"].items()}
    assert alone == dict.fromkeys(MISTAKES, 1)


@pytest.mark.slow
def test_the_table_is_printed() -> None:
    result = CliRunner().invoke(setup, ["--arm", "ur5e", "--draws", "0", "--right", "1", "--seconds", "8"])
    assert result.exit_code == 0, result.output
    assert "right setups with a line reported as wrong: 0 of 1" in result.output
    assert max(len(line) for line in result.output.splitlines()) <= 80


@pytest.mark.long
def test_pairs_of_mistakes_are_counted() -> None:
    arguments = ["--arm", "ur5e", "--draws", "1", "--seconds", "8", "--pairs", "--torques-alone", "--json"]
    said = json.loads(CliRunner().invoke(setup, arguments).stdout)
    for kind, row in said["pairs"].items():
        assert row["cells"] == 1, kind
        missed = sum(item["kind"] == kind for item in said["missed"])
        assert row["both"] == row["cells"] - missed
