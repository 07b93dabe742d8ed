"""A latched collision outlives `kill -9` of the service, and the registers tell of it; an acknowledged one
does not come back."""

import contextlib
import os
import signal
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from contactsense.service.api import READY
from contactsense.service.demo.child_process import Child, child
from contactsense.service.mock.arm.simulated_arm import simulate
from contactsense.service.mock.servers import MockServers, MockSettings
from tests.service import http
from tests.service.loopback import until
from tests.service.test_reactions import RULES, SCRIPT

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]
FIRST = MockSettings(rtde_port=0, netft_port=0, http_port=0, loop=True)
QUIET = SCRIPT.model_copy(update={"contacts": ()})


@contextlib.contextmanager
def serving(servers: MockServers, folder: Path) -> Iterator[tuple[Child, str]]:
    (folder / "rules.yaml").write_text(yaml.safe_dump({**RULES, "robot": {"rtde_port": servers.rtde.port}}))
    options = {
        "--robot-host": servers.rtde.host,
        "--robot-port": servers.rtde.port,
        "--ft-host": servers.netft.host,
        "--ft-port": servers.netft.port,
        "--ft-http-port": servers.netft.http_port,
        "--reactions": folder / "rules.yaml",
        "--journal": folder / "events.db",
        "--port": 0,
    }
    with child("serve", *[str(part) for option in options.items() for part in option]) as service:
        yield service, service.wait_for(READY)


def state(url: str) -> dict[str, Any]:
    found: dict[str, Any] = http.get(f"{url}/v1/reactions").json()
    return found


def test_a_latch_outlives_the_service(tmp_path: Path) -> None:
    def kept() -> list[Any]:
        with contextlib.closing(sqlite3.connect(tmp_path / "events.db")) as database:
            return database.execute("SELECT rule FROM latches").fetchall()

    with MockServers(simulate(SCRIPT), FIRST) as servers, serving(servers, tmp_path) as (service, url):
        assert until(lambda: state(url)["latched"], 280.0)
        assert until(kept)
        os.kill(service.pid, signal.SIGKILL)
    with MockServers(simulate(QUIET), FIRST) as servers:
        inputs = servers.rtde.controller.inputs
        with serving(servers, tmp_path) as (service, url):
            (latch,) = state(url)["latched"]
            assert (latch["rule"], latch["link"]) == ("arm", "forearm")
            assert until(lambda: "input_int_register_47" in inputs, 280.0)
            # From the first write on: the robot program never reads that nothing happened.
            assert inputs["input_int_register_47"] == (42,)
            assert inputs["input_bit_register_66"] == (True,)
            assert until(lambda: http.get(f"{url}/v1/ready").status_code == 200, 60.0, step=0.05)
            assert state(url)["latched"] == [latch]
            assert http.post(f"{url}/v1/reactions/acknowledge").json()["latched"] == []
            assert until(lambda: inputs["input_int_register_47"] == (0,))
            assert until(lambda: not kept())
            os.kill(service.pid, signal.SIGKILL)
        with serving(servers, tmp_path) as (_, url):
            assert until(lambda: http.get(f"{url}/v1/ready").status_code == 200, 280.0, step=0.05)
            assert state(url)["latched"] == []
            assert inputs["input_int_register_47"] == (0,)
