"""The service under attack by half requests, large bodies, floods, idle readers: no sample is lost."""

import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from contactsense.service.api.client import Client
from contactsense.service.api.messages import HealthOut
from contactsense.service.demo.processes import Stage
from contactsense.service.mock.interfaces.rtde_server import RATE
from contactsense.service.mock.interfaces.sent_log import SIZE, SentLog
from tests.service.attackers import ATTACKS, attacked
from tests.service.loopback import until

pytestmark = [pytest.mark.slow, pytest.mark.realtime, pytest.mark.timeout(600)]

SECONDS = 8.0
"""Length of the attack with everything at once [s]."""


def health(client: Client) -> HealthOut:
    """The service's health, as soon as its limits let us in again."""
    deadline = time.monotonic() + 20.0
    while True:
        try:
            return client.health()
        except Exception:
            assert time.monotonic() < deadline
            time.sleep(0.2)


def is_felt(client: Client) -> bool:
    """Whether bodies too large, and heads that never come or connections that are too many, have arrived."""
    clients = health(client).clients
    return clients.beyond_limits["413"] > 0 and clients.late + clients.refused > 0


def each_alone(client: Client) -> None:
    """Each attack once, one after the other, while the stream is read.

    All at once they fight for the processor: on a small computer few requests would come through.
    """
    with ThreadPoolExecutor(1) as attacker:
        for attack in ATTACKS:
            running = attacker.submit(attack, client.url)
            while not running.done():
                client.receive()
            running.result()


def all_at_once(client: Client) -> None:
    """All attacks from processes of their own, while the stream is read."""
    with attacked(client.url):
        end = time.monotonic() + SECONDS
        while time.monotonic() < end:
            client.receive()


def test_no_attack_costs_a_sample(tmp_path: Path) -> None:
    sent = SentLog(tmp_path / "sent", rate=RATE)
    with Stage("ur5e") as stage:
        client = stage.start_service()
        arm = stage.start_arm("--loop", "--sent-log", str(tmp_path / "sent"))
        for _ in range(500):
            client.receive()
        before = client.health()
        each_alone(client)
        assert until(lambda: is_felt(client))
        all_at_once(client)
        arm.end()
        # What the mock has sent, not what it should have sent: attackers starve it, too, on a small computer.
        count = sum(sent.left_ns(k / RATE) > 0 for k in range(SIZE))
        assert until(lambda: health(client).source.robot.received >= count)
        after = health(client)
    assert after.source.robot.received == count
    assert count > before.source.robot.received + 0.3 * RATE * SECONDS  # the attack met a running stream
    assert after.source.robot.lost == before.source.robot.lost == 0
    assert after.pipeline.restarts == 0
