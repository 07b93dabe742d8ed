"""Signals to `contactsense serve`: SIGHUP takes a good scene, and a bad one changes nothing; SIGINT answers
open requests."""

import json
import os
import signal
import socket
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import pytest

from contactsense.service.api import READY
from contactsense.service.api.http.ending import REASON
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


@pytest.mark.slow
def test_an_open_request_is_answered_at_the_end(tmp_path: Path) -> None:
    """Its body never comes."""
    log = tmp_path / "log"
    lines = (
        "POST /v1/locate HTTP/1.1",
        "Host: localhost",
        "Content-Type: application/json",
        "Content-Length: 9",
    )
    with child("serve", "--port", "0", "--log-file", str(log)) as service:
        address = urlsplit(service.wait_for(READY))
        with socket.create_connection((address.hostname, address.port), timeout=60.0) as client:
            client.sendall("\r\n".join((*lines, "", "{")).encode())
            metrics = f"http://{address.netloc}/metrics"
            assert until(lambda: "contactsense_connections 2.0" in http.get(metrics).text, 60.0)
            os.kill(service.pid, signal.SIGINT)
            answer = b"".join(iter(lambda: client.recv(4096), b""))
    assert answer.startswith(b"HTTP/1.1 503 ")
    assert json.loads(answer.split(b"\r\n\r\n")[1])["errors"][0]["reason"] == REASON
    assert "Traceback" not in log.read_text()
