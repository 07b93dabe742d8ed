"""The reference for round trips: it runs before the measurement beside it begins."""

import pytest

from contactsense.benchmarks.live.echo import Echo


@pytest.mark.slow
def test_messages_go_to_and_fro_as_soon_as_it_runs():
    echo = Echo()
    with echo.run():
        pass
    times = echo.times()
    assert 0.0 < times.p50 <= times.p99 <= times.p999 <= times.worst
