"""The logs of `contactsense mock`: what the arm ran into, and when a reaction's registers were written."""

import json
import struct
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from contactsense.service.cli import mock
from contactsense.service.cli.main import cli
from contactsense.service.demo.child_process import child
from contactsense.service.mock import READY
from contactsense.service.mock.interfaces.sent_log import SIZE, SentLog
from tests.service.loopback import until
from tests.service.mock.interfaces.test_rtde_server import PlainClient

SCRIPT = """
robot: ur5e
trajectory:
  start: [0.0, -1.3, 1.6, -1.9, -1.57, 0.0]
  moves: [{to: [1.2, -1.3, 1.6, -1.9, -1.57, 0.0], duration: 2.0}]
obstacles: [{kind: sphere, name: Säule, center: [-0.29, -0.26, 0.49], radius: 0.05}]
"""


@pytest.mark.slow
def test_collisions_and_written_registers_are_logged(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(SCRIPT, encoding="utf-8")
    contacts, received, sent = (tmp_path / name for name in ("Stöße.json", "empfangen", "sent"))
    ports = ("--rtde-port", "0", "--ft-port", "0", "--ft-http-port", "0")
    logs = ("--contact-log", str(contacts), "--received-log", str(received), "--sent-log", str(sent))
    with child("mock", "--script", str(tmp_path / "a.yaml"), *ports, *logs) as arm:
        port = int(arm.wait_for(READY).partition("RTDE port ")[2].partition(",")[0])
        with PlainClient(SimpleNamespace(host="127.0.0.1", port=port)) as client:
            assert client.ask("V", b"\x00\x02") == b"\x01"
            recipe = client.ask("I", b"input_int_register_47,input_double_register_46")
            client.start("timestamp")
            (stamp,) = client.data(">Bd")[1:]
            client.send("U", recipe[:1] + struct.pack(">id", 2, stamp))
            assert until(lambda: SentLog(received).left_ns(stamp))
            assert SentLog(received).left_ns(stamp) >= SentLog(sent).left_ns(stamp) > 0
            while client.data(">Bd")[1] < 2.0:  # the arm has arrived, or stands against the obstacle
                pass
    assert received.stat().st_size == 16 * SIZE
    first = json.loads(contacts.read_text(encoding="utf-8"))[0]
    assert first["obstacle"] == "Säule"
    assert first["peak_force"] > 10.0
    assert 0.0 < first["start"] < first["end"]


@pytest.mark.parametrize("option", ["--contact-log", "--received-log", "--sent-log"])
@pytest.mark.parametrize(
    ("name", "reason"),
    [("none/log", "there is no folder none"), ("folder", "expected a file, got the folder")],
)
def test_a_log_that_cannot_be_written_is_told_at_the_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, option: str, name: str, reason: str
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(mock, "_run", lambda *_: 0)  # which would go on until interrupted
    (tmp_path / "folder").mkdir()
    done = CliRunner().invoke(cli, ["mock", "--rtde-port", "0", option, name])
    assert done.exit_code == 1
    assert f"{option}: " in done.output
    assert reason in done.output
