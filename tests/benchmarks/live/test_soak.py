"""A minute at 500 Hz with readers that come, go and stall: nothing is lost, nothing grows without bound."""

import json

import pytest
from click.testing import CliRunner

from contactsense.benchmarks.live.soak import soak


@pytest.mark.long
@pytest.mark.realtime
@pytest.mark.timeout(600)
def test_a_minute() -> None:
    outcome = CliRunner().invoke(soak, ["--minutes", "1", "--json"], standalone_mode=False)
    result = json.loads(outcome.stdout)
    assert result["lost_on_the_wire"] == 0
    assert result["restarts"] == 0
    assert result["visits"] > 5
    assert not result["events_missed"]
    assert result["memory"] < 2000.0
