"""SIGHUP to `contactsense serve`: a good scene is taken, a bad one changes nothing, and the log says so."""

import json
import os
import signal
from pathlib import Path

import httpx
import pytest

from contactsense.service.cli.serve import READY
from contactsense.service.demo.child_process import child
from tests.service import http
from tests.service.loopback import until


@pytest.mark.slow
def test_a_scene_is_reloaded_by_a_signal(tmp_path: Path) -> None:
    scene, log = tmp_path / "scene.yaml", tmp_path / "log"
    scene.write_text("robot: ur5e\n")
    arguments = ("--scene", str(scene), "--port", "0", "--log-file", str(log), "--log-format", "json")
    with child("serve", *arguments) as service:
        url = service.wait_for(READY)

        def answers() -> bool:
            try:
                return http.get(f"{url}/v1/ready").status_code == 200
            except httpx.HTTPError:
                return False

        assert until(answers, 60.0)

        def reloaded(ok: bool) -> bool:
            found = http.get(f"{url}/v1/health").json()["reload"]
            return found is not None and found["ok"] is ok

        scene.write_text("robot: ur10e\n")
        os.kill(service.pid, signal.SIGHUP)
        assert until(lambda: reloaded(True), 30.0)
        assert http.get(f"{url}/v1/robot").json()["name"] == "ur10e"
        scene.write_text("robot: [")
        os.kill(service.pid, signal.SIGHUP)
        assert until(lambda: reloaded(False), 30.0)
        assert http.get(f"{url}/v1/robot").json()["name"] == "ur10e"
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    assert any(line["level"] == "error" and "nothing has changed" in line["message"] for line in lines)
