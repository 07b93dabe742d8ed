"""A service that starts before its robot. No other live service runs beside it: two simulated cells in one
process would hold each other up."""

import pytest

from contactsense.service.api.app import create_app
from contactsense.service.api.settings import Settings
from contactsense.service.mock.arm.simulated_arm import simulate
from contactsense.service.mock.servers import MockServers, MockSettings
from tests.service.loopback import own_address
from tests.service.serving import serving
from tests.service.test_live import SCRIPT, Play


@pytest.mark.slow
def test_a_robot_that_is_dead_at_the_start() -> None:
    host = own_address()
    chosen = MockSettings(host=host, rtde_port=30004, netft_port=49152, http_port=49180, loop=True)
    settings = Settings(robot_host=host, ft_host=host, ft_http_port=49180)
    with serving(create_app(settings)) as place:
        play = Play(simulate(SCRIPT), None, place)  # type: ignore[arg-type]
        health = play.until(lambda health: health.status == "waiting")
        assert health.pipeline.restarts == 0
        assert f"robot at {host}:30004 cannot be reached" in health.message
        assert "force/torque sensor" in health.message
        with MockServers(play.motion, chosen):
            play.until(lambda health: health.status == "ok")
