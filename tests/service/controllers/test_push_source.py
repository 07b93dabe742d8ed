"""Samples that a controller pushes, as the pipeline's process receives them."""

import json
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from contactsense import Scene
from contactsense.service.controllers.framing import frame
from contactsense.service.controllers.push_source import PushSource

SCENE = Scene.model_validate({"robot": "ur5e", "base_wrench": None})
GOOD = {"t": 1.0, "q": [0.0] * 6, "qd": [0.0] * 6, "joint_torque": [1.0] * 6}


@pytest.fixture
def source(tmp_path: Path) -> Iterator[PushSource]:
    made = PushSource(SCENE, tmp_path / "push")
    try:
        yield made
    finally:
        made.close()


def connected(tmp_path: Path) -> socket.socket:
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    connection.connect(str(tmp_path / "push"))
    return connection


def test_a_controller_that_hangs_up_after_a_bad_message_ends_nothing(
    source: PushSource, tmp_path: Path
) -> None:
    with connected(tmp_path) as first:
        source.poll(0.0)
        first.sendall(frame(b"{}", False) + frame(b"{}", False))
    assert source.poll(0.2) == []
    assert source.health.unusable == 2
    with connected(tmp_path) as second:
        source.poll(0.0)
        second.sendall(frame(json.dumps(GOOD).encode(), False))
        (sample,) = source.poll(1.0)
        assert sample.t == 1.0
